/// What the server expects of assumed anchors in the building, in the six steps of the map. No DOM.
import type { Assumed } from '../../api/plans';

export type Quantity = 'gdop' | 'sigma_m';
/// Upper ends of the steps, the best first; beyond the last is the sixth. Fixed, so that two plans are comparable by eye; 2.5 is the gate of accepted anchors.
export const CUTS: Record<Quantity, readonly number[]> = {
  gdop: [1, 1.5, 2, 2.5, 4],
  sigma_m: [0.02, 0.05, 0.1, 0.2, 0.5],
};
export function step_of(value: number | null, of: Quantity): number | null {
  if (value === null) return null;
  const at = CUTS[of].findIndex((cut) => value <= cut);
  return at < 0 ? CUTS[of].length : at;
}
/// Heights at which anchors are assumed, from below.
export const floors = (all: readonly Assumed[]): number[] => [...new Set(all.map((a) => a.up))].sort((a, b) => a - b);

export interface Summary {
  readonly up: number;
  readonly n: number;
  readonly unseen: number;
  readonly gdop: readonly [number, number] | null;
  readonly sigma_m: readonly [number, number];
}
/// Middle and worst of one height; `unseen` have no GDOP: their points lie in one plane with them, or are too few.
export function summary(all: readonly Assumed[], up: number): Summary {
  const here = all.filter((a) => a.up === up),
    pair = (v: readonly number[]): readonly [number, number] => {
      const s = [...v].sort((a, b) => a - b);
      return [s[Math.floor((s.length - 1) / 2)] ?? 0, s[s.length - 1] ?? 0];
    };
  const gdops = here.flatMap((a) => (a.gdop === null ? [] : [a.gdop]));
  return {
    up,
    n: here.length,
    unseen: here.length - gdops.length,
    gdop: gdops.length ? pair(gdops) : null,
    sigma_m: pair(here.map((a) => a.sigma_m)),
  };
}
