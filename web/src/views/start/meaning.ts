/// Columns that change what another one means, and what a name leaves open of headings and addresses. No DOM.
import { NAMES, plain, type Columns, type Field } from './names';
import { number_of, values_of, type Table } from './table_file';
import { address_of, type LengthUnit } from './values';

/// Unit and direction of a heading: clockwise from north, or counter-clockwise from east.
export type HeadingKind = 'deg' | 'rad' | 'deg_ccw_from_east' | 'rad_ccw_from_east';
export const HEADING_KINDS: Record<HeadingKind, string> = {
  deg: 'degrees, clockwise from true north',
  rad: 'radians, clockwise from true north',
  deg_ccw_from_east: 'degrees, counter-clockwise from east',
  rad_ccw_from_east: 'radians, counter-clockwise from east (ROS)',
};
/// Null where a person has to say it: a name without a unit, and no value beyond two pi.
export function heading_kind(t: Table, column: string | undefined): HeadingKind | null {
  if (!column || plain(column).endsWith('_deg')) return 'deg';
  const values = [...values_of(t, column)].map((v) => number_of(v, t.decimal)).filter(Number.isFinite);
  return values.length && values.every((v) => Math.abs(v) <= 2 * Math.PI) ? null : 'deg';
}
/// Degrees clockwise from north, 0 to 360.
export function north_deg(value: number, kind: HeadingKind): number {
  const degrees = kind.startsWith('rad') ? (value * 180) / Math.PI : value,
    from_north = kind.endsWith('east') ? 90 - degrees : degrees;
  return ((from_north % 360) + 360) % 360;
}

/// How addresses without 0x are written.
export type AddressKind = 'names' | 'hex';
export const ADDRESS_KINDS: Record<AddressKind, string> = {
  hex: 'hexadecimal numbers without 0x',
  names: 'names and decimal numbers',
};
const HEX = /^[0-9a-f]{4,16}$/i;
/// Four or more hexadecimal digits in each cell and a letter in one, or in the text given: 1021 beside 9E04.
export function may_be_hexadecimal(t: Table, column: string | undefined, given = ''): boolean {
  const cells = column === undefined ? [] : [...values_of(t, column)].filter((v) => v !== '');
  return cells.every((v) => HEX.test(v)) && [...cells, given].some((v) => HEX.test(v) && /[a-f]/i.test(v));
}
export const written_address = (text: string, kind: AddressKind): string =>
  kind === 'hex' && HEX.test(text) && text.replace(/^0+/, '').length <= 8
    ? `0x${text.toLowerCase().replace(/^0+(?=.)/, '')}`
    : address_of(text);

const LETTERS = { lat: /^(n|s|north|south)$/, lon: /^(e|w|east|west)$/ };
/// The column of N and S, or E and W, that a latitude or a longitude needs: by its name, or right beside it.
export function hemisphere_column(t: Table, used: string | undefined, axis: 'lat' | 'lon'): string | undefined {
  const beside = used === undefined ? -2 : t.columns.indexOf(used),
    names = NAMES[`${axis}_hemisphere`].split(' ');
  return t.columns.find((c, i) => {
    if (i !== beside + 1 && !names.includes(plain(c))) return false;
    const words = words_in(t, c);
    return words.length > 0 && words.every((w) => LETTERS[axis].test(w));
  });
}
/// +1 or -1; null where the cell has no letter.
export function hemisphere_sign(cell: string): 1 | -1 | null {
  const word = plain(cell);
  return /^(n|north|e|east)$/.test(word) ? 1 : /^(s|south|w|west)$/.test(word) ? -1 : null;
}

const words_in = (t: Table, column: string): readonly string[] =>
  [...new Set([...values_of(t, column)].map(plain))].filter((w) => w !== '').sort();

/// A column that says in which unit another one is; `unit` null: feet, several, or another that is not read.
export interface UnitColumn {
  readonly name: string;
  readonly word: string;
  readonly unit: LengthUnit | null;
}
const UNITS: Readonly<Record<string, LengthUnit | null>> = {
  ...Object.fromEntries(['m', 'metre', 'metres', 'meter', 'meters'].map((w) => [w, 'm' as const])),
  cm: 'cm',
  mm: 'mm',
  ...Object.fromEntries('ft feet foot f us_ft usft ft_us in inch inches yd km mi nmi'.split(' ').map((w) => [w, null])),
};
export function unit_column(t: Table, c: Columns, field: Field): UnitColumn | null {
  const beside = c[field] === undefined ? -1 : t.columns.indexOf(c[field]),
    used = Object.values(c);
  if (beside < 0) return null;
  for (const [i, name] of t.columns.entries()) {
    const named = /unit|einheit/.test(plain(name));
    // One that stands right behind another column in use is of that one.
    if (used.includes(name) || !(i === beside + 1 || (named && !(i > 0 && used.includes(t.columns[i - 1]!))))) continue;
    const words = words_in(t, name);
    if (!words.length || !words.every((w) => w in UNITS)) continue;
    return { name, word: words.join(', '), unit: words.length === 1 ? UNITS[words[0]!]! : null };
  }
  return null;
}

/// A date with the zone that stands in a column of its own; one that has a zone keeps it.
export function with_zone(date: string, zone: string): string {
  const clock = date.indexOf(':');
  return !zone || (clock >= 0 && /[^0-9:.,]/.test(date.slice(clock))) ? date : `${date} ${zone}`;
}

/// What no field uses, so that nobody takes it for read.
export function unused_columns(t: Table, of: readonly Columns[]): readonly string[] {
  const used = of.flatMap((c) => [
    ...Object.values(c),
    ...(['range', 'height', 'z'] as const).map((f) => unit_column(t, c, f)?.name),
  ]);
  return t.columns.filter((c) => c !== '' && !used.includes(c));
}
