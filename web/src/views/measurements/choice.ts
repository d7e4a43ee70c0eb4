/// What of the loaded measurements is looked at. No DOM.
import type { Sample } from '../../api/measurements';

export type ClassFilter = 'all' | 'los' | 'nlos' | 'unlabelled';
export const CLASS_FILTERS: readonly (readonly [ClassFilter, string])[] = [['all', 'All'], ['los', 'LOS'], ['nlos', 'NLOS'], ['unlabelled', 'No label']];

export interface Choice { readonly who: string; readonly label: ClassFilter; readonly min_m: number | null; readonly max_m: number | null }
export const EVERYTHING: Choice = { who: '', label: 'all', min_m: null, max_m: null };

const label_of = (s: Sample): ClassFilter => (s.los === null ? 'unlabelled' : s.los ? 'los' : 'nlos');
export function chosen(samples: readonly Sample[], c: Choice): Sample[] {
  return samples.filter((s) => (!c.who || s.who === c.who) && (c.label === 'all' || label_of(s) === c.label)
    && (c.min_m === null || s.distance_m >= c.min_m) && (c.max_m === null || s.distance_m <= c.max_m));
}

/// Share of values below v, in per cent: where a feature stands among its kind. Null where there is nothing to compare with.
export function percentile(values: readonly number[], v: number): number | null {
  return values.length < 5 ? null : (values.filter((x) => x < v).length / values.length) * 100;
}

export interface Histogram { readonly edges: readonly number[]; readonly los: readonly number[]; readonly nlos: readonly number[]; readonly unlabelled: readonly number[] }
/// Twenty-four equal bins over the middle 99 %; what lies outside is counted in the end bins, so nothing is lost.
export function histogram(samples: readonly Sample[], feature: string, bins = 24): Histogram | null {
  const valued = samples.filter((s) => s.features[feature] !== undefined), sorted = valued.map((s) => s.features[feature]!).sort((a, b) => a - b);
  if (sorted.length < 2) return null;
  const at = (q: number): number => sorted[Math.min(sorted.length - 1, Math.floor(q * sorted.length))]!;
  const lo = at(0.005), hi = at(0.995), width = (hi - lo) / bins;
  if (!(width > 0)) return null;
  const count = (label: ClassFilter): number[] => {
    const out = new Array<number>(bins).fill(0);
    for (const s of valued) if (label_of(s) === label) out[Math.max(0, Math.min(bins - 1, Math.floor((s.features[feature]! - lo) / width)))]!++;
    return out;
  };
  return { edges: Array.from({ length: bins + 1 }, (_, i) => lo + i * width), los: count('los'), nlos: count('nlos'), unlabelled: count('unlabelled') };
}
