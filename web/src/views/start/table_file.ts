/// A table as others write it: encodings, separators, quotes, decimal commas, and the position files of RTKLIB. No DOM.
import Papa from 'papaparse';

export interface Table {
  readonly name: string;
  readonly columns: readonly string[];
  readonly rows: readonly (readonly string[])[];
  readonly decimal: '.' | ',';
  readonly heights?: 'ellipsoidal'; ///< where the file says it
}
const MAX_ROWS = 2_000_000;
const SAMPLE = 200; ///< rows that show how a column is written

/// Text of a file: by its byte order mark, else UTF-8, else the Western European of Windows, which old programs write.
export function decoded(bytes: Uint8Array): string {
  const [a, b] = bytes;
  if (a === 0xff && b === 0xfe) return new TextDecoder('utf-16le').decode(bytes);
  if (a === 0xfe && b === 0xff) return new TextDecoder('utf-16be').decode(bytes);
  try {
    return new TextDecoder('utf-8', { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder('windows-1252').decode(bytes);
  }
}

/// Positions of RTKLIB: the last line of the heading has the names, blanks stand between columns, a moment is a date and a time of day, or a week
/// and its seconds. The heading says above what heights are: ellipsoidal, or geodetic for a geoid that it does not name.
function of_rtklib(text: string): { columns: string[]; cells: string[][]; ellipsoidal: boolean } | null {
  const lines = text.split(/\r?\n/).filter((l) => l.trim() !== ''),
    heading = lines.filter((l) => l.startsWith('%')),
    names = heading[heading.length - 1]?.slice(1).trim().split(/\s+/) ?? [];
  if (!/^(GPST|UTC|JST)$/.test(names[0] ?? '')) return null;
  if (names.some((n) => n.includes("(d'")))
    throw new Error(
      'positions in degrees, minutes and seconds: write them in decimal degrees (out-outsolformat llh, out-degform deg)',
    );
  const cells = lines
    .filter((l) => !l.startsWith('%'))
    .map((l) => {
      const [day, clock, ...rest] = l.trim().split(/\s+/);
      return [`${day} ${clock}`, ...rest];
    });
  return { columns: names, cells, ellipsoidal: heading.some((l) => /=\w+\/ellipsoidal/.test(l)) };
}

/// A decimal comma differs from a comma between two numbers by the separator: a comma that separates columns is none.
function decimal_of(separator: string, rows: readonly (readonly string[])[]): '.' | ',' {
  if (separator === ',') return '.';
  const cells = rows.slice(0, SAMPLE).flat(),
    commas = cells.filter((c) => /^[+-]?\d+,\d+$/.test(c)).length,
    points = cells.filter((c) => /^[+-]?\d+\.\d+$/.test(c)).length;
  return commas > points ? ',' : '.';
}

const VALUE = /^[0-9.:/+-]*[0-9][0-9.:/+-]*$/; ///< a number, a date or a time of day
/// Why a text is no table of names and rows, and what reads it; empty where it may be one.
export function no_table(text: string): string {
  const line = text.split('\n', 200).find((l) => l.trim() !== '' && !l.startsWith('#')) ?? '',
    head = text.slice(0, 2000).toLowerCase();
  if (line.startsWith('<'))
    return head.includes('<gpx')
      ? 'GPX is no table: write its points as CSV with time, lat, lon and alt, or give the log of the receiver itself'
      : head.includes('<kml')
        ? 'KML is no table: anchord plan import reads plans of it; write the points of a track as CSV with time, lat, lon and alt'
        : 'XML is no table: write it as CSV with a header line of names';
  if (/^[{[]/.test(line))
    return 'JSON is no table: write it as CSV with a header line of names; anchord decode FILE > track.csv reads JSON of gpsd';
  if (line.startsWith('$')) return 'a log of NMEA is no table: anchord decode FILE > track.csv makes one of it';
  const words = line.split(/[,;|\s]+/).filter((w) => w !== ''),
    values = words.filter((w) => VALUE.test(w)).length;
  return words.length > 1 && VALUE.test(words[0]!) && 2 * values >= words.length
    ? 'the first line has numbers; a header line with names is needed: write one above it, or let anchord decode FILE > track.csv read it where it has ' +
        'lines of LLH (Emlid, RTKLIB)'
    : '';
}

/// Error: what is wrong, and in which row, counted as a spreadsheet does: the header is row 1.
export function table_of(name: string, whole: string): Table {
  const why = no_table(whole);
  if (why) throw new Error(`${name}: ${why}`);
  // The line by which Excel is told the separator.
  const [told, separator] = /^"?sep=([^\r\n])"?\r?\n/i.exec(whole) ?? ['', ''],
    text = whole.slice(told.length),
    rtklib = text.startsWith('%') ? of_rtklib(text) : null,
    read = rtklib
      ? null
      : Papa.parse<string[]>(text, {
          comments: '#',
          ...(separator ? { delimiter: separator } : {}),
          skipEmptyLines: 'greedy',
          delimitersToGuess: [',', ';', '\t', '|'],
        }),
    all = (rtklib ? [rtklib.columns, ...rtklib.cells] : read!.data).map((row) => row.map((cell) => cell.trim())),
    [columns = [], ...rows] = all;
  if (all.length < 2) throw new Error(`${name}: a header line and at least one row are needed`);
  if (rows.length > MAX_ROWS) throw new Error(`${name}: ${rows.length} rows, at most ${MAX_ROWS}`);
  const quotes = read?.errors.find((e) => e.type === 'Quotes');
  if (quotes) throw new Error(`${name} row ${(quotes.row ?? 0) + 1}: a quote is opened and not closed`);
  const decimal = decimal_of(rtklib ? ' ' : read!.meta.delimiter, rows);
  if (columns.every((c) => c !== '' && Number.isFinite(number_of(c, decimal))))
    throw new Error(`${name}: the first line has numbers; a header line with names is needed`);
  const twice = columns.find((c, i) => c !== '' && columns.indexOf(c) !== i);
  if (twice !== undefined)
    throw new Error(
      `${name}: two columns have the name "${twice}"` +
        (Number.isFinite(number_of(twice, decimal)) ? ', which is a number; a header line with names is needed' : ''),
    );
  rows.forEach((row, i) => {
    // Spreadsheets leave empty cells at the end of a row.
    while (row.length > columns.length && row[row.length - 1] === '') row.pop();
    if (row.length !== columns.length)
      throw new Error(`${name} row ${i + 2}: ${row.length} cells, the header has ${columns.length}`);
  });
  return { name, columns, rows, decimal, ...(rtklib?.ellipsoidal ? { heights: 'ellipsoidal' as const } : {}) };
}

/// NaN where it is none; also for nothing at all.
export function number_of(cell: string, decimal: '.' | ','): number {
  // Beside decimal commas a point stands between thousands: "12.345" is not 12.345.
  if (cell === '' || (decimal === ',' && cell.includes('.'))) return NaN;
  return Number(decimal === ',' ? cell.replace(',', '.') : cell);
}
/// A column's first values, as they show what it is.
export const sample_of = (t: Table, column: string | undefined): readonly string[] =>
  column === undefined ? [] : t.rows.slice(0, SAMPLE).map((r) => r[t.columns.indexOf(column)] ?? '');
/// The numbers among them.
export const numbers_of = (t: Table, column: string | undefined): readonly number[] =>
  sample_of(t, column)
    .map((x) => number_of(x, t.decimal))
    .filter(Number.isFinite);
export const beyond = (values: readonly number[], most: number): boolean => values.some((v) => Math.abs(v) > most);
/// Whether numbers are written as thousands are, "12.345" or "985", each that has digits after a sign with three of them.
export function has_thousands(t: Table, column: string | undefined): boolean {
  const cells = sample_of(t, column).filter((c) => c !== '');
  return cells.some((c) => /[.,]/.test(c)) && cells.every((c) => /^\d{1,3}([.,]\d{3})*$/.test(c));
}
/// Metres from zero beyond which a frame is none of its own, as of the rows of the API.
export const MOST_LOCAL_M = 1e5;
/// What columns of latitude and longitude hold: degrees, whole numbers of 1e-7 degrees, or something else.
export type DegreesKind = 'degrees' | 'degrees_1e7' | 'no_degrees';
export function degrees_kind(t: Table, lat: string, lon: string): DegreesKind {
  const [la, lo] = [numbers_of(t, lat), numbers_of(t, lon)];
  if (!beyond(la, 90) && !beyond(lo, 180)) return 'degrees';
  // Autopilots write whole numbers of 1e-7 degrees; a northing is below 1e7 m.
  const whole = [...la, ...lo].every(Number.isInteger) && (beyond(la, 1e7) || beyond(lo, 1e7));
  return whole && !beyond(la, 90e7) && !beyond(lo, 180e7) ? 'degrees_1e7' : 'no_degrees';
}

/// All values of a column that occur, few or many.
export function values_of(t: Table, column: string): ReadonlySet<string> {
  const at = t.columns.indexOf(column),
    out = new Set<string>();
  for (const row of t.rows) out.add(row[at] ?? '');
  return out;
}

/// Columns of numbers that nothing else claims: where a logger writes one column for each anchor.
export function anchor_columns(t: Table, claimed: readonly string[]): readonly string[] {
  return t.columns.filter((c) => {
    const cells = c === '' || claimed.includes(c) ? [] : sample_of(t, c).filter((x) => x !== '');
    return cells.length > 0 && cells.every((x) => Number.isFinite(number_of(x, t.decimal)));
  });
}
/// The same ranges with a row for each: `anchor` and `range` beside what the row has of everything else.
export function with_a_row_for_each_range(t: Table, anchors: readonly string[]): Table {
  const kept = t.columns.map((c, i) => ({ c, i })).filter(({ c }) => !anchors.includes(c)),
    at = anchors.map((c) => ({ c, i: t.columns.indexOf(c) }));
  return {
    ...t,
    columns: [...kept.map(({ c }) => c), 'anchor', 'range'],
    rows: t.rows.flatMap((row) =>
      at.filter(({ i }) => row[i] !== '').map(({ c, i }) => [...kept.map((k) => row[k.i] ?? ''), c, row[i] ?? '']),
    ),
  };
}
