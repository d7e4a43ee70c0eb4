/// Acceptance gates of the server as sentences with value, sign, limit and unit. Limits are the server's: the page has none. No DOM.
import type { GateMsg as Gate } from '../live/messages';
import { fixed } from './format';

type Unit = 'm' | 's' | '%' | '×' | 'χ²' | 'σ' | '';
interface Words {
  readonly passes: string;
  readonly fails: string;
  readonly unit: Unit;
  readonly least?: true; ///< the value has to be at least the limit; else at most
}
const WORDS: Record<string, Words> = {
  redundancy: {
    passes: 'Number of ranges minus unknowns',
    fails: 'Too few ranges for the unknowns',
    unit: '',
    least: true,
  },
  rejected: { passes: 'Few ranges are rejected', fails: 'Too many ranges are rejected', unit: '%' },
  geometry: {
    passes: 'The track is wide enough for the distance',
    fails: 'The track is too narrow for the distance',
    unit: '%',
    least: true,
  },
  precision: {
    passes: 'Largest σ is small relative to the distance',
    fails: 'Largest σ is too large relative to the distance',
    unit: '%',
  },
  side: {
    passes: 'The mirror solution is excluded',
    fails: 'The mirror solution is not excluded',
    unit: '%',
    least: true,
  },
  held_height: {
    passes: 'The height was given, σ',
    fails: 'The height was neither measured nor given well enough, σ',
    unit: 'm',
  },
  outline: { passes: 'Inside the outline of the building', fails: 'Outside the outline of the building', unit: 'm' },
  blocked: {
    passes: 'Residuals are like those of the other anchors',
    fails: 'Residuals are larger than those of the other anchors',
    unit: '×',
  },
  own_delay: {
    passes: 'No delay of its ranges alone is seen',
    fails: 'Its ranges are too long or too short, unlike those of the other anchors',
    unit: 'm',
  },
  residual_scale: { passes: 'Residuals are small', fails: 'Residuals are too large', unit: 'm' },
  chi_square: {
    passes: 'Residuals average out over time',
    fails: 'Residuals do not average out over time',
    unit: 'χ²',
  },
  halves: { passes: 'The two halves of the flight agree', fails: 'The two halves of the flight disagree', unit: 'χ²' },
  second_place: {
    passes: 'No other position agrees with many of its ranges',
    fails: 'A part of its ranges agrees on another position',
    unit: '%',
  },
  flights: { passes: 'The flights agree', fails: 'The flights disagree', unit: 'χ²' },
  datum: {
    passes: 'Flights before the site’s datum was changed',
    fails: 'Flown before the site’s datum was changed: former coordinates',
    unit: '',
  },
  outdated: {
    passes: 'Solved with what is declared now',
    fails: 'Lever arms, kit or exclusions were changed since: solve again',
    unit: '',
  },
  moved: { passes: 'Same position as before', fails: 'It has moved, or one of the positions is wrong', unit: 'χ²' },
  bias: { passes: 'Range bias of the kit is known, σ', fails: 'Range bias of the kit is not known, σ', unit: 'm' },
  lever_arm: { passes: 'The lever arm fits the flight', fails: 'The lever arm does not fit the flight', unit: 'σ' },
  clock: {
    passes: 'The ranges fit the track at their times',
    fails: 'The clock of the ranges or of the track is off',
    unit: 's',
  },
  unseen_arm: {
    passes: 'A wrong lever arm would show or stay within the region, unseen error',
    fails: 'A wrong lever arm would not show: the aircraft turned too little, unseen error',
    unit: 'm',
  },
  range_scale: {
    passes: 'No scale error of the ranges is seen',
    fails: 'The ranges are too long or too short by a factor',
    unit: '%',
  },
  range_step: {
    passes: 'Ranges measured low and high agree',
    fails: 'Ranges measured high are too long or too short against those measured low',
    unit: 'm',
  },
  range_drift: {
    passes: 'No drift of the ranges over the flight',
    fails: 'The ranges drift over the flight',
    unit: 'm',
  },
  track_drift: {
    passes: 'No drift of the positions over the flight',
    fails: 'The positions drift over the flight',
    unit: 'm',
  },
  track_heights: {
    passes: 'The heights of the track fit the ranges',
    fails: 'The heights of the track are too far apart or together',
    unit: '%',
  },
  track_shift: {
    passes: 'No shift of the track at its gaps',
    fails: 'A part of the track is shifted against the rest',
    unit: 'χ²',
  },
  track: {
    passes: 'Few positions are shifted together against the others',
    fails: 'Too many positions are shifted together against the others: did the base move?',
    unit: '%',
  },
  profile: {
    passes: 'The kit agrees with its other flights',
    fails: 'The kit disagrees with its other flights',
    unit: 'χ²',
  },
  settled: { passes: 'The joint solution converged', fails: 'The joint solution did not converge, rounds', unit: '' },
  target_sigma_m: {
    passes: 'Target of the flight reached, σ of the position',
    fails: 'Target of the flight not reached, σ of the position',
    unit: 'm',
  },
  goal_h95_m: {
    passes: 'Accuracy goal reached, 95 % horizontal',
    fails: 'Accuracy goal not reached, 95 % horizontal',
    unit: 'm',
  },
  goal_v95_m: {
    passes: 'Accuracy goal reached, 95 % vertical',
    fails: 'Accuracy goal not reached, 95 % vertical',
    unit: 'm',
  },
};
/// Whether it is accurate enough; every other gate asks whether it is right.
export const is_goal = (g: Gate): boolean => g.name.startsWith('goal_') || g.name === 'target_sigma_m';
const plain_name = (name: string): string => name.replaceAll('_', ' ').replace(/^./, (c) => c.toUpperCase());

/// What the gate found, as a statement that is true as it stands: a failed gate never reads "halves agree".
export const gate_sentence = (g: Gate): string => {
  const w = WORDS[g.name];
  return w ? (g.passed ? w.passes : w.fails) : `${plain_name(g.name)}: ${g.passed ? 'passed' : 'failed'}`;
};

/// Digits that keep value and limit apart: a failed gate must not read 0.20 against at most 0.20.
function digits(v: number, limit: number | null, least: number): number {
  if (limit === null || v === limit) return least;
  for (let d = least; d < 4; d++) if (fixed(v, d) !== fixed(limit, d)) return d;
  return 4;
}
function with_unit(v: number, unit: Unit, limit: number | null): string {
  if (unit === '%') return `${fixed(v * 100, digits(v * 100, limit === null ? null : limit * 100, v < 0.1 ? 1 : 0))} %`;
  if (unit === '') return fixed(v, digits(v, limit, 0));
  const text = fixed(v, digits(v, limit, unit === 'm' ? 2 : 1));
  return unit === 'χ²' ? `χ² ${text}` : unit === '×' ? `${text}×` : `${text} ${unit}`;
}
const unit_of = (g: Gate): Unit => WORDS[g.name]?.unit ?? '';
export const gate_value = (g: Gate): string =>
  g.value === null ? 'not measured' : with_unit(g.value, unit_of(g), g.limit);
export const gate_limit = (g: Gate): string =>
  g.limit === null ? '' : `${WORDS[g.name]?.least ? '≥' : '≤'} ${with_unit(g.limit, unit_of(g), g.value)}`;
/// The whole of it: "The two halves of the flight disagree: χ² 21.3 (limit ≤ 16.3)".
export const gate_line = (g: Gate): string =>
  `${gate_sentence(g)}: ${gate_value(g)}${g.limit === null ? '' : ` (limit ${gate_limit(g)})`}`;
