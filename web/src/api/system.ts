/// The server itself: who may use it, what was done, and how it fares.
import { drone, type DroneMsg } from '../live/flight_messages';
import { num, obj, str } from '../live/messages';
import { idempotency_key, request } from './client';

export interface Token {
  readonly id: string;
  readonly name: string;
  readonly roles: readonly string[];
  readonly created_at: string;
  readonly expires_at: string | null;
  readonly revoked_at: string | null;
  readonly last_used_at: string | null;
}
export interface AuditLine {
  readonly at: string;
  readonly who: string;
  readonly what: string;
  readonly result: string;
}
export interface Version {
  readonly version: string;
  readonly git: string;
  readonly schema: number | null;
  readonly build: string;
}
export interface Check {
  readonly name: string;
  readonly ok: boolean;
  readonly text: string;
}

export const ROLES = ['viewer', 'integrator', 'gateway', 'engineer', 'operator', 'admin'] as const;

const words = (v: unknown): string[] => (Array.isArray(v) ? v.filter((x): x is string => typeof x === 'string') : []);
export async function items<T>(path: string, of: (o: Record<string, unknown>) => T): Promise<T[]> {
  const answer = obj(await request('GET', path));
  return (Array.isArray(answer?.items) ? answer.items : [])
    .map(obj)
    .filter((o) => o !== null)
    .map((o) => of(o));
}

export const tokens = (): Promise<Token[]> =>
  items('/tokens', (o) => ({
    id: str(o.id),
    name: str(o.name),
    roles: words(o.roles),
    created_at: str(o.created_at),
    expires_at: str(o.expires_at) || null,
    revoked_at: str(o.revoked_at) || null,
    last_used_at: str(o.last_used_at) || null,
  }));
/// The secret is in this answer and nowhere else.
export async function create_token(name: string, role: string): Promise<string> {
  return str(
    obj(await request('POST', '/tokens', { name, roles: [role] }, { 'Idempotency-Key': idempotency_key() }))?.token,
  );
}
export const revoke_token = (id: string): Promise<unknown> => request('DELETE', `/tokens/${id}`);
export const audit = (): Promise<AuditLine[]> =>
  items('/audit?limit=100', (o) => ({ at: str(o.at), who: str(o.who), what: str(o.what), result: str(o.result) }));

/// Outside /api/v1: answers of the program, not of its data.
async function plain(path: string): Promise<Record<string, unknown> | null> {
  const answer = await fetch(new URL(path, document.baseURI.split('#')[0]), {
    credentials: 'same-origin',
    cache: 'no-cache',
  });
  return obj(await answer.json());
}
export async function version(): Promise<Version> {
  const o = await plain('version');
  return { version: str(o?.version), git: str(o?.git), schema: num(o?.schema), build: str(o?.build) };
}
/// Whose clock stamps what devices say, and the aircraft; null where this server has none.
export interface ServerClock {
  readonly from_receiver: boolean;
  readonly offset_s: number | null;
  readonly sigma_s: number | null;
  readonly skew: string;
}
export async function clock_and_drone(): Promise<{
  readonly clock: ServerClock | null;
  readonly drone: DroneMsg | null;
}> {
  const o = obj(await request('GET', '/system')),
    clock = obj(o?.clock);
  return {
    clock: clock && {
      from_receiver: clock.source === 'receiver',
      offset_s: num(clock.system_offset_s),
      sigma_s: num(clock.sigma_s),
      skew: str(clock.skew),
    },
    drone: drone(o?.drone),
  };
}
export async function checks(): Promise<Check[]> {
  const o = await plain('readyz');
  return Object.entries(obj(o?.checks) ?? {}).map(([name, v]) => ({
    name,
    ok: v === 'ok' || v === true || str(obj(v)?.status) === 'ok',
    text: typeof v === 'string' ? v : str(obj(v)?.detail) || str(obj(v)?.status),
  }));
}
