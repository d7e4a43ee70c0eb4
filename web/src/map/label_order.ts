/// Which labels of a crowded map are read: those that matter now. No DOM.
import type { AnchorStatus, EstimateMsg } from '../live/messages';

const DONE: ReadonlySet<AnchorStatus> = new Set(['converged', 'accepted', 'gave_up']);
/// In which order names take the room there is: what is selected, what is measured next (nearest to where the aircraft is sent), what is not done, what
/// is done. By their ids beside, since names that change places cannot be read.
export function by_priority(
  anchors: readonly EstimateMsg[],
  selected: string | null,
  target: readonly [number, number] | null,
): EstimateMsg[] {
  const away = (a: EstimateMsg): number =>
      target && a.enu_m ? Math.hypot(a.enu_m[0] - target[0], a.enu_m[1] - target[1]) : 0,
    rank = (a: EstimateMsg): number => (a.anchor === selected ? 0 : DONE.has(a.status) ? 2 : 1);
  return [...anchors].sort(
    (a, b) => rank(a) - rank(b) || (rank(a) === 1 ? away(a) - away(b) : 0) || (a.anchor < b.anchor ? -1 : 1),
  );
}
