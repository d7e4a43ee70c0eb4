/// Labelling in the field: the ranges of one anchor as they are stored, and their import into a campaign.
import { call, get, given, list, type Wire } from './contract';
import type { operations } from './generated/schema';

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
    query: given({ mission, anchor, since: String(after_us + 1), sort: 't_us', limit, cir: with_cir || null }),
  });

export type Setting = NonNullable<Wire<'Campaign'>['settings']>[number];
export const settings_of = async (campaign: string): Promise<Setting[]> =>
  (await get('/campaigns/{id}', { path: { id: campaign } })).settings ?? [];
export const make_campaign = (name: string, key: string): Promise<unknown> =>
  call('post', '/campaigns', { body: { name }, headers: { 'Idempotency-Key': key } });

export type Imported = Wire<'CampaignImport'>;
/// What is true of every row that an import brings, beside the rows.
export type TruthOfRows = NonNullable<operations['importCampaignSamples']['parameters']['query']>;
export const import_lines = async (
  campaign: string,
  truth: TruthOfRows,
  lines: string,
  key: string,
): Promise<Imported> =>
  (
    await call('post', '/campaigns/{id}/samples', {
      path: { id: campaign },
      query: truth,
      file: { type: 'application/x-ndjson', data: lines },
      headers: { 'Idempotency-Key': key },
    })
  ).body;
