/// The side elevation: everything of a site seen along the ground, as metres to the right and metres up. No DOM.
import type { EstimateMsg, Vec3 } from '../live/messages';
import type { Point } from './flight_layer';

const RAD = Math.PI / 180;
export const SIGMAS_95 = 1.959963984540054; // of one axis, both sides; the server's v95 is the same

/// Metres to the right of the origin for who looks with `bearing_deg` pointing to the right.
export const along = (bearing_deg: number, [e, n]: readonly [number, number] | Vec3): number =>
  e * Math.sin(bearing_deg * RAD) + n * Math.cos(bearing_deg * RAD);

/// 95 % of an estimate to either side along the picture and up; null where its covariance is not known.
export function intervals95(
  a: Pick<EstimateMsg, 'cov_enu_m2' | 'v95_m'>,
  bearing_deg: number,
): { readonly along_m: number; readonly up_m: number } | null {
  const c = a.cov_enu_m2;
  if (!c) return null;
  const [s, k] = [Math.sin(bearing_deg * RAD), Math.cos(bearing_deg * RAD)],
    variance = c[0]! * s * s + 2 * c[1]! * s * k + c[3]! * k * k;
  if (!(variance >= 0) || !(c[5]! >= 0)) return null;
  return { along_m: SIGMAS_95 * Math.sqrt(variance), up_m: a.v95_m ?? SIGMAS_95 * Math.sqrt(c[5]!) };
}

/// The direction of the longest wall, 0 to 180; east where nothing is drawn.
export function building_bearing(outline: readonly Point[]): number {
  let best = 0,
    bearing = 90;
  outline.forEach((a, i) => {
    const b = outline[(i + 1) % outline.length]!,
      l = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (l <= best) return;
    best = l;
    bearing = (Math.atan2(b[0] - a[0], b[1] - a[1]) / RAD + 360) % 180;
  });
  return bearing;
}

const WINDS = ['N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'] as const;
export const wind = (bearing_deg: number): string => WINDS[Math.round((((bearing_deg % 360) + 360) % 360) / 45) % 8]!;

export interface Extent {
  readonly s0: number;
  readonly s1: number;
  readonly u0: number;
  readonly u1: number;
}
/// Null while nothing is known.
export function extent(points: readonly (readonly [number, number])[]): Extent | null {
  let box: Extent | null = null;
  for (const [s, u] of points)
    box = box
      ? { s0: Math.min(box.s0, s), s1: Math.max(box.s1, s), u0: Math.min(box.u0, u), u1: Math.max(box.u1, u) }
      : { s0: s, s1: s, u0: u, u1: u };
  return box;
}

const EXAGGERATIONS = [1, 2, 3, 5, 10] as const;
export interface Fit {
  readonly px_per_m: number; ///< along
  readonly up_px_per_m: number;
  readonly exaggeration: number;
}
/// True proportions where the heights fill the picture; else heights larger by a whole number that is said.
export function fit(x: Extent, w: number, h: number): Fit {
  const span_s = Math.max(4, x.s1 - x.s0),
    span_u = Math.max(3, x.u1 - x.u0),
    px_per_m = Math.min(w / span_s, h / span_u),
    exaggeration = EXAGGERATIONS.reduce<number>((best, k) => (span_u * px_per_m * k <= h ? k : best), 1);
  return { px_per_m, up_px_per_m: px_per_m * exaggeration, exaggeration };
}
