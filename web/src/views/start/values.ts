/// How a flight's values are written: moments, lengths and fix classes, known by their looks or given by a person. No DOM.
import { plain } from './names';
import { number_of, sample_of, values_of, type Table } from './table_file';

export type TimeUnit = 's' | 'ms' | 'us' | 'ns' | 'date';
/// UTC, or the time of GPS: 18 s ahead of UTC since 2017; its numbers count from 6 January 1980.
export type TimeScale = 'utc' | 'gps';
export interface TimeReading {
  readonly unit: TimeUnit | null; ///< null: two or more are possible, and a person has to say it
  readonly scale: TimeScale;
}
export const TIME_UNITS: Record<TimeUnit, string> = {
  date: 'dates',
  s: 'seconds',
  ms: 'milliseconds',
  us: 'microseconds',
  ns: 'nanoseconds',
};
export type LengthUnit = 'm' | 'cm' | 'mm';
export const LENGTH_UNITS: Record<LengthUnit, string> = { m: 'metres', cm: 'centimetres', mm: 'millimetres' };
/// By the ending of a column's name.
export const unit_of_name = (column: string | undefined): LengthUnit | undefined =>
  /_(m|cm|mm)$/.exec(plain(column ?? ''))?.[1] as LengthUnit | undefined;
export const PER_METRE: Record<LengthUnit, number> = { m: 1, cm: 100, mm: 1000 };

/// By its last word, or by one that is written together: TimeUS of ArduPilot.
function time_unit_of_name(name: string): TimeUnit | undefined {
  const word = /_([a-z]+)$/.exec(name)?.[1] ?? /^time(?!s$)([a-z]+)$/.exec(name)?.[1] ?? '';
  return /^(s|sec|secs|seconds)$/.test(word) ? 's' : (/^([mun]s)(ec)?$/.exec(word)?.[1] as TimeUnit | undefined);
}
/// Topics of PX4 as CSV (ulog2csv) have `timestamp` in microseconds since boot.
const is_px4 = (t: Table): boolean =>
  ['timestamp_sample', 'ref_timestamp', 'timestamp_time_relative'].some((c) => t.columns.includes(c));

/// 2 kHz to 0.2 Hz; of moments that a calendar shows (1999 to 2103), gaps do no harm. Those since a machine was switched on: at most ten days of work, and a
/// flight of at least five seconds.
const SHORTEST_S = 1 / 2000;
const LONGEST_S = 5;
const LONGEST_OF_DATE_S = 499;
const FIRST_DATE_S = 9.4e8;
const LAST_DATE_S = 4.2e9;
const MOST_UPTIME_S = 864_000;
const LEAST_FLIGHT_S = 5;
/// Units in which the moments of a column can be those of the rows of a flight.
function fitting_units(t: Table, column: string | undefined): readonly TimeUnit[] {
  const at = column === undefined ? -1 : t.columns.indexOf(column),
    times = [...new Set(t.rows.map((r) => number_of(r[at] ?? '', t.decimal)).filter(Number.isFinite))].sort(
      (a, b) => a - b,
    ),
    n = times.length;
  if (!n) return [];
  // Between the first and the last tenth, so that a stray row decides nothing.
  const from = Math.floor(n / 10),
    to = n - 1 - from,
    span = times[to]! - times[from]!,
    spacing = to > from ? span / (to - from) : 0,
    out: TimeUnit[] = [];
  for (const [unit, s] of [
    ['s', 1],
    ['ms', 1e-3],
    ['us', 1e-6],
    ['ns', 1e-9],
  ] as const) {
    const [at_s, each_s] = [times[Math.floor(n / 2)]! * s, spacing * s];
    if (
      at_s > FIRST_DATE_S &&
      at_s < LAST_DATE_S &&
      each_s <= LONGEST_OF_DATE_S &&
      (spacing === 0 || each_s >= SHORTEST_S)
    )
      return [unit];
    if (
      each_s >= SHORTEST_S &&
      each_s <= LONGEST_S &&
      Math.abs(at_s) <= MOST_UPTIME_S &&
      span * s >= 0.8 * LEAST_FLIGHT_S
    )
      out.push(unit);
  }
  return out;
}

/// By the name of the column; by values that are moments of this century; by the rate of rows, which is 0.2 Hz to 2 kHz; else by how its first value looks.
export function time_reading(t: Table, column: string | undefined): TimeReading {
  const name = plain(column ?? ''),
    first = sample_of(t, column)[0] ?? '',
    v = number_of(first, t.decimal),
    scale: TimeScale = /(^|_)gps(t|_|$)/.test(name) ? 'gps' : 'utc';
  if (/[:/]/.test(first)) return { unit: 'date', scale };
  const named = time_unit_of_name(name) ?? (name === 'timestamp' && is_px4(t) ? 'us' : undefined),
    units = named ? [named] : fitting_units(t, column);
  return {
    unit: units.length > 1 ? null : (units[0] ?? (v > 1e17 ? 'ns' : v > 1e14 ? 'us' : v > 1e11 ? 'ms' : 's')),
    scale,
  };
}
export function range_unit(t: Table, column: string | undefined): LengthUnit {
  const ending = unit_of_name(column),
    values = sample_of(t, column).map((x) => number_of(x, t.decimal));
  return ending ?? (values.filter((v) => v > 400).length > values.length / 2 ? 'mm' : 'm');
}

/// Seconds by which GPS was ahead of UTC, from these days on (IERS Bulletin C).
const LEAPS: readonly (readonly [string, number])[] = [
  ['2017-01-01', 18],
  ['2015-07-01', 17],
  ['2012-07-01', 16],
  ['2009-01-01', 15],
  ['2006-01-01', 14],
];
const GPS_EPOCH_US = Date.UTC(1980, 0, 6) * 1000;
const leaps_us = (us: number): number => (LEAPS.find(([day]) => us >= Date.parse(day) * 1000)?.[1] ?? 0) * 1e6;

const DATE =
  /^(\d{4})[-/.](\d\d?)[-/.](\d\d?)[T ]+(\d\d?):(\d\d):(\d\d)(?:[.,](\d+))?\s*(Z|UTC|GMT|GPST|[+-]\d\d:?\d\d)?$/i;
/// Microseconds of a date without its zone; one that names none is of `scale`, never of this computer's own zone.
function date_us(text: string): number {
  const m = DATE.exec(text);
  if (!m) return NaN;
  const [, y, mo, d, h, mi, s, fraction = '', zone = ''] = m,
    ms = Date.UTC(Number(y), Number(mo) - 1, Number(d), Number(h), Number(mi), Number(s)),
    ahead = /^([+-])(\d\d):?(\d\d)$/.exec(zone),
    zone_min = ahead ? Number(`${ahead[1]}1`) * (60 * Number(ahead[2]) + Number(ahead[3])) : 0;
  if (new Date(ms).getUTCDate() !== Number(d)) return NaN;
  return ms * 1000 + Math.round(Number(`0.${fraction || 0}`) * 1e6) - zone_min * 60e6;
}
/// Microseconds since 1970 UTC; NaN where it is no moment. A week and its seconds are of GPS, whatever else is said.
/// `epoch_ms`: of a flight whose times count from its beginning.
export function time_us(cell: string, { unit, scale }: TimeReading, decimal: '.' | ',', epoch_ms: number): number {
  const of_week = /^(\d{3,4}) +(\d+(?:\.\d*)?)$/.exec(cell);
  if (of_week) {
    const us = GPS_EPOCH_US + Math.round((Number(of_week[1]) * 604800 + Number(of_week[2])) * 1e6);
    return us - leaps_us(us);
  }
  if (unit === 'date') {
    const us = date_us(cell),
      gps = /GPST$/i.test(cell) || (scale === 'gps' && !/(Z|UTC|GMT|[+-]\d\d:?\d\d)$/i.test(cell));
    return gps ? us - leaps_us(us) : us;
  }
  if (unit === null) return NaN;
  const us = number_of(cell, decimal) * { s: 1e6, ms: 1e3, us: 1, ns: 1e-3 }[unit];
  // Some hours or days count from the beginning of the flight; decades are since 1970, or since 1980.
  if (us < 3e14) return Math.round(epoch_ms * 1000 + us);
  if (scale === 'utc') return Math.round(us);
  const since_1970_us = us + GPS_EPOCH_US;
  return Math.round(since_1970_us - leaps_us(since_1970_us));
}

export type FixWord = 'none' | 'single' | 'dgps' | 'float' | 'fixed';
/// What the numbers of a fix column mean. Who takes one for the other believes single positions as RTK fixed ones.
/// `gnss`: words, and "FIX" alone is any fix of a receiver.
export type FixNumbers = 'gnss' | 'solution' | 'nmea' | 'rtklib' | 'mavlink';
export const FIX_NUMBERS: Record<FixNumbers | 'words', string> = {
  gnss: 'words, and FIX is a position without RTK',
  words: 'words, and FIX is RTK fixed',
  solution: '2 fixed, 1 float, 0 neither (u-blox carrSoln, flight folders)',
  nmea: '4 fixed, 5 float, 2 DGPS, 1 single (NMEA GGA)',
  rtklib: '1 fixed, 2 float, 4 DGPS, 5 single (RTKLIB, Emlid)',
  mavlink: '6 fixed, 5 float, 4 DGPS, 3 single (MAVLink GPS_FIX_TYPE)',
};
const BY_NUMBER: Record<FixNumbers, Readonly<Record<string, FixWord>>> = {
  gnss: {},
  solution: { '0': 'single', '1': 'float', '2': 'fixed' },
  nmea: { '0': 'none', '1': 'single', '2': 'dgps', '3': 'single', '4': 'fixed', '5': 'float', '6': 'none' },
  rtklib: { '0': 'none', '1': 'fixed', '2': 'float', '3': 'dgps', '4': 'dgps', '5': 'single', '6': 'dgps' },
  mavlink: { '0': 'none', '1': 'none', '2': 'single', '3': 'single', '4': 'dgps', '5': 'float', '6': 'fixed' },
};
const BY_WORD: Readonly<Record<string, FixWord>> = Object.fromEntries(
  (
    [
      ['fixed', 'fixed fix rtk_fixed rtk_fix rtkfixed rtkfix narrow_int integer'],
      ['float', 'float rtk_float rtkfloat narrow_float'],
      ['dgps', 'dgps dgnss sbas waas psrdiff'],
      ['single', 'single spp autonomous gnss gps 2d 3d 2d_fix 3d_fix'],
      ['none', 'none no_fix nofix no invalid'],
    ] as const
  ).flatMap(([fix, words]) => words.split(' ').map((w) => [w, fix])),
);
/// Names that one of them alone goes by; "fix", "quality" and "rtk" are used with any.
const BY_NAME: readonly (readonly [RegExp, FixNumbers])[] = [
  [/^q$/, 'rtklib'],
  [/carr_?soln/, 'solution'],
  [/gga|gps_qual|fix_quality/, 'nmea'],
];
/// What the numbers of the column mean; `words` where it has none; null where a person has to say it.
export function fix_numbers(t: Table, column: string, from_flight_folder: boolean): FixNumbers | 'words' | null {
  const values = [...values_of(t, column)],
    numbers = values.filter((v) => /^\d+$/.test(v));
  // Receivers without RTK write FIX for any position; beside FLOAT it is the other state of RTK.
  if (!numbers.length)
    return values.some((v) => plain(v) === 'fix') &&
      !values.some((v) => ['float', 'fixed'].includes(fix_of(v, 'gnss') ?? ''))
      ? 'gnss'
      : 'words';
  if (from_flight_folder && numbers.every((v) => v in BY_NUMBER.solution)) return 'solution';
  return BY_NAME.find(([name]) => name.test(plain(column)))?.[1] ?? null;
}
/// Null where the cell says nothing that is known.
export function fix_of(cell: string, numbers: FixNumbers | 'words'): FixWord | null {
  if (numbers === 'gnss' && plain(cell) === 'fix') return 'single';
  return (numbers === 'words' ? undefined : BY_NUMBER[numbers][cell]) ?? BY_WORD[plain(cell)] ?? null;
}

/// "0x6a2f" or plain decimal of 32 bits, as everywhere; some programs write whole numbers as 27183.0.
export const is_address = (text: string): boolean =>
  /^(0x[0-9a-f]{1,8}|\d{1,10}(\.0+)?)$/i.test(text) && Number(text) <= 0xffffffff;
/// The radio address of an anchor that has a name alone: FNV-1a of its UTF-8 with the highest bit set, as `anchord import flight` has it.
export function address_of(text: string): string {
  if (is_address(text)) return text.toLowerCase().replace(/\.0+$/, '');
  let hash = 2166136261;
  for (const byte of new TextEncoder().encode(text)) hash = Math.imul(hash ^ byte, 16777619) >>> 0;
  return `0x${((hash | 0x80000000) >>> 0).toString(16)}`;
}
