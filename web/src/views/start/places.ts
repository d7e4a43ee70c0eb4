/// Where a track's numbers are: degrees, a local frame, a map, the earth's centre; and above what its heights are. No DOM.
import { is_local } from './fields';
import { plain, type Columns } from './names';
import { beyond, degrees_kind, MOST_LOCAL_M, numbers_of, type DegreesKind, type Table } from './table_file';
import { unit_of_name, type LengthUnit } from './values';

/// `map`: metres far from any zero of one's own.
export type PlaceKind = DegreesKind | 'local' | 'map' | 'ecef';

export function place_kind(t: Table, c: Columns): PlaceKind {
  if (!is_local(c)) return degrees_kind(t, c.lat!, c.lon!);
  if ([c.x, c.y, c.z].some((name) => /ecef/.test(plain(name ?? '')))) return 'ecef';
  const axes = [c.x, c.y, c.z].map((name) => numbers_of(t, name)),
    from_centre_m = Math.hypot(...axes.map((a) => a[0] ?? 0));
  // On the surface of the earth, and not a northing of that size with a height beside it.
  if (from_centre_m > 6.3e6 && from_centre_m < 6.4e6 && beyond(axes[2]!, MOST_LOCAL_M)) return 'ecef';
  return axes.some((a) => beyond(a, MOST_LOCAL_M)) ? 'map' : 'local';
}

/// `ellipsoidal`; `column`: another column has the height of the geoid; else as the server reads it: the EPSG code of a vertical system, or metres.
export type Heights = string;
export const HEIGHT_WORDS = {
  ellipsoidal: 'the ellipsoid (WGS84, GRS80)',
  column: 'mean sea level, the geoid is in a column',
  'EPSG:5773': 'mean sea level, EGM96 (EPSG:5773)',
  other: 'another level',
} as const;
/// Null where nothing says it, and where it is sea level by a geoid that nothing names.
export function heights_of(t: Table, c: Columns): Heights | null {
  const name = plain((is_local(c) ? c.z : c.height) ?? '');
  if (/msl|orthometric|sea_level|nhn/.test(name)) return c.separation ? 'column' : null;
  if (/(^|_)(ell|ellips\w*|hae)(_|$)|^h_m$/.test(name)) return 'ellipsoidal';
  return t.heights ?? null;
}
export function height_unit_of(t: Table, c: Columns, kind: PlaceKind): LengthUnit {
  const name = is_local(c) ? c.z : c.height;
  // Who writes whole numbers of 1e-7 degrees writes whole millimetres.
  return unit_of_name(name) ?? (kind === 'degrees_1e7' && numbers_of(t, name).every(Number.isInteger) ? 'mm' : 'm');
}
