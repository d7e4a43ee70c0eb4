/// What the plots of many measurements are made of. No DOM.
import type { Filter, Sample } from '../../api/measurements';

type Label = 'los' | 'nlos' | 'none';
export const LABELS: readonly (readonly [Filter['label'], string])[] = [
  ['', 'All'],
  ['los', 'LOS'],
  ['nlos', 'NLOS'],
  ['none', 'No label'],
];
const label_of = (s: Sample): Label => (s.los === null ? 'none' : s.los ? 'los' : 'nlos');

export const DRAWN_MAX = 2000; ///< measurements the plots are made of; of more, about one in n
export const every_of = (total: number | null): number => Math.max(1, Math.ceil((total ?? 0) / DRAWN_MAX));

/// `2026-05-04T10:09` or with seconds, meant as UTC, in microseconds; null where it is none.
export function typed_time(text: string): number | null {
  const ms = /^\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d(\.\d+)?)?$/.test(text) ? Date.parse(`${text}Z`) : NaN;
  return Number.isNaN(ms) ? null : ms * 1000;
}
export const time_text = (t_us: number | null): string =>
  t_us === null ? '' : new Date(t_us / 1000).toISOString().slice(0, 19);

/// Level that a link in line of sight is expected to exceed at a distance.
export interface RssLine {
  readonly at_zero_dbm: number;
  readonly slope_dbm_per_m: number;
}
export const PRINTED_LINE: RssLine = { at_zero_dbm: -80.3977, slope_dbm_per_m: -0.84708 }; ///< dissertation, eq 5.1
export const level_at = (line: RssLine, distance_m: number): number =>
  line.at_zero_dbm + line.slope_dbm_per_m * distance_m;
/// Shares of the labelled ones that lie on their side: above is LOS, on the line or below is NLOS (eq 5.2).
export function sides(
  samples: readonly Sample[],
  line: RssLine,
): { readonly los: number | null; readonly nlos: number | null } {
  const share = (los: boolean): number | null => {
    const kind = samples.filter((s) => s.los === los && s.rx_dbm !== null);
    return kind.length
      ? kind.filter((s) => s.rx_dbm! > level_at(line, s.distance_m) === los).length / kind.length
      : null;
  };
  return { los: share(true), nlos: share(false) };
}

/// Share of values below v, in per cent: where a feature stands among its kind. Null where there is nothing to compare with.
export function percentile(values: readonly number[], v: number): number | null {
  return values.length < 5 ? null : (values.filter((x) => x < v).length / values.length) * 100;
}

export interface Histogram {
  readonly edges: readonly number[];
  readonly los: readonly number[];
  readonly nlos: readonly number[];
  readonly unlabelled: readonly number[];
}
/// Twenty-four equal bins over the middle 99 %; what lies outside is counted in the end bins, so nothing is lost.
export function histogram(samples: readonly Sample[], feature: string, bins = 24): Histogram | null {
  const valued = samples.filter((s) => s.features[feature] !== undefined),
    sorted = valued.map((s) => s.features[feature]!).sort((a, b) => a - b);
  if (sorted.length < 2) return null;
  const at = (q: number): number => sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))]!;
  const lo = at(0.005),
    hi = at(0.995),
    width = (hi - lo) / bins;
  if (!(width > 0)) return null;
  const count = (label: Label): number[] => {
    const out = new Array<number>(bins).fill(0);
    for (const s of valued)
      if (label_of(s) === label)
        out[Math.max(0, Math.min(bins - 1, Math.floor((s.features[feature]! - lo) / width)))]!++;
    return out;
  };
  return {
    edges: Array.from({ length: bins + 1 }, (_, i) => lo + i * width),
    los: count('los'),
    nlos: count('nlos'),
    unlabelled: count('none'),
  };
}
