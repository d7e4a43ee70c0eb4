/// What the plot of an impulse response marks, and the words for who cannot see it. The features are those of the server; only the noise floor,
/// which it does not tell, is taken from the taps here. No DOM.
import type { Impulse, Sample } from '../../api/measurements';
import { fixed } from '../../ui/format';

const NOISE_FROM = 50,
  NOISE_TO = 650; ///< taps before any path, as core/nlos/cir.hpp has them: the DW1000 places the first path at 705 to 856
const BEFORE_NS = 20,
  AFTER_NS = 120; ///< about the first path: the taps the features look at

export interface Marks {
  readonly first: number; ///< tap of the first path, may lie between two
  readonly peak: number; ///< strongest tap
  readonly noise: number | null; ///< rms of the taps before any path; null where the record begins later
  readonly mean_ns: number | null; ///< mean excess delay, from the first path
  readonly spread_ns: number | null; ///< RMS delay spread
}
export function marks_of(r: Impulse, features: Sample['features']): Marks {
  const peak = r.magnitude.reduce((best, m, i) => (m > r.magnitude[best]! ? i : best), 0),
    after = features.peak_delay_ns;
  // A radio that does not say where the first path is leaves it to the server, whose peak delay then tells.
  const first = r.first_path ?? (after === undefined ? peak : peak - after / r.tap_ns);
  const quiet = r.magnitude.length > NOISE_TO ? r.magnitude.slice(NOISE_FROM, NOISE_TO) : [];
  const noise = quiet.length ? Math.sqrt(quiet.reduce((sum, m) => sum + m * m, 0) / quiet.length) : null;
  return {
    first,
    peak,
    noise,
    mean_ns: features.mean_excess_delay_ns ?? null,
    spread_ns: features.rms_delay_spread_ns ?? null,
  };
}
export const ns_of = (r: Impulse, m: Marks, tap: number): number => (tap - m.first) * r.tap_ns;

/// Taps to draw, from (kept) to (not).
export function shown_taps(r: Impulse, m: Marks, whole: boolean): readonly [number, number] {
  const n = r.magnitude.length;
  return whole
    ? [0, n]
    : [
        Math.max(0, Math.floor(m.first - BEFORE_NS / r.tap_ns)),
        Math.min(n, Math.ceil(m.first + AFTER_NS / r.tap_ns) + 1),
      ];
}

const SUFFIXES: readonly (readonly [string, string])[] = [
  ['_ns', 'ns'],
  ['_dbm', 'dBm'],
  ['_db', 'dB'],
  ['_deg', '°'],
  ['_m', 'm'],
];
export const unit_of = (feature: string): string => SUFFIXES.find(([end]) => feature.endsWith(end))?.[1] ?? '';

const FIRST = [
  'mean_excess_delay_ns',
  'rms_delay_spread_ns',
  'kurtosis',
  'early_energy',
  'peak_delay_ns',
  'rx_dbm',
  'fp_dbm',
  'rx_minus_fp_db',
];
/// The dissertation's features in its order, then what else the radio allowed.
export function ordered(names: readonly string[]): string[] {
  const place = (n: string): number => {
    const at = FIRST.indexOf(n);
    return at < 0 ? FIRST.length : at;
  };
  return [...names].sort((a, b) => place(a) - place(b));
}

/// The plot in one paragraph.
export function summary(r: Impulse, m: Marks, features: Sample['features']): string {
  const strongest = r.magnitude[m.peak] ?? 0;
  return [
    `Impulse response of ${r.magnitude.length} taps, ${fixed(r.tap_ns, 2)} ns each`,
    `first path at tap ${fixed(m.first, 1)}`,
    `strongest ${fixed(ns_of(r, m, m.peak), 1)} ns after ` +
      `it${m.noise ? `, ${fixed(20 * Math.log10(strongest / m.noise), 0)} dB above the noise floor of ${fixed(m.noise, 1)}` : ''}`,
    ...(m.mean_ns === null ? [] : [`mean excess delay ${fixed(m.mean_ns, 1)} ns`]),
    ...(m.spread_ns === null ? [] : [`RMS delay spread ${fixed(m.spread_ns, 1)} ns`]),
    ...(features.kurtosis === undefined ? [] : [`kurtosis ${fixed(features.kurtosis, 1)}`]),
  ].join(', ');
}
