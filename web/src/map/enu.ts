/// WGS84 and metres about an origin. No DOM.
import type { Ellipse95, Vec3 } from '../live/messages';

export interface Geodetic {
  readonly lon: number;
  readonly lat: number;
  readonly h_m: number;
}

// WGS84, NIMA TR8350.2
const A_M = 6_378_137,
  F = 1 / 298.257223563,
  E2 = F * (2 - F);
const RAD = Math.PI / 180;

export function ecef_from_geodetic(p: Geodetic): Vec3 {
  const [sin_lat, cos_lat, sin_lon, cos_lon] = [
    Math.sin(p.lat * RAD),
    Math.cos(p.lat * RAD),
    Math.sin(p.lon * RAD),
    Math.cos(p.lon * RAD),
  ];
  const n = A_M / Math.sqrt(1 - E2 * sin_lat * sin_lat);
  return [(n + p.h_m) * cos_lat * cos_lon, (n + p.h_m) * cos_lat * sin_lon, (n * (1 - E2) + p.h_m) * sin_lat];
}
/// East, north, up of `p` about `origin`, metres.
export function enu_from_geodetic(p: Geodetic, origin: Geodetic): Vec3 {
  const [x, y, z] = ecef_from_geodetic(p),
    [x0, y0, z0] = ecef_from_geodetic(origin);
  const [dx, dy, dz] = [x - x0, y - y0, z - z0];
  const [sin_lat, cos_lat, sin_lon, cos_lon] = [
    Math.sin(origin.lat * RAD),
    Math.cos(origin.lat * RAD),
    Math.sin(origin.lon * RAD),
    Math.cos(origin.lon * RAD),
  ];
  return [
    -sin_lon * dx + cos_lon * dy,
    -sin_lat * cos_lon * dx - sin_lat * sin_lon * dy + cos_lat * dz,
    cos_lat * cos_lon * dx + cos_lat * sin_lon * dy + sin_lat * dz,
  ];
}

/// The point e, n metres from `origin` on its tangent plane, at the height of the origin. Newton on the exact forward
/// formula: below a micrometre within a site.
export function geodetic_from_enu(e: number, n: number, origin: Geodetic): Geodetic {
  let lon = origin.lon,
    lat = origin.lat;
  for (let i = 0; i < 4; i++) {
    const [de, dn] = enu_from_geodetic({ lon, lat, h_m: origin.h_m }, origin);
    lat += (n - dn) / A_M / RAD;
    lon += (e - de) / (A_M * Math.cos(lat * RAD)) / RAD;
  }
  return { lon, lat, h_m: origin.h_m };
}

const CHI2_2_95 = 5.991464547107979; // chi-square with 2 degrees of freedom at 0.95 = -2 ln 0.05

/// 95 % ellipse of the horizontal part of a covariance [ee, en, eu, nn, nu, uu] in m^2; azimuth of the major axis clockwise from north, 0..180. Null where
/// the covariance is not one (negative variance).
export function ellipse_from_covariance(c: readonly number[]): Ellipse95 | null {
  const [ee, en, , nn] = c as [number, number, number, number];
  if (!(ee >= 0) || !(nn >= 0)) return null;
  const mean = (ee + nn) / 2,
    half = Math.hypot((ee - nn) / 2, en);
  if (mean - half < -1e-12) return null;
  // tan 2a = 2 en / (nn - ee), a from north towards east
  const azimuth_deg = half < 1e-15 ? 0 : (Math.atan2(2 * en, nn - ee) / 2 / RAD + 180) % 180;
  return {
    major_m: Math.sqrt(CHI2_2_95 * (mean + half)),
    minor_m: Math.sqrt(CHI2_2_95 * Math.max(0, mean - half)),
    azimuth_deg,
  };
}
/// Horizontal 1-sigma (the larger axis) of a covariance, metres.
export function sigma_h(c: readonly number[] | null): number | null {
  const e = c && ellipse_from_covariance(c);
  return e ? e.major_m / Math.sqrt(CHI2_2_95) : null;
}
/// 1-sigma of the position over all three axes: the root of the trace, as the exit rule of a plan means it.
export function sigma_position(c: readonly number[] | null): number | null {
  const trace = c ? c[0]! + c[3]! + c[5]! : NaN;
  return trace >= 0 ? Math.sqrt(trace) : null;
}
export const sigma_v = (c: readonly number[] | null): number | null => (c && c[5]! >= 0 ? Math.sqrt(c[5]!) : null);

/// A length of 1, 2 or 5 times a power of ten that is at most `max_m`: for scale bars and grids.
export function round_length(max_m: number): number {
  const power = 10 ** Math.floor(Math.log10(max_m));
  const f = max_m / power;
  return (f >= 5 ? 5 : f >= 2 ? 2 : 1) * power;
}
export const length_words = (m: number): string =>
  m >= 1000
    ? `${m / 1000} km`
    : m >= 1
      ? `${m} m`
      : m >= 0.01
        ? `${Math.round(m * 100)} cm`
        : `${Math.round(m * 1e4) / 10} mm`;

const MAGNIFICATIONS = [1, 2, 5, 10, 20, 50] as const;
/// One magnification for all ellipses of a map: the largest at which the larger ones (upper quartile of major axes, metres) stay within `limit_px`.
export function magnification(majors_m: readonly number[], px_per_m: number, limit_px = 44): number {
  if (!majors_m.length) return 1;
  const sorted = [...majors_m].sort((a, b) => a - b);
  const typical = sorted[Math.floor((sorted.length - 1) * 0.75)]!;
  let best = 1;
  for (const m of MAGNIFICATIONS) if (typical * px_per_m * m <= limit_px) best = m;
  return best;
}
