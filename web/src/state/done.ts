/// When an anchor is done, in one place, so that no two counts on a screen differ. The limits are the server's: the accuracy goal in the gates of an
/// estimate, and, where a procedure flies, the target it works towards. No DOM.
import type { AnchorTask, ProcedureMsg } from '../live/flight_messages';
import type { EstimateMsg, MissionMsg } from '../live/messages';
import type { Scene } from './scene';

export const over = (p: ProcedureMsg | null | undefined): boolean => p?.status === 'done' || p?.status === 'aborted';
const task_of = (p: ProcedureMsg | null | undefined, anchor: string): AnchorTask | undefined =>
  p?.anchors.find((t) => t.anchor === anchor);

/// The estimate with the status that is shown. While the aircraft still works on an anchor it is not done, and what ran out of time, points or
/// battery, or was left by the end of the flight, was given up: neither is ever green.
export function as_shown(e: EstimateMsg, p: ProcedureMsg | null | undefined): EstimateMsg {
  const task = task_of(p, e.anchor);
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

/// What the convergence of an anchor is measured by, and its limit; null where the server gave none.
export interface Goal {
  readonly of: 'sigma' | 'h95';
  readonly limit_m: number;
}
export function goal_of(e: EstimateMsg | null, p: ProcedureMsg | null | undefined): Goal | null {
  if (e && p?.target_sigma_m != null && task_of(p, e.anchor)) return { of: 'sigma', limit_m: p.target_sigma_m };
  const gate = e?.gates.find((g) => g.name === 'goal_h95_m');
  return gate?.limit == null ? null : { of: 'h95', limit_m: gate.limit };
}
