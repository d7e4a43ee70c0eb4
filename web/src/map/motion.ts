/// How fast what is drawn moves on the screen. No DOM.
import type { Scene } from '../state/scene';

const TURN_DEG = 2; // less nobody sees

/// So long the drone takes, as it is interpolated, to move by one pixel or to turn by what one sees; Infinity while it stands.
export function ms_a_pixel({ before: a, pose: b }: Pick<Scene, 'before' | 'pose'>, px_per_m: number): number {
  if (!a?.value.enu_m || !b?.value.enu_m || b.came_ms <= a.came_ms) return Infinity;
  const [p, q] = [a.value.enu_m, b.value.enu_m],
    turn_deg = (((((b.value.heading_deg ?? 0) - (a.value.heading_deg ?? 0)) % 360) + 540) % 360) - 180,
    steps = Math.max(Math.hypot(q[0] - p[0], q[1] - p[1]) * px_per_m, Math.abs(turn_deg) / TURN_DEG);
  return (b.came_ms - a.came_ms) / steps;
}
