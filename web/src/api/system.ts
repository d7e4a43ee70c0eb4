/// The server itself: who may use it, what was done, and how it fares.
import { drone, type DroneMsg } from '../live/flight_messages';
import type { Topic } from '../live/stream';
import { idempotency_key } from './client';
import { call, get, given, list, of_program, type Wire } from './contract';

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
/// The secret is in this answer and nowhere else. organization: the only sites it sees; null: every site.
export async function create_token(name: string, role: Role, organization: string | null): Promise<string> {
  const headers = { 'Idempotency-Key': idempotency_key() },
    body = { name, roles: [role], ...given<{ organization?: string }>({ organization }) };
  return (await call('post', '/tokens', { body, headers })).body.token ?? '';
}
export const revoke_token = (id: string): Promise<unknown> => call('delete', '/tokens/{id}', { path: { id } });
export const audit = (): Promise<AuditLine[]> => list('/audit', { query: { limit: 100 } });

export const version = (): Promise<Version> => of_program('/version');
/// Whose clock stamps what devices say, and the aircraft; null where this server has none.
export type ServerClock = NonNullable<Wire<'System'>['clock']>;
export async function clock_and_drone(): Promise<{
  readonly clock: ServerClock | null;
  readonly drone: DroneMsg | null;
}> {
  const system = await get('/system');
  const said: Topic<'procedure'>['drone'] = system.drone ?? null; // as the stream says it
  return { clock: system.clock ?? null, drone: drone(said) };
}
export const checks = async (): Promise<Check[]> =>
  Object.entries((await of_program('/readyz')).checks ?? {}).map(([name, text]) => ({ name, ok: text === 'ok', text }));
