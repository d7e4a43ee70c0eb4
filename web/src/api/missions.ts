/// Stored flights: deleting one puts it into a bin, from which it comes back whole.
import { num, obj, str } from '../live/messages';
import { release_control, take_control } from './flight';
import { exchange, idempotency_key, request } from './client';
import { items } from './system';

export interface StoredFlight {
  readonly id: string;
  readonly name: string;
  readonly state: string;
  readonly created_at: string;
  readonly n_ranges: number;
  readonly n_fixes: number;
}
export interface DeletedFlight extends StoredFlight {
  readonly deleted_at: string;
  readonly deleted_by: string;
  readonly kept_for_s: number;
  readonly emptying: boolean;
}
/// Whose rows the devices of the server are; null: it has none, or nothing is known.
export interface Devices {
  readonly recording: boolean;
  readonly held_by: { readonly mission: string; readonly name: string } | null;
}

const path = (id: string, part = ''): string => `/missions/${encodeURIComponent(id)}${part}`;
const flight_of = (o: Record<string, unknown>): StoredFlight => ({
  id: str(o.id),
  name: str(o.name),
  state: str(o.state),
  created_at: str(o.created_at),
  n_ranges: num(o.n_ranges) ?? 0,
  n_fixes: num(o.n_fixes) ?? 0,
});
export const stored_flights = (): Promise<StoredFlight[]> => items('/missions?limit=20', flight_of);
export const deleted_flights = (): Promise<DeletedFlight[]> =>
  items('/missions?deleted=true', (o) => ({
    ...flight_of(o),
    deleted_at: str(o.deleted_at),
    deleted_by: str(o.deleted_by),
    kept_for_s: num(o.kept_for_s) ?? 0,
    emptying: o.emptying === true,
  }));

/// An admin may at once; an operator needs control of the flight, which ends with it.
export async function delete_flight(id: string, admin: boolean): Promise<void> {
  const lease = admin ? '' : (await take_control(id, false)).key;
  try {
    const { etag } = await exchange('GET', path(id));
    await request('DELETE', path(id), undefined, { 'If-Match': etag, ...(lease ? { 'Anchord-Lease': lease } : {}) });
  } catch (e) {
    if (lease) await release_control(id, lease).catch(() => undefined); // what is wrong is told by the first failure
    throw e;
  }
}
export const restore_flight = (id: string): Promise<unknown> =>
  request('POST', path(id, '/restore'), undefined, { 'Idempotency-Key': idempotency_key() });

export async function devices_of(id: string): Promise<Devices | null> {
  const d = obj(obj(await request('GET', path(id)))?.devices),
    held = obj(d?.held_by);
  return (
    d && { recording: d.recording === true, held_by: held && { mission: str(held.mission), name: str(held.name) } }
  );
}
/// From the mission that has them: control of that one is taken for it, and given back.
export async function take_devices(id: string, from: string): Promise<void> {
  const { key } = await take_control(from, false);
  try {
    await request(
      'POST',
      path(id, '/actions'),
      { action: 'take_devices', lease: key },
      { 'Idempotency-Key': idempotency_key() },
    );
  } finally {
    await release_control(from, key).catch(() => undefined); // it ends by itself within a minute
  }
}
