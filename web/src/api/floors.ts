/// Buildings, floors and their plans.
import { idempotency_key } from './client';
import { call, get, list, url, type Wire } from './contract';

export type Floor = Wire<'Floor'>;
export type Georeference = Wire<'FloorPlanGeoreference'>;
export type Trace = Wire<'FloorPlanTrace'>;
export type Material = Wire<'FloorWalls'>['walls'][number]['material'];
export const MATERIALS: readonly Material[] = ['unknown', 'brick', 'concrete', 'glass', 'plasterboard', 'metal'];

/// A point of the plan and the place it is.
export interface Click {
  readonly pixel: readonly [number, number];
  readonly lon: number;
  readonly lat: number;
}
export interface Held {
  readonly floor: Floor;
  readonly etag: string;
}

export const floors = (): Promise<Floor[]> => list('/floors', { query: { limit: 1000 } });
export const buildings = (): Promise<Wire<'Building'>[]> => list('/buildings', { query: { limit: 1000 } });
const made = (): Record<string, string> => ({ 'Idempotency-Key': idempotency_key() });
/// A floor in the building of this name, which is made where the site has none.
export async function create_floor(site: string, building: string, name: string, level: number): Promise<Held> {
  const there = (await buildings()).find((b) => b.site === site && b.name === building),
    home = there ?? (await call('post', '/buildings', { body: { site, name: building }, headers: made() })).body,
    { body, etag } = await call('post', '/floors', { body: { building: home.id, name, level }, headers: made() });
  return { floor: body, etag };
}
export async function floor(id: string): Promise<Held> {
  const { body, etag } = await call('get', '/floors/{id}', { path: { id } });
  return { floor: body, etag };
}
export async function send_plan(held: Held, file: Blob): Promise<Held> {
  const { body, etag } = await call('put', '/floors/{id}/plan', {
    path: { id: held.floor.id },
    file: { type: 'application/octet-stream', data: file },
    headers: { 'If-Match': held.etag },
  });
  return { floor: body, etag };
}
export const preview_url = (floor: string): string => url('/floors/{id}/plan/preview', { path: { id: floor } });
/// `keep` false: only what the residuals would be. `length_m`: between the first two points, as measured.
export async function georeference(
  held: Held,
  points: readonly Click[],
  length_m: number | null,
  keep: boolean,
): Promise<Held> {
  const pixel = (k: number): [number, number] => [points[k]!.pixel[0], points[k]!.pixel[1]];
  const { body, etag } = await call('put', '/floors/{id}/plan/georeference', {
    path: { id: held.floor.id },
    query: keep ? {} : { dry_run: true },
    body: {
      model: 'helmert',
      points: points.map((p, k) => ({ pixel: pixel(k), lon: p.lon, lat: p.lat })),
      ...(length_m === null || points.length < 2
        ? {}
        : { known_length: { from_px: pixel(0), to_px: pixel(1), length_m } }),
    },
    headers: { 'If-Match': held.etag },
  });
  return { floor: body, etag };
}
export async function trace(held: Held): Promise<Trace> {
  await call('post', '/floors/{id}/plan/trace', {
    path: { id: held.floor.id },
    headers: { Prefer: 'wait=120', ...made() },
  });
  return get('/floors/{id}/plan/trace', { path: { id: held.floor.id } });
}
export async function accept_trace(held: Held, material: Material): Promise<void> {
  const { etag } = await floor(held.floor.id); // the trace made it another version
  await call('put', '/floors/{id}/walls', {
    path: { id: held.floor.id },
    body: { from_trace: true, material, site_outline: false },
    headers: { 'If-Match': etag },
  });
}
