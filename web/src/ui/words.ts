/// Everything the page says about verdicts and reasons, in one place. No DOM.
import type { EstimateMsg, Verdict } from '../live/messages';

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
  floor: 'what no residual shows',
};
/// Title and sentence of "why not done"; null when there is nothing to explain.
export function why_not_done(e: EstimateMsg): { title: string; text: string } | null {
  if (e.verdict === 'ok' && (e.status === 'converged' || e.status === 'accepted')) return null;
  const text = e.reason ? `${e.reason[0]!.toUpperCase()}${e.reason.slice(1)}${/[.!?]$/.test(e.reason) ? '' : '.'}` : '';
  // A mirror above or below is separated by height, one beside by leaving the line.
  const level =
    e.mirror?.enu_m && e.enu_m && Math.hypot(e.mirror.enu_m[0] - e.enu_m[0], e.mirror.enu_m[1] - e.enu_m[1]) < 1;
  const advice: Record<Verdict, string> = {
    ok: 'More ranges from new directions will bring the ellipse below the limit.',
    weak_geometry: 'Fly where the anchor is seen from another side, and at another height.',
    ambiguous: level
      ? 'Fly one stretch a few metres higher or lower: that separates the two heights.'
      : 'Leave the line flown so far: one stretch across it separates the two positions.',
    too_few: 'Stay in reach of it for some more seconds.',
    diverged: 'Look for reflections, or for two devices with one id.',
  };
  return {
    title:
      e.status === 'moved'
        ? 'It moved: the new estimate leaves the old 99 % ellipse'
        : `Why not done: ${e.verdict === 'ok' ? 'not accurate enough yet' : VERDICT_WORDS[e.verdict]}`,
    text: `${text}${text ? ' ' : ''}${advice[e.verdict]}`,
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

/// Acceptance gates of the server, by name; what is not here is shown by its own name.
const GATE_WORDS: Record<string, string> = {
  redundancy: 'Ranges beyond need',
  rejected: 'Share of ranges rejected',
  geometry: 'Width of the track',
  precision: 'Precision',
  side: 'This side, not the mirror',
  residual_scale: 'Residuals',
  chi_square: 'Residuals over time',
  halves: 'Two halves agree',
  flights: 'Flights agree',
  bias: 'Range bias known',
  settled: 'Solve settled',
};
export const gate_words = (name: string): string =>
  GATE_WORDS[name] ?? name.replaceAll('_', ' ').replace(/^./, (c) => c.toUpperCase());

/// Limits a position is held against. The server's verdict decides; these are what the page draws and names beside the values.
export const GATES = { h95_m: 0.1, v95_m: 0.2, gdop: 2.5, n_ranges: 60, rms_residual_m: 0.15, mirror: 0.01 } as const;
