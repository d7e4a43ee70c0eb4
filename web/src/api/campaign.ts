/// Labelling in the field: the ranges of one anchor as they are stored, and their import into a campaign.
import { num, obj, str } from '../live/messages';
import { request } from './client';

type Row = Readonly<Record<string, unknown>>;
const items_of = (answer: unknown): Row[] => {
  const items = obj(answer)?.items;
  return (Array.isArray(items) ? items : []).map(obj).filter((o) => o !== null);
};
const ranges = async (mission: string, anchor: string, more: Record<string, string>): Promise<Row[]> =>
  items_of(await request('GET', `/ranges?${new URLSearchParams({ mission, anchor, ...more })}`));

/// Measured time of the newest stored range; 0 where there is none.
export const newest_us = async (mission: string, anchor: string): Promise<number> =>
  num((await ranges(mission, anchor, { sort: '-t_us', limit: '1' }))[0]?.t_us) ?? 0;
/// The first `limit` ranges measured after a time.
export const ranges_after = (
  mission: string,
  anchor: string,
  after_us: number,
  limit: number,
  with_cir: boolean,
): Promise<Row[]> =>
  ranges(mission, anchor, {
    since: String(after_us + 1),
    sort: 't_us',
    limit: String(limit),
    ...(with_cir ? { cir: 'true' } : {}),
  });

export interface Setting {
  readonly setting: string;
  readonly environment: string;
  readonly distance_m: number | null;
  readonly los: boolean | null;
  readonly n: number;
  readonly mean_m: number | null;
  readonly sd_m: number | null;
}
export async function settings_of(campaign: string): Promise<Setting[]> {
  const list = obj(await request('GET', `/campaigns/${encodeURIComponent(campaign)}`))?.settings;
  return (Array.isArray(list) ? list : [])
    .map(obj)
    .filter((o) => o !== null)
    .map((o) => ({
      setting: str(o.setting),
      environment: str(o.environment),
      distance_m: num(o.distance_m),
      los: typeof o.los === 'boolean' ? o.los : null,
      n: num(o.n_samples) ?? 0,
      mean_m: num(o.mean_range_m),
      sd_m: num(o.sd_range_m),
    }));
}
export const make_campaign = (name: string, key: string): Promise<unknown> =>
  request('POST', '/campaigns', { name }, { 'Idempotency-Key': key });

export interface Imported {
  readonly accepted: number;
  readonly read: number;
  readonly dropped: readonly string[];
}
export async function import_lines(
  campaign: string,
  truth: URLSearchParams,
  lines: string,
  key: string,
): Promise<Imported> {
  const o = obj(
      await request('POST', `/campaigns/${encodeURIComponent(campaign)}/samples?${truth}`, lines, {
        'Content-Type': 'application/x-ndjson',
        'Idempotency-Key': key,
      }),
    ),
    dropped = Array.isArray(o?.dropped) ? o.dropped : [];
  return {
    accepted: num(o?.accepted) ?? 0,
    read: num(o?.read) ?? 0,
    dropped: dropped.map(obj).map((d) => `${num(d?.count) ?? 0} ${str(d?.reason)}`),
  };
}
