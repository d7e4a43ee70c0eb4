/// Which way x, y, z of a track count, known by names, or asked for where the heights could be of either. No DOM.
import { plain, type Columns } from './names';
import { number_of, type Table } from './table_file';

/// East, north, up; or north, east, down, as autopilots write.
export type TrackAxes = 'enu' | 'ned';
export const TRACK_AXES: Record<TrackAxes, string> = {
  enu: 'east, north, up',
  ned: 'north, east, down (PX4, ArduPilot)',
};
/// Heights nearer to zero are those of an aircraft that stands; what a track that begins at its top has above that, and what it falls at least.
const STANDING_M = 0.3;
const TOP_M = 0.5;
const FALL_M = 1;

const has_word = (column: string | undefined, words: RegExp): boolean =>
  plain(column ?? '')
    .split('_')
    .some((w) => words.test(w));
/// Which of x and y is which is said by their names, and z alone may count downwards.
export const is_east = (column: string | undefined): boolean =>
  has_word(column, /^(e|east|easting|rechtswert|ostwert|pe)$/);

/// Columns beside x, y, z in the local positions of PX4 (vehicle_local_position, ulog2csv) and of MAVLink (LOCAL_POSITION_NED).
const BESIDE_NED = [
  ['ref_timestamp'],
  ['xy_valid', 'z_valid'],
  ['xy_global', 'z_global'],
  ['vx', 'vy', 'vz', 'ref_lat'],
  ['vx', 'vy', 'vz', 'time_boot_ms'],
];
/// Nearly all of it is below zero, or it begins at its top and falls below zero.
function looks_downwards(t: Table, z: string | undefined): boolean {
  const at = z === undefined ? -1 : t.columns.indexOf(z);
  let [below, above, first, least, most] = [0, 0, NaN, Infinity, -Infinity];
  for (const row of t.rows) {
    const v = number_of(row[at] ?? '', t.decimal);
    if (!Number.isFinite(v)) continue;
    if (Number.isNaN(first)) first = v;
    [least, most] = [Math.min(least, v), Math.max(most, v)];
    if (v < -STANDING_M) below++;
    if (v > STANDING_M) above++;
  }
  return below > 0 && (10 * below >= 9 * (below + above) || (most - first <= TOP_M && first - least >= FALL_M));
}
/// Null where names say nothing and the heights of a frame of its own are what a z that counts downwards looks like.
export function track_axes(t: Table, c: Columns, own_frame: boolean): TrackAxes | null {
  if (has_word(c.z, /^(down|d|pd|ned)$/) || has_word(c.x, /^ned$/)) return 'ned';
  if (has_word(c.z, /^(up|u|enu|ecef|alt|altitude|height|h|hoehe|ell|hae|msl|hmsl)$/)) return 'enu';
  const names = new Set(t.columns.map(plain));
  if (BESIDE_NED.some((all) => all.every((n) => names.has(n)))) return 'ned';
  return own_frame && looks_downwards(t, c.z) ? null : 'enu';
}

export const enu_of = (
  [x, y, z]: readonly [number, number, number],
  axes: TrackAxes,
  named_east: boolean,
): readonly [number, number, number] => (axes === 'enu' ? [x, y, z] : named_east ? [x, y, 0 - z] : [y, x, 0 - z]);
/// x, y, z, w of a body with axes forward, left, up; of NED that of one with forward, right, down is given: half a turn about north-east, and one about
/// forward.
export function enu_attitude(q: readonly number[], axes: TrackAxes): readonly number[] {
  const [x, y, z, w] = q as readonly [number, number, number, number],
    half = Math.SQRT1_2;
  return axes === 'enu' ? q : [half * (x + y), half * (x - y), half * (w - z), half * (w + z)];
}
