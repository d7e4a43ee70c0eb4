/// Measurements that a person took out of use, with a reason, and back; the rows stay as they came.
import { call, list, type Wire } from './contract';
import type { Filter } from './measurements';

export type Exclusion = Wire<'Exclusion'>;
export type Kind = Exclusion['kind'];

export const exclusions_of = (mission: string): Promise<Exclusion[]> =>
  list('/missions/{id}/exclusions', { path: { id: mission } });
export const exclude = (mission: string, body: Wire<'ExclusionRequest'>, key: string): Promise<unknown> =>
  call('post', '/missions/{id}/exclusions', { path: { id: mission }, body, headers: { 'Idempotency-Key': key } });
export const include = (mission: string, id: string, key: string): Promise<unknown> =>
  call('post', '/missions/{id}/exclusions/{exclusion}/include', {
    path: { id: mission, exclusion: id },
    headers: { 'Idempotency-Key': key },
  });

export type Selection = Omit<Wire<'ExclusionRequest'>, 'reason'>;
/// The rows that were picked, or the filter's time (and anchor, of ranges). Null while that says nothing: nobody takes a whole flight out by an empty form.
export function selection_of(kind: Kind, ids: readonly number[] | null, filter: Filter): Selection | null {
  if (ids) return kind === 'ranges' && ids.length ? { kind, ids: [...ids] } : null;
  const span: Selection = { kind };
  if (filter.since_us !== null) span.since = filter.since_us;
  if (filter.until_us !== null) span.until = filter.until_us;
  if (kind === 'ranges' && filter.who) span.anchor = filter.who;
  return Object.keys(span).length > 1 ? span : null;
}
const clock = (t: string | number): string =>
  new Date(typeof t === 'number' ? t / 1000 : t).toISOString().slice(11, 23);
/// What an exclusion names, in words: "3 rows", "0x6a21 from 10:11:12.000 to 10:12:00.000".
export function words_of(e: Pick<Exclusion, 'rows' | 'since' | 'until' | 'anchor'>): string {
  const n = e.rows.length;
  if (n) return `${n} ${n === 1 ? 'row' : 'rows'} by name`;
  return [e.anchor, e.since && `from ${clock(e.since)}`, e.until && `to ${clock(e.until)}`].filter(Boolean).join(' ');
}
