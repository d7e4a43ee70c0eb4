/// Numbers as people read them: fixed decimals per quantity, a true minus, an en dash where nothing is known. No DOM.

export const MISSING = '–';

export function fixed(value: number | null | undefined, decimals: number): string {
  if (value == null || !Number.isFinite(value)) return MISSING;
  const text = value.toFixed(decimals);
  return /^-0(\.0+)?$/.test(text) ? text.slice(1) : text.replace('-', '−');
}
export const metres = (v: number | null | undefined): string => fixed(v, 3); ///< positions
export const range_m = (v: number | null | undefined): string => fixed(v, 2);
export const millimetres = (v_m: number | null | undefined): string => fixed(v_m == null ? null : v_m * 1000, 0);
export const percent = (p: number | null | undefined): string => fixed(p == null ? null : p * 100, 0);

/// Whole degrees, always three digits: 044.
export function bearing(deg: number | null | undefined): string {
  if (deg == null || !Number.isFinite(deg)) return MISSING;
  return String(((Math.round(deg) % 360) + 360) % 360).padStart(3, '0');
}
/// Decimal degrees with 9 decimals in groups of three: 51.023 181 327 (thin no-break spaces).
export function latlon(deg: number | null | undefined): string {
  if (deg == null || !Number.isFinite(deg)) return MISSING;
  const [whole, part] = fixed(deg, 9).split('.') as [string, string];
  return `${whole}.${part.replace(/(\d{3})(?=\d)/g, '$1\u202f')}`;
}
/// Degrees, minutes and seconds with the hemisphere: 51°01′23.45298″ N. Five decimals of a second are 0.3 mm. Carries are whole: never 60″.
export function dms(deg: number | null | undefined, axis: 'lat' | 'lon'): string {
  if (deg == null || !Number.isFinite(deg)) return MISSING;
  const units = Math.round(Math.abs(deg) * 3600 * 1e5),
    s = units % 6_000_000,
    m = Math.floor(units / 6_000_000) % 60,
    d = Math.floor(units / 360_000_000);
  return `${d}°${String(m).padStart(2, '0')}′${(s / 1e5).toFixed(5).padStart(8, '0')}″\u00a0${axis === 'lat' ? (deg < 0 ? 'S' : 'N') : deg < 0 ? 'W' : 'E'}`;
}
/// What is pasted elsewhere: plain ASCII.
export const plain = (v: number | null | undefined, decimals: number): string => (v == null ? '' : v.toFixed(decimals));

/// Integers in groups of three: 152 823.
export function grouped(v: number | null | undefined): string {
  return v == null || !Number.isFinite(v) ? MISSING : fixed(v, 0).replace(/\B(?=(\d{3})+(?!\d))/g, '\u202f');
}
/// 00:12:41, or 12:41 without hours when `short`.
export function clock(seconds: number | null | undefined, short = false): string {
  if (seconds == null || !Number.isFinite(seconds)) return MISSING;
  const s = Math.max(0, Math.floor(seconds));
  const [h, m, r] = [Math.floor(s / 3600), Math.floor((s % 3600) / 60), s % 60].map((x) =>
    String(x).padStart(2, '0'),
  ) as [string, string, string];
  return short && h === '00' ? `${m}:${r}` : `${h}:${m}:${r}`;
}
/// Age in words: 6 s, 4 min, 2 h, 3 d.
export function age(ms: number): string {
  const s = ms / 1000;
  if (!Number.isFinite(s)) return 'long';
  if (s < 90) return `${Math.max(0, Math.round(s))} s`;
  if (s < 5400) return `${Math.round(s / 60)} min`;
  return s < 172_800 ? `${Math.round(s / 3600)} h` : `${Math.round(s / 86_400)} d`;
}
/// An accuracy in the unit a person would say: ±7 cm, ±1.4 m, ±8 mm.
export function accuracy(m: number | null | undefined): string {
  if (m == null || !Number.isFinite(m)) return MISSING;
  if (m < 0.01) return `±${Math.max(1, Math.round(m * 1000))} mm`;
  return m < 1 ? `±${Math.round(m * 100)} cm` : `±${m < 10 ? m.toFixed(1) : Math.round(m)} m`;
}
/// A length on an axis: 10 m, 10 cm, 1 mm. Null, as an axis has it where there is no room for one, is no word.
export function axis_m(m: number | null): string {
  if (m === null) return '';
  return m >= 1 ? `${m} m` : m >= 0.01 ? `${Math.round(m * 100)} cm` : `${Math.round(m * 1000)} mm`;
}
export function bytes(v: number | null | undefined): string {
  if (v == null) return MISSING;
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let i = 0,
    x = v;
  while (x >= 1000 && i < units.length - 1) {
    x /= 1000;
    i++;
  }
  return `${x < 10 && i > 0 ? x.toFixed(1) : Math.round(x)} ${units[i]}`;
}
/// Local or UTC date and time of an RFC 3339 text, to the minute, with the zone said.
export function date(text: string | null | undefined): string {
  const d = new Date(text ?? '');
  return Number.isNaN(d.getTime()) ? MISSING : `${d.toISOString().slice(0, 16).replace('T', ' ')} UTC`;
}

/// Names of a list, with the time where two are the same: eight flights named "demonstration" are eight lines that differ.
export function told_apart<T extends { readonly name: string; readonly started_us: number | null }>(
  list: readonly T[],
): Map<T, string> {
  const count = new Map<string, number>();
  for (const x of list) count.set(x.name, (count.get(x.name) ?? 0) + 1);
  return new Map(
    list.map((x) => [
      x,
      (count.get(x.name) ?? 0) > 1 && x.started_us !== null
        ? `${x.name}, ${date(new Date(x.started_us / 1000).toISOString())}`
        : x.name,
    ]),
  );
}
