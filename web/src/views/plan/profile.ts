/// The flight over time, from the waypoints alone: straight ways at the plan's speed, dwelling where it measures. Turns,
/// height searches and extra points, which the forecast counts, have no place along it. No DOM.
import { setting, type Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { to_m } from './draft';

export interface Moment {
  readonly t_s: number;
  readonly height_m: number;
  readonly waypoint: number;
}

/// Arrival at each waypoint, and its departure where it dwells, from the first waypoint on.
export function profile(p: Plan, origin: Geodetic): Moment[] {
  const speed = setting(p, 'speed_mps'),
    dwell = setting(p, 'dwell_s'),
    out: Moment[] = [];
  let t = 0;
  p.waypoints.forEach((w, i) => {
    const before = p.waypoints[i - 1];
    if (before) {
      const [a, b] = [to_m(before, origin), to_m(w, origin)];
      t += Math.hypot(a[0] - b[0], a[1] - b[1], before.height_above_ground_m - w.height_above_ground_m) / speed;
    }
    out.push({ t_s: t, height_m: w.height_above_ground_m, waypoint: i });
    if (!w.measure) return;
    t += w.dwell_s ?? dwell;
    out.push({ t_s: t, height_m: w.height_above_ground_m, waypoint: i });
  });
  return out;
}
