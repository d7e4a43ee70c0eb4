/// The server itself: who may use it, what was done, and how it fares.
import { drone, type DroneMsg } from '../live/flight_messages';
import { obj, str } from '../live/messages';
import { idempotency_key } from './client';
import { call, get, list, type Wire } from './contract';

export type Token = Wire<'Token'>;
export type AuditLine = Wire<'Audit'>;
export type Version = Wire<'Version'>;
export interface Check {
  readonly name: string;
  readonly ok: boolean;
  readonly text: string;
}

export const ROLES = ['viewer', 'integrator', 'gateway', 'engineer', 'operator', 'admin'] as const;
export type Role = (typeof ROLES)[number];

export const tokens = (): Promise<Token[]> => list('/tokens');
/// The secret is in this answer and nowhere else.
export async function create_token(name: string, role: Role): Promise<string> {
  const headers = { 'Idempotency-Key': idempotency_key() };
  return (await call('post', '/tokens', { body: { name, roles: [role] }, headers })).body.token ?? '';
}
export const revoke_token = (id: string): Promise<unknown> => call('delete', '/tokens/{id}', { path: { id } });
export const audit = (): Promise<AuditLine[]> => list('/audit', { query: { limit: 100 } });

/// Outside /api/v1: answers of the program, not of its data.
async function plain(path: string): Promise<unknown> {
  const answer = await fetch(new URL(path, document.baseURI.split('#')[0]), {
    credentials: 'same-origin',
    cache: 'no-cache',
  });
  return answer.json();
}
export const version = async (): Promise<Version> => (await plain('version')) as Version;
/// Whose clock stamps what devices say, and the aircraft; null where this server has none.
export type ServerClock = NonNullable<Wire<'System'>['clock']>;
export async function clock_and_drone(): Promise<{
  readonly clock: ServerClock | null;
  readonly drone: DroneMsg | null;
}> {
  const system = await get('/system');
  return { clock: system.clock ?? null, drone: drone(system.drone) };
}
export async function checks(): Promise<Check[]> {
  const o = obj(await plain('readyz'));
  return Object.entries(obj(o?.checks) ?? {}).map(([name, v]) => ({
    name,
    ok: v === 'ok' || v === true || str(obj(v)?.status) === 'ok',
    text: typeof v === 'string' ? v : str(obj(v)?.detail) || str(obj(v)?.status),
  }));
}
