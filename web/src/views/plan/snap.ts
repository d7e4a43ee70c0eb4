/// Where a tap goes when it snaps: walls meet at right angles more often than not, and half metres are easier to read. No DOM.
import type { Point } from './tools';

export interface Snapped {
  readonly at: Point;
  readonly how: 'right angle' | 'in line with the first corner' | 'half metres';
}
const GRID_M = 0.5,
  NEAR_PX = 12;
const to_grid = (v: number): number => Math.round(v / GRID_M) * GRID_M;

/// `ring`: corners drawn so far; empty for waypoints, which snap to half metres alone.
export function snapped(tap: Point, ring: readonly Point[], px_per_m: number): Snapped {
  const near_m = NEAR_PX / px_per_m,
    last = ring[ring.length - 1],
    before = ring[ring.length - 2],
    first = ring[0];
  if (last && before) {
    const length = Math.hypot(last[0] - before[0], last[1] - before[1]),
      u: Point = [(last[0] - before[0]) / length, (last[1] - before[1]) / length];
    for (const along of length > 0 ? [u, [-u[1], u[0]] as Point] : []) {
      const reach = (q: Point): number => (q[0] - last[0]) * along[0] + (q[1] - last[1]) * along[1],
        aside = (tap[0] - last[0]) * -along[1] + (tap[1] - last[1]) * along[0];
      if (Math.abs(aside) > near_m) continue;
      const on = (d: number): Point => [last[0] + d * along[0], last[1] + d * along[1]];
      // The corner that closes a rectangle stands across from the first.
      if (ring.length > 2 && first && Math.abs(reach(tap) - reach(first)) <= near_m && Math.abs(reach(first)) > near_m)
        return { at: on(reach(first)), how: 'in line with the first corner' };
      return { at: on(to_grid(reach(tap))), how: 'right angle' };
    }
  }
  return { at: [to_grid(tap[0]), to_grid(tap[1])], how: 'half metres' };
}
