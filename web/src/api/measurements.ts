/// Stored ranges and campaign samples, as the Measurements view shows them: one shape for both, truth and features where they are known.
import { num, obj, str } from '../live/messages';
import type { RangeClass } from '../state/scene';
import { api_url, request } from './client';

export type Source = { readonly kind: 'mission' | 'campaign'; readonly id: string; readonly name: string };
/// What the promoted models make of one; null where they were not asked.
export interface Predicted {
  readonly cls: RangeClass;
  readonly p_los: number | null;
}
export interface Sample {
  readonly id: number;
  readonly t_us: number | null;
  readonly who: string; ///< the anchor of a range, the place of a sample
  readonly predicted: Predicted | null;
  readonly distance_m: number;
  readonly rx_dbm: number | null;
  readonly truth_m: number | null;
  readonly los: boolean | null;
  readonly has_cir: boolean;
  readonly features: Readonly<Record<string, number>>;
}
export interface Page {
  readonly samples: readonly Sample[];
  readonly next: string | null;
}
/// Magnitudes of one impulse response, tap by tap.
export interface Impulse {
  readonly tap_ns: number;
  readonly first_path: number | null;
  readonly magnitude: readonly number[];
}

const DW1000_TAP_NS = 1.0016; ///< 1/(2 x 499.2 MHz): the spacing where a response names none
const FEATURE_MAX = 40;

function features_of(v: unknown): Record<string, number> {
  const known = Object.entries(obj(v) ?? {}).filter((e): e is [string, number] => num(e[1]) !== null);
  return Object.fromEntries(known.slice(0, FEATURE_MAX));
}
function predicted_of(v: unknown): Predicted | null {
  const o = obj(v),
    cls = str(o?.class);
  return cls === 'los' || cls === 'nlos' || cls === 'unclear' ? { cls, p_los: num(o?.p_los) } : null;
}
function range_of(o: Record<string, unknown>): Sample | null {
  const id = num(o.id),
    distance_m = num(o.distance_m),
    truth = obj(o.truth),
    features = features_of(o.features);
  if (id === null || distance_m === null) return null;
  const rx_dbm = num(o.rx_dbm) ?? num(o.rss_dbm);
  return {
    id,
    t_us: num(o.t_us),
    who: str(o.anchor),
    distance_m,
    rx_dbm,
    truth_m: num(truth?.distance_m),
    los: typeof truth?.los === 'boolean' ? truth.los : null,
    has_cir: 'kurtosis' in features || o.has_cir === true,
    features,
    predicted: predicted_of(o.predicted),
  };
}
function sample_of(o: Record<string, unknown>): Sample | null {
  const id = num(o.id),
    distance_m = num(o.range_m),
    truth = obj(o.truth);
  if (id === null || distance_m === null) return null;
  return {
    id,
    t_us: num(o.t_us),
    who: str(truth?.environment) || str(truth?.setting),
    distance_m,
    rx_dbm: num(o.rx_dbm),
    truth_m: num(truth?.distance_m),
    los: typeof truth?.los === 'boolean' ? truth.los : null,
    has_cir: o.has_cir === true,
    features: features_of(o.features),
    predicted: predicted_of(o.predicted),
  };
}

/// What is looked at; the server does the choosing, so that a page, a count and a file are of the same rows.
export interface Filter {
  readonly who: string;
  readonly by: 'environment' | 'setting'; ///< of a campaign: what `who` names
  readonly label: '' | 'los' | 'nlos' | 'none';
  readonly cls: '' | RangeClass;
  readonly fix: '' | 'none' | 'single' | 'dgps' | 'float' | 'fixed';
  readonly min_m: number | null;
  readonly max_m: number | null;
  readonly min_dbm: number | null;
  readonly max_dbm: number | null;
  readonly since_us: number | null;
  readonly until_us: number | null;
}
export const EVERYTHING: Filter = {
  who: '',
  by: 'environment',
  label: '',
  cls: '',
  fix: '',
  min_m: null,
  max_m: null,
  min_dbm: null,
  max_dbm: null,
  since_us: null,
  until_us: null,
};

/// A filter as the server's query. Time and fix are of flights only: a campaign is of places.
export function query_of(source: Source, f: Filter): URLSearchParams {
  const query = new URLSearchParams(),
    flight = source.kind === 'mission',
    put = (key: string, v: string | number | null): void => {
      if (v !== null && v !== '') query.set(key, String(v));
    };
  if (flight) {
    put('mission', source.id);
    put('since', f.since_us);
    put('until', f.until_us);
    put('fix', f.fix);
  }
  put(flight ? 'anchor' : f.by, f.who);
  put('label', f.label);
  put('class', f.cls);
  put('min_distance_m', f.min_m);
  put('max_distance_m', f.max_m);
  put('min_level_dbm', f.min_dbm);
  put('max_level_dbm', f.max_dbm);
  return query;
}
const path_of = (source: Source): string =>
  source.kind === 'mission' ? '/ranges' : `/campaigns/${encodeURIComponent(source.id)}/samples`;

export interface Wanted {
  readonly limit: number;
  readonly cursor: string | null;
  readonly oldest_first: boolean;
  readonly every: number;
}
export async function page_of(source: Source, filter: Filter, w: Wanted): Promise<Page> {
  const query = query_of(source, filter);
  for (const [k, v] of [
    ['limit', String(w.limit)],
    ['features', 'true'],
    ['predicted', 'true'],
  ])
    query.set(k!, v!);
  if (w.every > 1) query.set('every', String(w.every));
  if (w.cursor) query.set('cursor', w.cursor);
  if (source.kind === 'mission' && !w.oldest_first) query.set('sort', '-t_us');
  const answer = obj(await request('GET', `${path_of(source)}?${query}`)),
    items = Array.isArray(answer?.items) ? answer.items : [];
  const read = source.kind === 'mission' ? range_of : sample_of;
  return {
    samples: items
      .map(obj)
      .map((o) => o && read(o))
      .filter((s): s is Sample => s !== null),
    next: str(answer?.next_cursor) || null,
  };
}
/// Rows of a flight that pass what is stored; the class by the models is not, and campaigns are not counted.
export async function count_of(source: Source, filter: Filter): Promise<number | null> {
  if (source.kind !== 'mission') return null;
  const query = query_of(source, { ...filter, cls: '' });
  query.set('count', 'exact');
  query.set('limit', '1');
  return num(obj(await request('GET', `/ranges?${query}`))?.total);
}
export async function campaigns(): Promise<Source[]> {
  const answer = obj(await request('GET', '/campaigns?limit=200')),
    items = Array.isArray(answer?.items) ? answer.items : [];
  return items
    .map(obj)
    .filter((o) => o !== null && str(o.id) !== '')
    .map((o) => ({ kind: 'campaign', id: str(o!.id), name: str(o!.name) }));
}

/// Base64 of int16 pairs re, im, little endian, as the server keeps what the radio gave.
export function impulse_of(answer: unknown): Impulse | null {
  const o = obj(answer),
    raw = atob(str(o?.b64));
  const bytes = new DataView(Uint8Array.from(raw, (c) => c.charCodeAt(0)).buffer),
    dt_ps = num(o?.dt_ps);
  const magnitude = Array.from({ length: Math.floor(bytes.byteLength / 4) }, (_, i) =>
    Math.hypot(bytes.getInt16(4 * i, true), bytes.getInt16(4 * i + 2, true)),
  );
  return magnitude.length
    ? { tap_ns: dt_ps ? dt_ps / 1000 : DW1000_TAP_NS, first_path: num(o?.first_path_idx), magnitude }
    : null;
}
export async function impulse(source: Source, id: number): Promise<Impulse | null> {
  const of = source.kind === 'mission' ? `/ranges/${id}` : `/campaigns/${encodeURIComponent(source.id)}/samples/${id}`;
  return impulse_of(await request('GET', `${of}/cir`));
}

/// Exactly what is filtered, streamed by the server into a file.
export function download_url(source: Source, filter: Filter, format: 'csv' | 'ndjson'): string {
  const query = query_of(source, filter);
  query.set('format', format);
  return api_url(`${path_of(source)}?${query}`);
}
