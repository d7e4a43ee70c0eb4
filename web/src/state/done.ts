/// When an anchor is done, in one place, so that no two counts on a screen differ. The limits are the server's, in the gates of an estimate: the target
/// of the plan that is flown, else the goal of the site. No DOM.
import type { AnchorTask, ProcedureMsg } from '../live/flight_messages';
import type { EstimateMsg, MissionMsg } from '../live/messages';
import { is_goal } from '../ui/gates';
import type { Scene } from './scene';

export const over = (p: ProcedureMsg | null | undefined): boolean => p?.status === 'done' || p?.status === 'aborted';
/// What the procedure does about an anchor.
export const task_of = (p: ProcedureMsg | null | undefined, anchor: string): AnchorTask | undefined =>
  p?.anchors.find((t) => t.anchor === anchor);

/// The likelier of two solutions is the anchor; the other is drawn as its mirror. Reflected in the line between them, like its covariance.
export function likelier<T extends EstimateMsg>(e: T): T {
  const m = e.mirror;
  if (!m?.enu_m || !e.enu_m || m.probability === null || e.probability === null || m.probability <= e.probability)
    return e;
  const [de, dn] = [m.enu_m[0] - e.enu_m[0], m.enu_m[1] - e.enu_m[1]],
    length = Math.hypot(de, dn),
    level = length < 1e-6, // above or below: the horizontal part stays
    axis_deg = (Math.atan2(de, dn) * 180) / Math.PI + 90,
    [x, y] = level ? [0, 0] : [de / length, dn / length],
    [rxx, rxy, ryy] = [1 - 2 * x * x, -2 * x * y, 1 - 2 * y * y],
    [ee, en, eu, nn, nu, uu] = (e.cov_enu_m2 ?? [0, 0, 0, 0, 0, 0]) as [number, number, number, number, number, number];
  return {
    ...e,
    lon: m.lon,
    lat: m.lat,
    h_m: m.h_m,
    enu_m: m.enu_m,
    probability: m.probability,
    mirror: { lon: e.lon, lat: e.lat, h_m: e.h_m, enu_m: e.enu_m, probability: e.probability },
    ellipse95:
      e.ellipse95 && !level
        ? { ...e.ellipse95, azimuth_deg: (((2 * axis_deg - e.ellipse95.azimuth_deg) % 180) + 180) % 180 }
        : e.ellipse95,
    cov_enu_m2: e.cov_enu_m2 && [
      rxx * rxx * ee + 2 * rxx * rxy * en + rxy * rxy * nn,
      rxx * rxy * ee + (rxx * ryy + rxy * rxy) * en + rxy * ryy * nn,
      rxx * eu + rxy * nu,
      rxy * rxy * ee + 2 * rxy * ryy * en + ryy * ryy * nn,
      rxy * eu + ryy * nu,
      uu,
    ],
  };
}

/// What the procedure reached stays reached, also where the running estimate leaves its target again for a moment.
function by_task(e: EstimateMsg, p: ProcedureMsg | null | undefined): EstimateMsg {
  if (task_of(p, e.anchor)?.reached !== true) return e;
  const gates = e.gates.map((g) => (is_goal(g) ? { ...g, passed: true } : g)),
    done = e.status === 'estimating' && e.verdict === 'ok' && gates.length > 0 && gates.every((g) => g.passed);
  return { ...e, status: done ? 'converged' : e.status, gates };
}
/// The estimate with the status that is shown. While the aircraft still works on an anchor it is not done, and what ran out of time, points or
/// battery, by a person, or by the end of the flight was given up: neither is ever green. What a person accepted in flight reads so.
export function as_shown(given: EstimateMsg, p: ProcedureMsg | null | undefined): EstimateMsg {
  const e = by_task(likelier(given), p);
  const task = task_of(p, e.anchor);
  if (task?.accepted && e.status !== 'ambiguous' && e.status !== 'moved') return { ...e, status: 'accepted' };
  if (!task || task.reached || e.status === 'accepted' || e.status === 'moved' || e.status === 'ambiguous') return e;
  if (task.done || over(p)) return { ...e, status: 'gave_up' };
  return e.status === 'converged' ? { ...e, status: 'estimating' } : e;
}
export const shown_estimate = (scene: Scene | null, anchor: string): EstimateMsg | null => {
  const e = scene?.anchors.get(anchor)?.value;
  return e ? as_shown(e, scene.procedure?.value) : null;
};
export const shown_estimates = (scene: Scene | null): EstimateMsg[] =>
  scene ? [...scene.anchors.values()].map((a) => as_shown(a.value, scene.procedure?.value)) : [];
export const is_done = (e: EstimateMsg): boolean => e.status === 'converged' || e.status === 'accepted';

export interface DoneCount {
  readonly done: number;
  readonly gave_up: number;
  readonly total: number;
}
export function done_count(scene: Scene | null, m: MissionMsg | null): DoneCount {
  const shown = shown_estimates(scene),
    p = scene?.procedure?.value,
    tasks = p?.anchors ?? [];
  if (!shown.length && !tasks.length)
    return { done: m?.anchors_converged ?? 0, gave_up: 0, total: m?.anchors_found ?? 0 };
  const status = new Map(shown.map((e) => [e.anchor, e])),
    ids = new Set([...status.keys(), ...tasks.map((t) => t.anchor)]);
  const left = (t: AnchorTask): boolean =>
    !t.reached && (t.done || over(p)) && status.get(t.anchor)?.status !== 'accepted';
  return {
    done: shown.filter(is_done).length,
    gave_up: tasks.filter(left).length,
    total: Math.max(ids.size, m?.anchors_found ?? 0),
  };
}
/// Why the procedure has not finished an anchor, in its own words; empty where it has, or does not know it.
export function task_reason(p: ProcedureMsg | null | undefined, anchor: string): string {
  const t = task_of(p, anchor);
  return t && !t.reached ? t.why : '';
}

/// What the convergence of an anchor is measured by, and its limit, as the server holds the estimate against it; null where it gave none.
export interface Goal {
  readonly of: 'sigma' | 'h95';
  readonly limit_m: number;
}
export function goal_of(e: EstimateMsg | null): Goal | null {
  const limit = (name: string): number | null => e?.gates.find((g) => g.name === name)?.limit ?? null,
    [sigma_m, h95_m] = [limit('target_sigma_m'), limit('goal_h95_m')];
  if (sigma_m !== null) return { of: 'sigma', limit_m: sigma_m };
  return h95_m === null ? null : { of: 'h95', limit_m: h95_m };
}
