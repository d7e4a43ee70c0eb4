/// What facility tools know of an anchor beside its place: whose it is, where people look for it, and its names elsewhere.
import { call, type Wire } from './contract';

type Properties = Wire<'Anchor'>['properties'];
type Known = 'name' | 'building' | 'floor' | 'space' | 'asset_tag' | 'ifc_guid' | 'external_ids';
export type Fields = Required<Pick<Properties, Known>>;
export interface Facility {
  readonly etag: string;
  readonly fields: Fields;
}

export const fields_of = ({ properties: p }: Pick<Wire<'Anchor'>, 'properties'>): Fields => ({
  name: p.name,
  building: p.building ?? '',
  floor: p.floor ?? '',
  space: p.space ?? '',
  asset_tag: p.asset_tag ?? '',
  ifc_guid: p.ifc_guid ?? '',
  external_ids: p.external_ids ?? [],
});
/// Only what differs, as a merge-patch: an emptied field is cleared by null, and what somebody else filled in meanwhile stays.
export function patch_of(was: Fields, now: Fields): Wire<'AnchorPatch'> {
  const trimmed: Fields = {
      ...now,
      external_ids: now.external_ids
        .map((e) => ({ system: e.system.trim(), id: e.id.trim() }))
        .filter((e) => e.system || e.id),
    },
    out: Wire<'AnchorPatch'> = {};
  for (const key of ['name', 'building', 'floor', 'space', 'asset_tag', 'ifc_guid'] as const) {
    const v = trimmed[key].trim();
    if (v !== was[key]) out[key] = v || null;
  }
  if (JSON.stringify(trimmed.external_ids) !== JSON.stringify(was.external_ids))
    out.external_ids = trimmed.external_ids.length ? trimmed.external_ids : null;
  return out;
}
export async function facility(anchor: string): Promise<Facility> {
  const { body, etag } = await call('get', '/anchors/{id}', { path: { id: anchor } });
  return { etag, fields: fields_of(body) };
}
export async function change_facility(anchor: string, etag: string, patch: Wire<'AnchorPatch'>): Promise<Facility> {
  const answer = await call('patch', '/anchors/{id}', {
    path: { id: anchor },
    body: patch,
    headers: { 'If-Match': etag, 'Content-Type': 'application/merge-patch+json' },
  });
  return { etag: answer.etag, fields: fields_of(answer.body) };
}
