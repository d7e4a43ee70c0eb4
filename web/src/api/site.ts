/// What positions rest on: sites with the datum, the epoch and the base of their coordinates, lever arms of flights, and what kits have learned.
import { idempotency_key } from './client';
import { call, get, list, type Wire } from './contract';

/// With the origin of the contract, and what its coordinate system says of the base.
export interface Site extends Datum {
  readonly id: string;
  readonly name: string;
  readonly origin: Wire<'Site'>['origin'];
}
export type Flight = Wire<'Mission'>;
export type Kit = Wire<'KitProfile'>;
export type BaseSource = '' | 'known_point' | 'survey_in' | 'network';
export interface Datum {
  readonly frame: string;
  readonly epoch: number | null;
  readonly source: BaseSource;
  readonly sigma_m: number | null;
  /// Of the map that drawings and survey files are in; null: none.
  readonly projected_epsg: number | null;
}

export function site_of({ id, name, origin, crs, projected_epsg }: Wire<'Site'>): Site {
  const { frame, epoch, base } = crs,
    known = (['known_point', 'survey_in', 'network'] as const).find((s) => s === base?.source);
  return {
    id,
    name,
    origin,
    frame: frame ?? '',
    epoch: epoch ?? null,
    source: known ?? '',
    sigma_m: base?.sigma_m ?? null,
    projected_epsg: projected_epsg ?? null,
  };
}
export const sites = async (): Promise<Site[]> => (await list('/sites', { query: { limit: 100 } })).map(site_of);
/// Only what is known: an empty field stays unknown, never a guess.
const crs_of = (d: Datum): NonNullable<Wire<'SiteWrite'>['crs']> => ({
  ...(d.frame ? { frame: d.frame } : {}),
  ...(d.epoch === null ? {} : { epoch: d.epoch }),
  base: { ...(d.source ? { source: d.source } : {}), ...(d.sigma_m === null ? {} : { sigma_m: d.sigma_m }) },
});
export async function change_site(id: string, d: Datum): Promise<void> {
  const { etag } = await call('get', '/sites/{id}', { path: { id } });
  await call('patch', '/sites/{id}', {
    path: { id },
    body: { crs: crs_of(d), projected_epsg: d.projected_epsg },
    headers: { 'If-Match': etag, 'Content-Type': 'application/merge-patch+json' },
  });
}
export const create_site = (name: string, d: Datum): Promise<unknown> =>
  call('post', '/sites', {
    body: { name, crs: crs_of(d), ...(d.projected_epsg === null ? {} : { projected_epsg: d.projected_epsg }) },
    headers: { 'Idempotency-Key': idempotency_key() },
  });

/// The newest flights, newest first.
export const flights = (): Promise<Flight[]> => list('/missions', { query: { limit: 5 } });
/// What the kit of the newest flight has learned; null where it has learned nothing yet: a profile comes with the first calibration of a kit's flights.
export async function kit_of(newest: readonly Flight[]): Promise<Kit | null> {
  const kit = newest.find((f) => f.kit)?.kit;
  if (!kit) return null;
  const solved = (await list('/calibrations', { query: { limit: 50, fields: 'id,missions' } })).flatMap(
    (c) => c.missions,
  );
  if (!newest.some((f) => f.kit === kit && solved.includes(f.id))) return null;
  return get('/devices/{id}/profile', { path: { id: kit } });
}
