/// Labelling in the field: the ranges of one anchor as they are stored, and their import into a campaign.
import { request } from './client';
import { call, get, list, type Wire } from './contract';

type Row = Wire<'Range'>;
/// Measured time of the newest stored range; 0 where there is none.
export const newest_us = async (mission: string, anchor: string): Promise<number> =>
  (await list('/ranges', { query: { mission, anchor, sort: '-t_us', limit: 1 } }))[0]?.t_us ?? 0;
/// The first `limit` ranges measured after a time.
export const ranges_after = (
  mission: string,
  anchor: string,
  after_us: number,
  limit: number,
  with_cir: boolean,
): Promise<Row[]> =>
  list('/ranges', {
    query: { mission, anchor, since: String(after_us + 1), sort: 't_us', limit, ...(with_cir ? { cir: true } : {}) },
  });

export type Setting = NonNullable<Wire<'Campaign'>['settings']>[number];
export const settings_of = async (campaign: string): Promise<Setting[]> =>
  (await get('/campaigns/{id}', { path: { id: campaign } })).settings ?? [];
export const make_campaign = (name: string, key: string): Promise<unknown> =>
  call('post', '/campaigns', { body: { name }, headers: { 'Idempotency-Key': key } });

export type Imported = Wire<'CampaignImport'>;
/// Lines are not the JSON that the typed calls send.
export const import_lines = async (
  campaign: string,
  truth: URLSearchParams,
  lines: string,
  key: string,
): Promise<Imported> =>
  (await request('POST', `/campaigns/${encodeURIComponent(campaign)}/samples?${truth}`, lines, {
    'Content-Type': 'application/x-ndjson',
    'Idempotency-Key': key,
  })) as Imported;
