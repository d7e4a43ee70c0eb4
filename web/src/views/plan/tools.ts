/// Waypoints set by a tool: evenly along the outline, or more of them about one. Metres about the plan's origin. No DOM.
import { setting, type Plan, type Waypoint } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { typed_number } from '../../ui/typed_number';
import { from_m, NEW_WAYPOINT, to_m } from './draft';

export type Point = readonly [number, number];
const away = (a: Point, b: Point): number => Math.hypot(a[0] - b[0], a[1] - b[1]);

export function distance_to_edge(p: Point, ring: readonly Point[]): number {
  return Math.min(
    ...ring.map((a, i) => {
      const b = ring[(i + 1) % ring.length]!,
        [dx, dy] = [b[0] - a[0], b[1] - a[1]],
        t = Math.max(0, Math.min(1, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy || 1)));
      return away(p, [a[0] + t * dx, a[1] + t * dy]);
    }),
  );
}
export function inside(p: Point, ring: readonly Point[]): boolean {
  let odd = false;
  ring.forEach((a, i) => {
    const b = ring[(i + 1) % ring.length]!;
    if (a[1] > p[1] !== b[1] > p[1] && p[0] < ((b[0] - a[0]) * (p[1] - a[1])) / (b[1] - a[1]) + a[0]) odd = !odd;
  });
  return odd;
}

const FINE_M = 0.1; ///< of the curve that is measured off
/// The curve at `distance_m` outside of a ring, finely: edges moved outwards, arcs round corners that point outwards; what then lies too
/// near to another part (the inside of an L) is left out. As core/planning/ring.cpp does it.
interface OnCurve {
  readonly at: Point;
  readonly out: Point;
} ///< `out`: away from the wall, of length one
function curve(outline: readonly Point[], distance_m: number): OnCurve[] {
  const area = outline.reduce((sum, a, i) => {
      const b = outline[(i + 1) % outline.length]!;
      return sum + a[0] * b[1] - a[1] * b[0];
    }, 0),
    ring = area < 0 ? [...outline].reverse() : [...outline],
    all: OnCurve[] = [];
  const keep = (p: Point, out: Point): void => {
    if (!inside(p, ring) && distance_to_edge(p, ring) >= distance_m - 1e-6) all.push({ at: p, out });
  };
  const normal = (a: Point, b: Point): Point => {
    const l = away(a, b);
    return [(b[1] - a[1]) / l, (a[0] - b[0]) / l];
  };
  const corners = ring.filter((p, i) => away(p, ring[(i + 1) % ring.length]!) > 1e-6);
  corners.forEach((a, i) => {
    const b = corners[(i + 1) % corners.length]!,
      c = corners[(i + 2) % corners.length]!,
      n = normal(a, b),
      next = normal(b, c),
      steps = Math.ceil(away(a, b) / FINE_M);
    for (let k = 0; k <= steps; k++)
      keep(
        [
          a[0] + ((b[0] - a[0]) * k) / steps + distance_m * n[0],
          a[1] + ((b[1] - a[1]) * k) / steps + distance_m * n[1],
        ],
        n,
      );
    const turn = Math.atan2(n[0] * next[1] - n[1] * next[0], n[0] * next[0] + n[1] * next[1]),
      arc = Math.ceil((turn * distance_m) / FINE_M);
    for (let k = 1; k < arc; k++) {
      const w = (turn * k) / arc,
        o: Point = [Math.cos(w) * n[0] - Math.sin(w) * n[1], Math.sin(w) * n[0] + Math.cos(w) * n[1]];
      keep([b[0] + distance_m * o[0], b[1] + distance_m * o[1]], o);
    }
  });
  return all;
}

/// Points as evenly as a whole number of them allows, `spacing_m` apart or a little less or more; at least three.
export const spaced_along = (outline: readonly Point[], distance_m: number, spacing_m: number): Point[] =>
  spaced(outline, distance_m, spacing_m).map((q) => q.at);
function spaced(outline: readonly Point[], distance_m: number, spacing_m: number): OnCurve[] {
  if (outline.length < 3) return [];
  const fine = curve(outline, distance_m),
    gaps = fine.map((p, i) => away(p.at, fine[(i + 1) % fine.length]!.at)),
    whole = gaps.reduce((a, b) => a + b, 0);
  if (!(whole > 0)) return [];
  const n = Math.max(3, Math.round(whole / spacing_m)),
    out: OnCurve[] = [];
  for (let i = 0, gone = 0, k = 0; k < n; i++) {
    for (; k < n && (k * whole) / n < gone + gaps[i]! + 1e-9; k++) {
      const t = ((k * whole) / n - gone) / (gaps[i]! || 1),
        a = fine[i]!,
        b = fine[(i + 1) % fine.length]!;
      out.push({ at: [a.at[0] + t * (b.at[0] - a.at[0]), a.at[1] + t * (b.at[1] - a.at[1])], out: a.out });
    }
    gone += gaps[i]!;
    if (i === fine.length - 1) break;
  }
  return out;
}

const ROUND_MAX_RAD = 1.6; ///< one corner of the way turns by a right angle at most: sharper ones stand far off
/// Corners of the way between two neighbours where the straight one comes too close to a wall: where their tangents meet.
function round_corner(a: OnCurve, b: OnCurve, outline: readonly Point[], keep_out: number): Point[] {
  const steps = Math.ceil(away(a.at, b.at) / FINE_M),
    near = Array.from({ length: steps }, (_, k): Point => [
      a.at[0] + ((b.at[0] - a.at[0]) * k) / steps,
      a.at[1] + ((b.at[1] - a.at[1]) * k) / steps,
    ]).some((p) => inside(p, outline) || distance_to_edge(p, outline) < keep_out);
  const turn = Math.atan2(a.out[0] * b.out[1] - a.out[1] * b.out[0], a.out[0] * b.out[0] + a.out[1] * b.out[1]);
  if (!near || turn <= 1e-3) return [];
  const meet = (p: OnCurve, q: OnCurve): Point => {
    const cross = p.out[0] * q.out[1] - p.out[1] * q.out[0],
      dp = p.at[0] * p.out[0] + p.at[1] * p.out[1],
      dq = q.at[0] * q.out[0] + q.at[1] * q.out[1];
    return [(dp * q.out[1] - dq * p.out[1]) / cross, (dq * p.out[0] - dp * q.out[0]) / cross];
  };
  if (turn <= ROUND_MAX_RAD) return [meet(a, b)];
  const tip = outline.reduce((best, c) => (away(c, meet(a, b)) < away(best, meet(a, b)) ? c : best)),
    half = turn / 2,
    o: Point = [
      Math.cos(half) * a.out[0] - Math.sin(half) * a.out[1],
      Math.sin(half) * a.out[0] + Math.cos(half) * a.out[1],
    ],
    r = distance_to_edge(a.at, outline),
    middle: OnCurve = { at: [tip[0] + r * o[0], tip[1] + r * o[1]], out: o };
  return [meet(a, middle), meet(middle, b)];
}

/// Heights to space waypoints at where none are typed: those flown so far where there are several, else 2 m and 1 m above the roof, within the band.
/// From one height alone nobody can tell how high an anchor hangs.
export function usual_heights(p: Plan): number[] {
  const flown = [...new Set(p.waypoints.filter((w) => w.measure).map((w) => w.height_above_ground_m))].sort(
    (a, b) => a - b,
  );
  const in_band = (h: number): number => Math.max(setting(p, 'min_height_m'), Math.min(setting(p, 'max_height_m'), h));
  return flown.length > 1 ? flown : [...new Set([2, p.building_height_m + 1].map(in_band))];
}
/// `2, 9` or `2 9,5` in metres; null where it is no list of heights.
export function typed_heights(text: string): number[] | null {
  const parts = text
    .trim()
    .split(/;\s*|,\s+|\s+/)
    .map((t) => typed_number(t) ?? NaN);
  return text.trim() && parts.length <= 10 && parts.every((h) => Number.isFinite(h) && h > 0 && h <= 500)
    ? parts
    : null;
}

/// The plan with its waypoints spaced evenly along the outline at the keep-out distance, those left out that lie in a no-fly area or outside of the
/// fence. The heights are taken in turn; the flags are those of the first waypoint there was.
export function with_even_spacing(
  p: Plan,
  origin: Geodetic,
  spacing_m: number,
  heights_m: readonly number[],
): { readonly plan: Plan; readonly left_out: number } {
  const metres = (list: readonly { lon: number; lat: number }[]): Point[] =>
      list.map((c) => to_m({ lon: c.lon, lat: c.lat }, origin)),
    keep_out = setting(p, 'keep_out_m');
  const areas = p.no_fly.map(metres).filter((a) => a.length > 2),
    fence = metres(p.fence),
    outline = metres(p.outline),
    all = spaced(outline, keep_out + 0.01, spacing_m);
  const legal = all.filter(
    ({ at: q }) =>
      areas.every((a) => !inside(q, a) && distance_to_edge(q, a) >= keep_out) && (fence.length < 3 || inside(q, fence)),
  );
  const like: Omit<Waypoint, 'lon' | 'lat'> = { ...(p.waypoints[0] ?? NEW_WAYPOINT), heading_deg: null };
  const height = (i: number): number => heights_m[i % heights_m.length]!,
    waypoints: Waypoint[] = [];
  legal.forEach((q, i) => {
    const before = legal[i - 1];
    for (const r of before ? round_corner(before, q, outline, keep_out) : [])
      waypoints.push({
        ...like,
        measure: false,
        turn: false,
        height_search: false,
        dwell_s: null,
        height_above_ground_m: (height(i - 1) + height(i)) / 2,
        ...from_m(r[0], r[1], origin),
      });
    waypoints.push({ ...like, measure: true, height_above_ground_m: height(i), ...from_m(q.at[0], q.at[1], origin) });
  });
  return { plan: { ...p, waypoints }, left_out: all.length - legal.length };
}

const LEAST_M = 0.5; ///< nearer than this two points measure the same
/// One more waypoint half-way to each neighbour of waypoint `index`, the first and last of a flight round the building being neighbours.
export function denser(p: Plan, index: number, origin: Geodetic): Plan {
  const list = p.waypoints,
    here = list[index],
    n = list.length;
  if (!here || n < 2) return p;
  const middle = (other: Waypoint): Waypoint[] => {
    const [a, b] = [to_m(here, origin), to_m(other, origin)];
    return away(a, b) < 2 * LEAST_M
      ? []
      : [
          {
            ...here,
            measure: true,
            height_above_ground_m: (here.height_above_ground_m + other.height_above_ground_m) / 2,
            heading_deg: null,
            ...from_m((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, origin),
          },
        ];
  };
  // With two points there is one way between them, not two.
  const before = n > 2 || index > 0 ? middle(list[(index + n - 1) % n]!) : [],
    after = n > 2 || index === 0 ? middle(list[(index + 1) % n]!) : [];
  return { ...p, waypoints: [...list.slice(0, index), ...before, here, ...after, ...list.slice(index + 1)] };
}
