/// Stored ranges and campaign samples, as the Measurements view shows them: one shape for both, truth and features where they are known.
import { num, obj, objects, str, type Unchecked } from '../live/messages';
import type { RangeClass } from '../state/scene';
import { get, given, list, url, type Wire } from './contract';
import type { operations } from './generated/schema';

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

function features_of(v: Unchecked<Wire<'Features'>>): Record<string, number> {
  const known = Object.entries(obj(v) ?? {}).filter((e): e is [string, number] => num(e[1]) !== null);
  return Object.fromEntries(known.slice(0, FEATURE_MAX));
}
function predicted_of(v: Unchecked<Wire<'PredictedClass'>>): Predicted | null {
  const o = obj(v),
    cls = str(o?.class);
  return cls === 'los' || cls === 'nlos' || cls === 'unclear' ? { cls, p_los: num(o?.p_los) } : null;
}
type Row<T> = Exclude<Unchecked<T>, null | undefined>;
function range_of(o: Row<Wire<'Range'>>): Sample | null {
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
    has_cir: 'kurtosis' in features,
    features,
    predicted: predicted_of(o.predicted),
  };
}
function sample_of(o: Row<Wire<'CampaignSample'>>): Sample | null {
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

type RangesQuery = NonNullable<operations['listRanges']['parameters']['query']>;
type SamplesQuery = NonNullable<operations['listCampaignSamples']['parameters']['query']>;
type Paging = Pick<RangesQuery & SamplesQuery, 'limit' | 'features' | 'predicted' | 'every' | 'cursor'>;
type Common = Pick<
  RangesQuery & SamplesQuery,
  'label' | 'class' | 'min_distance_m' | 'max_distance_m' | 'min_level_dbm' | 'max_level_dbm'
>;
/// What both kinds of source know.
const common = (f: Filter): Common =>
  given<Common>({
    label: f.label,
    class: f.cls,
    min_distance_m: f.min_m,
    max_distance_m: f.max_m,
    min_level_dbm: f.min_dbm,
    max_level_dbm: f.max_dbm,
  });
/// A filter as the server's query. Time and fix are of flights only: a campaign is of places.
export const ranges_query = (mission: string, f: Filter): RangesQuery =>
  given<RangesQuery>({
    mission,
    since: f.since_us === null ? null : String(f.since_us),
    until: f.until_us === null ? null : String(f.until_us),
    fix: f.fix,
    anchor: f.who,
    ...common(f),
  });
export const samples_query = (f: Filter): SamplesQuery =>
  given<SamplesQuery>({
    environment: f.by === 'environment' ? f.who : '',
    setting: f.by === 'setting' ? f.who : '',
    ...common(f),
  });

export interface Wanted {
  readonly limit: number;
  readonly cursor: string | null;
  readonly oldest_first: boolean;
  readonly every: number;
}
export async function page_of(source: Source, filter: Filter, w: Wanted): Promise<Page> {
  const more = given<Paging>({
    limit: w.limit,
    features: true,
    predicted: true,
    every: w.every > 1 ? w.every : null,
    cursor: w.cursor,
  });
  const pick = <T>(rows: readonly T[], read: (o: Row<T>) => Sample | null): Sample[] =>
    objects<Unchecked<T>>(rows as readonly Unchecked<T>[])
      .map((o) => read(o as Row<T>))
      .filter((s) => s !== null);
  if (source.kind === 'mission') {
    const sort = w.oldest_first ? {} : ({ sort: '-t_us' } as const),
      page = await get('/ranges', { query: { ...ranges_query(source.id, filter), ...more, ...sort } });
    return { samples: pick(page.items, range_of), next: page.next_cursor || null };
  }
  const page = await get('/campaigns/{id}/samples', {
    path: { id: source.id },
    query: { ...samples_query(filter), ...more },
  });
  return { samples: pick(page.items, sample_of), next: page.next_cursor || null };
}
/// Rows of a flight that pass what is stored; the class by the models is not, and campaigns are not counted.
export async function count_of(source: Source, filter: Filter): Promise<number | null> {
  if (source.kind !== 'mission') return null;
  const query = { ...ranges_query(source.id, { ...filter, cls: '' }), count: 'exact', limit: 1 } as const;
  return num((await get('/ranges', { query })).total);
}
export const campaigns = async (): Promise<Source[]> =>
  objects(await list('/campaigns', { query: { limit: 200 } }))
    .filter((o) => str(o.id) !== '')
    .map(({ id, name }) => ({ kind: 'campaign', id, name }));

/// Base64 of int16 pairs re, im, little endian, as the server keeps what the radio gave.
export function impulse_of(answer: Unchecked<Wire<'Cir'>>): Impulse | null {
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
export const impulse = async (source: Source, id: number): Promise<Impulse | null> =>
  impulse_of(
    source.kind === 'mission'
      ? await get('/ranges/{id}/cir', { path: { id } })
      : await get('/campaigns/{id}/samples/{sample}/cir', { path: { id: source.id, sample: id } }),
  );

/// Exactly what is filtered, streamed by the server into a file.
export const download_url = (source: Source, filter: Filter, format: 'csv' | 'ndjson'): string =>
  source.kind === 'mission'
    ? url('/ranges', { query: { ...ranges_query(source.id, filter), format } })
    : url('/campaigns/{id}/samples', { path: { id: source.id }, query: { ...samples_query(filter), format } });
