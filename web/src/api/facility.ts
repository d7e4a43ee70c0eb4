/// What facility tools know of an anchor beside its place: whose it is, where people look for it, and its names elsewhere.
import { obj, str } from '../live/messages';
import { exchange } from './client';

export interface ExternalId {
  readonly system: string;
  readonly id: string;
}
export interface Fields {
  readonly name: string;
  readonly building: string;
  readonly floor: string;
  readonly space: string;
  readonly asset_tag: string;
  readonly ifc_guid: string;
  readonly external_ids: readonly ExternalId[];
}
export interface Facility {
  readonly etag: string;
  readonly fields: Fields;
}

export function fields_of(feature: unknown): Fields {
  const p = obj(obj(feature)?.properties),
    ids = Array.isArray(p?.external_ids) ? p.external_ids : [];
  return {
    name: str(p?.name),
    building: str(p?.building),
    floor: str(p?.floor),
    space: str(p?.space),
    asset_tag: str(p?.asset_tag),
    ifc_guid: str(p?.ifc_guid),
    external_ids: ids
      .map(obj)
      .filter((o) => o !== null)
      .map((o) => ({ system: str(o.system), id: str(o.id) })),
  };
}
/// Only what differs, as a merge-patch: an emptied field is cleared by null, and what somebody else filled in meanwhile stays.
export function patch_of(was: Fields, now: Fields): Record<string, unknown> {
  const trimmed: Fields = {
      ...now,
      external_ids: now.external_ids
        .map((e) => ({ system: e.system.trim(), id: e.id.trim() }))
        .filter((e) => e.system || e.id),
    },
    out: Record<string, unknown> = {};
  for (const key of ['name', 'building', 'floor', 'space', 'asset_tag', 'ifc_guid'] as const) {
    const v = trimmed[key].trim();
    if (v !== was[key]) out[key] = v || null;
  }
  if (JSON.stringify(trimmed.external_ids) !== JSON.stringify(was.external_ids))
    out.external_ids = trimmed.external_ids.length ? trimmed.external_ids : null;
  return out;
}
const at = (anchor: string): string => `/anchors/${encodeURIComponent(anchor)}`;
export async function facility(anchor: string): Promise<Facility> {
  const { body, etag } = await exchange('GET', at(anchor));
  return { etag, fields: fields_of(body) };
}
export async function change_facility(anchor: string, etag: string, patch: Record<string, unknown>): Promise<Facility> {
  const answer = await exchange('PATCH', at(anchor), patch, {
    'If-Match': etag,
    'Content-Type': 'application/merge-patch+json',
  });
  return { etag: answer.etag, fields: fields_of(answer.body) };
}
