/// Everything the page says about verdicts and reasons, in one place. No DOM.
import type { AnchorStatus, EstimateMsg, Verdict } from '../live/messages';
import { gate_line, is_goal } from './gates';

export const VERDICT_WORDS: Record<Verdict, string> = {
  ok: 'well determined',
  weak_geometry: 'seen from one side',
  ambiguous: 'a mirror solution fits',
  too_few: 'too few ranges',
  diverged: 'the ranges contradict each other',
};
/// Sources of the error budget, as the Anchors view names them.
export const SOURCE_WORDS: Record<string, string> = {
  ranging: 'noise of the ranges',
  geometry: 'geometry of the flight',
  bias: 'range bias',
  rtk: 'RTK positions',
  lever_arm: 'lever arm',
  clock: 'time lag',
  base: 'base station',
  floor: 'errors that no residual shows',
};
export const sentence = (text: string): string =>
  text ? `${text[0]!.toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? '' : '.'}` : '';
const DONE: ReadonlySet<AnchorStatus> = new Set(['converged', 'accepted', 'passes', 'within_goal', 'over_goal']);
/// Title and sentence of "why not done"; null when there is nothing to explain. `task`: what the procedure says of it, empty where it is content.
export function why_not_done(e: EstimateMsg, task = ''): { title: string; text: string } | null {
  // What the turn or the height search found and the ranges contradict is to be looked at, however good the position.
  if (e.verdict === 'ok' && DONE.has(e.status))
    return e.reason.includes('disagrees with the ranges') // as core/localize/prior_conflict says it
      ? { title: 'Done, but a turn or height search disagrees', text: sentence(e.reason) }
      : null;
  if (e.status === 'gave_up')
    return {
      title: 'Given up: the flight ended without reaching the target accuracy here',
      text: sentence(task) || 'Fly again for the anchors that are not good enough.',
    };
  const open = e.gates.filter((g) => !g.passed),
    holding = e.verdict === 'ok' ? open.find((g) => !is_goal(g)) : undefined,
    text = holding
      ? `${sentence(gate_line(holding))} ${sentence(holding.why)}`
      : sentence(e.reason || task || (e.verdict === 'ok' && open.length ? gate_line(open[0]!) : ''));
  if (holding) return { title: 'Why not done: it fails an acceptance gate', text: text.trim() };
  // A mirror above or below is separated by height, one beside by leaving the line.
  const level =
    e.mirror?.enu_m && e.enu_m && Math.hypot(e.mirror.enu_m[0] - e.enu_m[0], e.mirror.enu_m[1] - e.enu_m[1]) < 1;
  const advice: Record<Verdict, string> = {
    ok: 'More ranges from new directions make it more accurate.',
    weak_geometry: 'Fly on another side of the anchor, and at another height.',
    ambiguous: level
      ? 'Fly one stretch a few metres higher or lower: that separates the two heights.'
      : 'Fly one stretch across the line flown so far: that separates the two positions.',
    too_few: 'Stay in range of it for some more seconds.',
    diverged: 'Check for reflections, or for two devices with the same id.',
  };
  return {
    title:
      e.status === 'moved'
        ? 'It moved: the new estimate leaves the old 99 % ellipse'
        : e.status === 'withheld'
          ? `Withheld: ${e.verdict === 'ok' ? 'a gate fails' : VERDICT_WORDS[e.verdict]}`
          : `Why not done: ${e.verdict === 'ok' ? 'not accurate enough yet' : VERDICT_WORDS[e.verdict]}`,
    // The server may have said already, from the error budget.
    text: text.includes('would help most') ? text : `${text}${text ? ' ' : ''}${advice[e.verdict]}`,
  };
}
export const REFUSED_WORDS: Record<string, string> = {
  track_gap: 'no fix near it',
  zero_distance: 'device failure value',
  outlier: 'far from the estimate',
  out_of_order: 'out of order',
  no_fix: 'no position',
  poor_fix: 'position too poor',
  too_long: 'out of reach',
};
export const refused_words = (reason: string): string => REFUSED_WORDS[reason] ?? reason.replaceAll('_', ' ');
