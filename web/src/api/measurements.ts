/// Stored ranges and campaign samples, as the Measurements view shows them: one shape for both, truth and features where they are known.
import { num, obj, str } from '../live/messages';
import { api_url, request } from './client';

export type Source = { readonly kind: 'mission' | 'campaign'; readonly id: string; readonly name: string };
export interface Sample {
  readonly id: number; readonly t_us: number | null; readonly who: string;   ///< the anchor of a range, the place of a sample
  readonly distance_m: number; readonly rx_dbm: number | null; readonly truth_m: number | null; readonly los: boolean | null; readonly has_cir: boolean;
  readonly features: Readonly<Record<string, number>>;
}
export interface Page { readonly samples: readonly Sample[]; readonly next: string | null }
/// Magnitudes of one impulse response, tap by tap.
export interface Impulse { readonly tap_ns: number; readonly first_path: number | null; readonly magnitude: readonly number[] }

const DW1000_TAP_NS = 1.0016;   ///< 1/(2 x 499.2 MHz): the spacing where a response names none
const FEATURE_MAX = 40;

function features_of(v: unknown): Record<string, number> {
  const known = Object.entries(obj(v) ?? {}).filter((e): e is [string, number] => num(e[1]) !== null);
  return Object.fromEntries(known.slice(0, FEATURE_MAX));
}
function range_of(o: Record<string, unknown>): Sample | null {
  const id = num(o.id), distance_m = num(o.distance_m), truth = obj(o.truth), features = features_of(o.features);
  if (id === null || distance_m === null) return null;
  const rx_dbm = num(o.rx_dbm) ?? num(o.rss_dbm);
  return {
    id, t_us: num(o.t_us), who: str(o.anchor), distance_m, rx_dbm, truth_m: num(truth?.distance_m), los: typeof truth?.los === 'boolean' ? truth.los : null,
    has_cir: 'kurtosis' in features || o.has_cir === true, features,
  };
}
function sample_of(o: Record<string, unknown>): Sample | null {
  const id = num(o.id), distance_m = num(o.range_m), truth = obj(o.truth);
  if (id === null || distance_m === null) return null;
  return {
    id, t_us: num(o.t_us), who: str(truth?.environment) || str(truth?.setting), distance_m, rx_dbm: num(o.rx_dbm), truth_m: num(truth?.distance_m),
    los: typeof truth?.los === 'boolean' ? truth.los : null, has_cir: o.has_cir === true, features: features_of(o.features),
  };
}

const PAGE = 1000;
export async function page_of(source: Source, cursor: string | null, anchor: string): Promise<Page> {
  const query = new URLSearchParams({ limit: String(PAGE), features: 'true' });
  if (cursor) query.set('cursor', cursor);
  if (source.kind === 'mission') for (const [k, v] of [['mission', source.id], ['sort', '-t_us']]) query.set(k!, v!);
  if (anchor && source.kind === 'mission') query.set('anchor', anchor);
  const path = source.kind === 'mission' ? '/ranges' : `/campaigns/${encodeURIComponent(source.id)}/samples`;
  const answer = obj(await request('GET', `${path}?${query}`)), items = Array.isArray(answer?.items) ? answer.items : [];
  const read = source.kind === 'mission' ? range_of : sample_of;
  return { samples: items.map(obj).map((o) => o && read(o)).filter((s): s is Sample => s !== null), next: str(answer?.next_cursor) || null };
}
export async function campaigns(): Promise<Source[]> {
  const answer = obj(await request('GET', '/campaigns?limit=200')), items = Array.isArray(answer?.items) ? answer.items : [];
  return items.map(obj).filter((o) => o !== null && str(o.id) !== '').map((o) => ({ kind: 'campaign', id: str(o!.id), name: str(o!.name) }));
}

/// Base64 of int16 pairs re, im, little endian, as the server keeps what the radio gave.
export function impulse_of(answer: unknown): Impulse | null {
  const o = obj(answer), raw = atob(str(o?.b64));
  const bytes = new DataView(Uint8Array.from(raw, (c) => c.charCodeAt(0)).buffer), dt_ps = num(o?.dt_ps);
  const magnitude = Array.from({ length: Math.floor(bytes.byteLength / 4) }, (_, i) => Math.hypot(bytes.getInt16(4 * i, true), bytes.getInt16(4 * i + 2, true)));
  return magnitude.length ? { tap_ns: dt_ps ? dt_ps / 1000 : DW1000_TAP_NS, first_path: num(o?.first_path_idx), magnitude } : null;
}
export async function impulse(source: Source, id: number): Promise<Impulse | null> {
  const of = source.kind === 'mission' ? `/ranges/${id}` : `/campaigns/${encodeURIComponent(source.id)}/samples/${id}`;
  return impulse_of(await request('GET', `${of}/cir`));
}

/// Exactly what is filtered, streamed by the server into a file. A campaign is taken out as the rows of a data set.
export function download_url(source: Source, anchor: string, format: 'csv' | 'ndjson'): string | null {
  if (source.kind !== 'mission') return null;
  return api_url(`/ranges?${new URLSearchParams({ mission: source.id, format, ...(anchor ? { anchor } : {}) })}`);
}
