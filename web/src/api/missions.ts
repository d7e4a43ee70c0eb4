/// Stored flights: deleting one puts it into a bin, from which it comes back whole.
import { idempotency_key } from './client';
import { call, get, list, url, type Wire } from './contract';
import { release_control, take_control } from './flight';

export type StoredFlight = Wire<'Mission'>;
/// Whose rows the devices of the server are; null: it has none, or nothing is known.
export type Devices = NonNullable<StoredFlight['devices']>;

const at = (id: string): { readonly path: { readonly id: string } } => ({ path: { id } });
export const stored_flights = (): Promise<StoredFlight[]> => list('/missions', { query: { limit: 20 } });
export const deleted_flights = (): Promise<StoredFlight[]> => list('/missions', { query: { deleted: true } });

/// An admin may at once; an operator needs control of the flight, which ends with it.
export async function delete_flight(id: string, admin: boolean): Promise<void> {
  const lease = admin ? '' : (await take_control(id, false)).key;
  try {
    const { etag } = await call('get', '/missions/{id}', at(id)),
      headers = { 'If-Match': etag, ...(lease ? { 'Anchord-Lease': lease } : {}) };
    await call('delete', '/missions/{id}', { ...at(id), headers });
  } catch (e) {
    if (lease) await release_control(id, lease).catch(() => undefined); // what is wrong is told by the first failure
    throw e;
  }
}
/// It records from now on, with the devices of the server where no other flight has them. Its id.
export const begin_flight = async (body: Wire<'MissionCreate'>): Promise<string> =>
  (await call('post', '/missions', { body, headers: { 'Idempotency-Key': idempotency_key() } })).body.id;
/// Ends its recording; in the air only whoever has control of it may.
export const finish_flight = (id: string, lease: string | null): Promise<unknown> =>
  call('post', '/missions/{id}/actions', {
    ...at(id),
    body: { action: 'finish', ...(lease === null ? {} : { lease }) },
    headers: { 'Idempotency-Key': idempotency_key() },
  });
export type Correction = Wire<'MissionCorrection'>;
/// Of what was declared when it began. What the body leaves out stays, whoever corrected it meanwhile.
export async function correct_flight(id: string, body: Correction): Promise<void> {
  const { etag } = await call('get', '/missions/{id}', at(id));
  await call('patch', '/missions/{id}', { ...at(id), body, headers: { 'If-Match': etag } });
}
export const restore_flight = (id: string): Promise<unknown> =>
  call('post', '/missions/{id}/restore', { ...at(id), headers: { 'Idempotency-Key': idempotency_key() } });

/// What is handed over after a flight, in one signed zip file, which the server names: the bundle, the report and the published anchors.
export const handover_url = (id: string): string => url('/missions/{id}/handover', at(id));

export const devices_of = async (id: string): Promise<Devices | null> =>
  (await get('/missions/{id}', at(id))).devices ?? null;
/// How long its flight took beside the forecast; null where none has ended.
export const flight_time_of = async (id: string): Promise<Wire<'FlightTime'> | null> =>
  (await get('/missions/{id}', at(id))).flight_time ?? null;
/// From the mission that has them: control of that one is taken for it, and given back.
export async function take_devices(id: string, from: string): Promise<void> {
  const { key } = await take_control(from, false);
  try {
    await call('post', '/missions/{id}/actions', {
      ...at(id),
      body: { action: 'take_devices', lease: key },
      headers: { 'Idempotency-Key': idempotency_key() },
    });
  } finally {
    await release_control(from, key).catch(() => undefined); // it ends by itself within a minute
  }
}
