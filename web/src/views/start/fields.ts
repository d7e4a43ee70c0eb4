/// The columns of a flight's tables guessed by their names, and what is missing for a flight. No DOM.
import { is_east } from './axes';
import { hemisphere_column } from './meaning';
import { NAMES, plain, RANGE_FIELDS, TRACK_FIELDS, type Columns, type Field } from './names';
import { beyond, degrees_kind, MOST_LOCAL_M, numbers_of, type Table } from './table_file';

/// The columns by their names, the usual name of a field first.
function guessed(t: Table, fields: readonly Field[]): Columns {
  const by_name = new Map(t.columns.map((c) => [plain(c), c])),
    out: Partial<Record<Field, string>> = {};
  for (const f of fields) {
    const name = NAMES[f].split(' ').find((n) => by_name.has(n));
    if (name) out[f] = by_name.get(name)!;
  }
  return out;
}
interface Part {
  readonly before: string;
  readonly last: string;
  readonly column: string;
}
/// Behind the last "_" of a plain name, and before it.
const parts_of = (t: Table): readonly Part[] =>
  t.columns.flatMap((column) => {
    const [, before, last] = /^(.*)_([^_]*)$/.exec(plain(column).replace(/_m$/, '')) ?? [];
    return before === undefined || last === undefined ? [] : [{ before, last, column }];
  });
const last_word = (name: string): string => name.slice(name.lastIndexOf('_') + 1);
/// Columns of one message that have one name before their own (pose.position.x of ROS): those of the only name that has a column for each of `words`.
function of_one_message(parts: readonly Part[], words: readonly RegExp[], name: RegExp): readonly string[] | null {
  const complete = [...new Set(parts.map((p) => p.before))]
    .filter((before) => name.test(last_word(before)))
    .map((before) => words.map((w) => parts.filter((p) => p.before === before && w.test(p.last))))
    .filter((found) => found.every((f) => f.length === 1));
  return complete.length === 1 ? complete[0]!.map((f) => f[0]!.column) : null;
}
/// A field whose name is the last part of one column alone.
const by_ending = (parts: readonly Part[], field: Field, words: RegExp): Columns => {
  const found = parts.filter((p) => words.test(p.last));
  return found.length === 1 ? { [field]: found[0]!.column } : {};
};
const TIME_ENDINGS = /^(time|timestamp|timeus)$/;
const named_as = (fields: readonly Field[], columns: readonly string[] | null): Columns =>
  Object.fromEntries((columns ?? []).map((c, i) => [fields[i]!, c]));
/// Places and attitudes whose columns are called by the messages that they were in.
function by_endings(t: Table, known: Columns): Columns {
  const parts = parts_of(t),
    time = known.time ? {} : by_ending(parts, 'time', TIME_ENDINGS);
  if ((known.lat && known.lon) || (known.x && known.y)) return { ...time, ...known };
  const globe = of_one_message(parts, [/^(lat|latitude)$/, /^(lon|lng|longitude)$/, /^(alt|altitude|height)$/], /./);
  if (globe) return { ...known, ...time, ...named_as(['lat', 'lon', 'height'], globe) };
  const place = of_one_message(
      parts,
      [/^x$/, /^y$/, /^z$/],
      /^(position|pos|translation|pose|point|location|stateestimate|ned)$/,
    ),
    turn = of_one_message(parts, [/^x$/, /^y$/, /^z$/, /^w$/], /^(orientation|rotation|quaternion)$/);
  return place
    ? { ...named_as(['qx', 'qy', 'qz', 'qw'], turn), ...known, ...time, ...named_as(['x', 'y', 'z'], place) }
    : { ...time, ...known };
}
/// North, east and down by their first letters.
const with_down = (t: Table, c: Columns): Columns => {
  const down = t.columns.findLast((x) => /^d(_m)?$/.test(plain(x)));
  return !c.z && !c.height && is_east(c.x) && down !== undefined ? { ...c, z: down } : c;
};
export function guessed_track(t: Table): Columns {
  const {
      lat,
      lon,
      height,
      lat_hemisphere: _lat,
      lon_hemisphere: _lon,
      ...named
    } = with_down(
      t,
      by_endings(t, guessed(t, [...TRACK_FIELDS, 'sigma_e', 'sigma_n', 'age', 'satellites', 'qx', 'qy', 'qz', 'qw'])),
    ),
    north = hemisphere_column(t, lat, 'lat'),
    east = hemisphere_column(t, lon, 'lon'),
    rest = {
      ...named,
      ...(north ? { lat_hemisphere: north } : {}),
      ...(east ? { lon_hemisphere: east } : {}),
    };
  // Easting and northing have a height beside them; so have columns called latitude and longitude that hold metres. What is near zero and no degree may be
  // degrees and minutes, or one for the other: a person says it.
  if (
    lat &&
    lon &&
    !(
      height &&
      degrees_kind(t, lat, lon) === 'no_degrees' &&
      [lat, lon].some((c) => beyond(numbers_of(t, c), MOST_LOCAL_M))
    )
  )
    return { ...rest, lat, lon, ...(height ? { height } : {}) };
  if (lat && lon) return { ...rest, x: lon, y: lat, z: height! };
  return rest.x && rest.y && !rest.z && height
    ? { ...rest, z: height }
    : { ...rest, ...(lat ? { lat } : {}), ...(lon ? { lon } : {}), ...(height ? { height } : {}) };
}
export function guessed_ranges(t: Table): Columns {
  const parts = parts_of(t);
  return {
    ...by_ending(parts, 'time', TIME_ENDINGS),
    ...by_ending(parts, 'anchor', /^anchor$/),
    ...by_ending(parts, 'range', /^(range|distance)$/),
    ...by_ending(parts, 'tag', /^tag$/),
    ...guessed(t, [...RANGE_FIELDS, 'antenna', 'kind']),
  };
}
export const missing_track = (c: Columns): readonly Field[] => {
  const globe = (['lat', 'lon', 'height'] as const).filter((f) => !c[f]),
    local = (['x', 'y', 'z'] as const).filter((f) => !c[f]);
  return [...(c.time ? [] : (['time'] as const)), ...(globe.length && local.length ? globe : [])];
};
export const missing_ranges = (c: Columns): readonly Field[] =>
  (['time', 'anchor', 'range'] as const).filter((f) => !c[f]);
export const is_local = (c: Columns): boolean => !c.lat || !c.lon || !c.height;
