/// Columns of the anchor table: which there are, which are shown, and how latitude and longitude are written. Kept on this device.
import { signal } from '@preact/signals';
import type { AnchorRow } from '../api/anchors';
import { sigma_h, sigma_v } from '../map/enu';
import { accuracy, bearing, date, dms, fixed, latlon, metres } from '../ui/format';
import { PopList } from './pop_list';

export interface Column {
  readonly key: string;
  readonly head: string;
  readonly words: string;
  readonly cell: (r: AnchorRow) => string;
  readonly sort: (r: AnchorRow) => number | string;
  readonly width?: 'wide' | 'side-by';
} ///< wide: of large screens only; side-by: not where the detail stands beside the table
const n = (v: number | null | undefined): number => v ?? Infinity;
const ellipse_words = (r: AnchorRow): string =>
  r.ellipse95
    ? `${fixed(r.ellipse95.major_m, 2)} × ${fixed(r.ellipse95.minor_m, 2)} m @ ${bearing(r.ellipse95.azimuth_deg)}°`
    : '–';

interface Choice {
  readonly live: readonly string[];
  readonly published: readonly string[];
  readonly dms: boolean;
}
export const USUAL: Choice = {
  live: ['e', 'n', 'u', 'sh', 'sv', 'e95', 'gdop', 'count', 'rms'],
  published: ['lat', 'lon', 'h', 'sh', 'sv', 'e95', 'gdop', 'count', 'rms'],
  dms: false,
};
const KEY = 'anchord.anchors';
export function choice_of(text: string | null): Choice {
  try {
    const o = JSON.parse(text ?? '') as Partial<Record<keyof Choice, unknown>>,
      keys = (v: unknown, usual: readonly string[]): readonly string[] =>
        Array.isArray(v) ? v.filter((k): k is string => ALL.some((c) => c.key === k)) : usual;
    return { live: keys(o.live, USUAL.live), published: keys(o.published, USUAL.published), dms: o.dms === true };
  } catch {
    return USUAL;
  }
}
const stored = (): string | null => {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
};

const enu = (i: 0 | 1 | 2, words: string): Column => ({
  key: 'enu'[i]!,
  head: `${'ENU'[i]}, m`,
  words,
  cell: (r) => metres(r.enu_m?.[i]),
  sort: (r) => n(r.enu_m?.[i]),
});
export const ALL: readonly Column[] = [
  {
    key: 'lat',
    head: 'Latitude',
    words: 'Latitude',
    cell: (r) => (choice.value.dms ? dms(r.lat, 'lat') : latlon(r.lat) + (r.lat === null ? '' : '°')),
    sort: (r) => n(r.lat),
  },
  {
    key: 'lon',
    head: 'Longitude',
    words: 'Longitude',
    cell: (r) => (choice.value.dms ? dms(r.lon, 'lon') : latlon(r.lon) + (r.lon === null ? '' : '°')),
    sort: (r) => n(r.lon),
  },
  {
    key: 'h',
    head: 'h ellips., m',
    words: 'Height above the ellipsoid',
    cell: (r) => metres(r.h_m),
    sort: (r) => n(r.h_m),
  },
  {
    key: 'msl',
    head: 'h sea level, m',
    words: 'Height above sea level',
    cell: (r) => metres(r.height_msl_m),
    sort: (r) => n(r.height_msl_m),
  },
  enu(0, 'East'),
  enu(1, 'North'),
  enu(2, 'Up'),
  {
    key: 'sh',
    head: 'σ h, m',
    words: 'σ horizontal (1σ)',
    cell: (r) => fixed(sigma_h(r.cov_enu_m2), 3),
    sort: (r) => n(sigma_h(r.cov_enu_m2)),
  },
  {
    key: 'sv',
    head: 'σ v, m',
    words: 'σ vertical (1σ)',
    cell: (r) => fixed(sigma_v(r.cov_enu_m2), 3),
    sort: (r) => n(sigma_v(r.cov_enu_m2)),
  },
  {
    key: 'e95',
    head: '95 % ellipse',
    words: '95 % ellipse',
    cell: ellipse_words,
    sort: (r) => n(r.ellipse95?.major_m),
  },
  {
    key: 'abs',
    head: 'Absolute, 95 %',
    words: 'Absolute accuracy, 95 %',
    cell: (r) => accuracy(r.absolute_h95_m),
    sort: (r) => n(r.absolute_h95_m),
  },
  { key: 'gdop', head: 'GDOP', words: 'GDOP', cell: (r) => fixed(r.gdop, 2), sort: (r) => n(r.gdop) },
  {
    key: 'count',
    head: 'Ranges',
    words: 'Ranges used',
    cell: (r) => String(r.n_ranges),
    sort: (r) => r.n_ranges,
    width: 'side-by',
  },
  {
    key: 'refused',
    head: 'Rejected',
    words: 'Ranges rejected',
    cell: (r) => String(r.n_refused),
    sort: (r) => r.n_refused,
  },
  {
    key: 'rms',
    head: 'RMS, mm',
    words: 'RMS of residuals',
    cell: (r) => fixed(r.rms_residual_m === null ? null : r.rms_residual_m * 1000, 0),
    sort: (r) => n(r.rms_residual_m),
    width: 'wide',
  },
  { key: 'building', head: 'Building', words: 'Building', cell: (r) => r.building || '–', sort: (r) => r.building },
  { key: 'floor', head: 'Floor', words: 'Floor', cell: (r) => r.floor || '–', sort: (r) => r.floor },
  {
    key: 'when',
    head: 'Calibrated',
    words: 'Calibrated at',
    cell: (r) => date(r.calibrated_at),
    sort: (r) => r.calibrated_at ?? '',
  },
  {
    key: 'rev',
    head: 'Revision',
    words: 'Revision',
    cell: (r) => (r.revision === null ? '–' : String(r.revision)),
    sort: (r) => n(r.revision),
  },
];
/// A running estimate has none of these.
const PUBLISHED_ONLY = new Set(['msl', 'abs', 'building', 'floor', 'when', 'rev']);
export const choice = signal<Choice>(choice_of(stored()));
const usual = (live: boolean): readonly string[] => (live ? USUAL.live : USUAL.published);
/// In the order of the list. What was chosen is shown on any screen; the usual ones give way on small ones.
export function shown_columns(live: boolean): readonly Column[] {
  const keys = live ? choice.value.live : choice.value.published,
    same = keys.join() === usual(live).join();
  return ALL.filter((c) => keys.includes(c.key)).map(({ width, ...c }) => (same && width ? { ...c, width } : c));
}
export function choose(part: Partial<Choice>): void {
  choice.value = { ...choice.value, ...part };
  try {
    localStorage.setItem(KEY, JSON.stringify(choice.value));
  } catch {
    /* private window: not remembered */
  }
}

export function ColumnPicker({ live }: { live: boolean }) {
  const keys = live ? choice.value.live : choice.value.published,
    name = live ? 'live' : 'published';
  const toggle = (key: string): void =>
    choose({ [name]: ALL.map((c) => c.key).filter((k) => (k === key ? !keys.includes(k) : keys.includes(k))) });
  return (
    <PopList words="Columns" label="Columns of the table" id="columns" help="anchors">
      {ALL.filter((c) => !live || !PUBLISHED_ONLY.has(c.key)).map((c) => (
        <label key={c.key}>
          <input
            type="checkbox"
            checked={keys.includes(c.key)}
            data-testid={`column-${c.key}`}
            onChange={() => toggle(c.key)}
          />
          {c.words}
        </label>
      ))}
      <label class="rule">
        <input
          type="checkbox"
          checked={choice.value.dms}
          data-testid="dms"
          onChange={() => choose({ dms: !choice.value.dms })}
        />
        Degrees, minutes, seconds
      </label>
      <button class="btn small" onClick={() => choose({ [name]: usual(live) })}>
        The usual ones
      </button>
    </PopList>
  );
}
