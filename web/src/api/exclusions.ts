/// Measurements that a person took out of use, with a reason, and back; the rows stay as they came.
import { num, obj, str } from '../live/messages';
import { request } from './client';
import type { Filter } from './measurements';

export type Kind = 'ranges' | 'fixes';
export interface Exclusion {
  readonly id: string;
  readonly kind: Kind;
  readonly n_named: number;
  readonly since: string;
  readonly until: string;
  readonly anchor: string;
  readonly n_rows: number;
  readonly reason: string;
  readonly by: string;
  readonly at: string;
  readonly included: { readonly by: string; readonly at: string } | null;
}

export function exclusion_of(v: unknown): Exclusion | null {
  const o = obj(v),
    id = str(o?.id),
    back = obj(o?.included);
  if (!o || !id) return null;
  return {
    id,
    kind: str(o.kind) === 'fixes' ? 'fixes' : 'ranges',
    n_named: Array.isArray(o.rows) ? o.rows.length : 0,
    since: str(o.since),
    until: str(o.until),
    anchor: str(o.anchor),
    n_rows: num(o.n_rows) ?? 0,
    reason: str(o.reason),
    by: str(o.by),
    at: str(o.created_at),
    included: back && { by: str(back.by), at: str(back.at) },
  };
}
const path = (mission: string): string => `/missions/${encodeURIComponent(mission)}/exclusions`;
export async function exclusions_of(mission: string): Promise<Exclusion[]> {
  const items = obj(await request('GET', path(mission)))?.items;
  return (Array.isArray(items) ? items : []).map(exclusion_of).filter((e) => e !== null);
}
export const exclude = (mission: string, body: Readonly<Record<string, unknown>>, key: string): Promise<unknown> =>
  request('POST', path(mission), body, { 'Idempotency-Key': key });
export const include = (mission: string, id: string, key: string): Promise<unknown> =>
  request('POST', `${path(mission)}/${encodeURIComponent(id)}/include`, {}, { 'Idempotency-Key': key });

/// The rows that were picked, or the filter's time (and anchor, of ranges). Null while that says nothing: nobody takes a whole flight out by an empty form.
export function selection_of(
  kind: Kind,
  ids: readonly number[] | null,
  filter: Filter,
): Record<string, unknown> | null {
  if (ids) return kind === 'ranges' && ids.length ? { kind, ids } : null;
  const span: Record<string, unknown> = { kind };
  if (filter.since_us !== null) span.since = filter.since_us;
  if (filter.until_us !== null) span.until = filter.until_us;
  if (kind === 'ranges' && filter.who) span.anchor = filter.who;
  return Object.keys(span).length > 1 ? span : null;
}
const clock = (t: string | number): string =>
  new Date(typeof t === 'number' ? t / 1000 : t).toISOString().slice(11, 23);
/// What an exclusion names, in words: "3 rows", "0x6a21 from 10:11:12.000 to 10:12:00.000".
export function words_of(e: Pick<Exclusion, 'n_named' | 'since' | 'until' | 'anchor'>): string {
  if (e.n_named) return `${e.n_named} ${e.n_named === 1 ? 'row' : 'rows'} by name`;
  return [e.anchor, e.since && `from ${clock(e.since)}`, e.until && `to ${clock(e.until)}`].filter(Boolean).join(' ');
}
