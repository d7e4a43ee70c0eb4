/// The server itself: devices it drives, who may use it, what was done, and how it fares.
import { num, obj, str } from '../live/messages';
import { idempotency_key, request } from './client';

export interface Device {
  readonly id: string | null;   ///< null: a radio that was only heard
  readonly kind: string; readonly name: string; readonly network_id: string | null; readonly address: string; readonly enabled: boolean;
  readonly state: string | null; readonly reason: string; readonly conflict: string; readonly last_seen_us: number | null; readonly rate_hz: number | null;
  readonly firmware: string; readonly model: string; readonly serial: string;
  readonly counters: Readonly<Record<string, number>>; readonly dropped: Readonly<Record<string, number>>;
}
export interface Found { readonly address: string; readonly kind: string | null; readonly evidence: string; readonly configured: boolean }
export interface Token { readonly id: string; readonly name: string; readonly roles: readonly string[]; readonly created_at: string; readonly expires_at: string | null; readonly revoked_at: string | null; readonly last_used_at: string | null }
export interface AuditLine { readonly at: string; readonly who: string; readonly what: string; readonly result: string }
export interface Version { readonly version: string; readonly git: string; readonly schema: number | null; readonly build: string }
export interface Check { readonly name: string; readonly ok: boolean; readonly text: string }

export const ROLES = ['viewer', 'integrator', 'gateway', 'engineer', 'operator', 'admin'] as const;

const numbers = (v: unknown): Record<string, number> => Object.fromEntries(Object.entries(obj(v) ?? {}).filter((e): e is [string, number] => num(e[1]) !== null));
const words = (v: unknown): string[] => (Array.isArray(v) ? v.filter((x): x is string => typeof x === 'string') : []);
async function items<T>(path: string, of: (o: Record<string, unknown>) => T): Promise<T[]> {
  const answer = obj(await request('GET', path));
  return (Array.isArray(answer?.items) ? answer.items : []).map(obj).filter((o) => o !== null).map((o) => of(o!));
}

function device_of(o: Record<string, unknown>): Device {
  return {
    id: str(o.id) || null, kind: str(o.kind), name: str(o.name), network_id: str(o.network_id) || null, address: str(o.address), enabled: o.enabled !== false,
    state: str(o.state) || null, reason: str(o.reason), conflict: str(o.conflict), last_seen_us: num(o.last_seen_us), rate_hz: num(o.rate_hz),
    firmware: str(o.firmware), model: str(o.model), serial: str(o.serial), counters: numbers(o.counters), dropped: numbers(o.dropped),
  };
}
const found_of = (o: Record<string, unknown>): Found => ({ address: str(o.address), kind: str(o.kind) || null, evidence: str(o.evidence), configured: o.configured === true });

export const devices = (): Promise<Device[]> => items('/devices', device_of);
export async function discover(): Promise<Found[]> {
  const answer = obj(await request('POST', '/discovery', {}, { 'Idempotency-Key': idempotency_key(), Prefer: 'wait=30' }));
  return (Array.isArray(answer?.items) ? answer.items : []).map(obj).filter((o) => o !== null).map((o) => found_of(o!));
}
export const add_device = (kind: string, address: string, name: string): Promise<unknown> =>
  request('POST', '/devices', { kind, address, ...(name ? { name } : {}) }, { 'Idempotency-Key': idempotency_key() });
export const act_on_device = (id: string, action: string): Promise<unknown> => request('POST', `/devices/${id}/actions`, { action }, { 'Idempotency-Key': idempotency_key() });
/// The newest state is what the button showed; a device is changed by one person at a time.
export const change_device = (id: string, change: object): Promise<unknown> => request('PATCH', `/devices/${id}`, change, { 'If-Match': '*', 'Content-Type': 'application/merge-patch+json' });
export interface Radio { readonly channel: number; readonly rate_kbps: number; readonly prf_mhz: number; readonly preamble_symbols: number; readonly gain_db: number | null; readonly devices: readonly { readonly network_id: string }[] }
const radio_of = (v: unknown): Radio => {
  const o = obj(v), devices = Array.isArray(o?.devices) ? o.devices.map(obj).filter((d) => d !== null) : [];
  return { channel: num(o?.channel) ?? 0, rate_kbps: num(o?.rate_kbps) ?? 0, prf_mhz: num(o?.prf_mhz) ?? 0, preamble_symbols: num(o?.preamble_symbols) ?? 0, gain_db: num(o?.gain_db), devices: devices.map((d) => ({ network_id: str(d!.network_id) })) };
};
export const read_radio = async (id: string): Promise<Radio> => radio_of(await request('GET', `/devices/${id}/uwb-settings`));
export async function set_radio(id: string, { devices: _, gain_db, ...radio }: Radio): Promise<Radio> {
  return radio_of(await request('PUT', `/devices/${id}/uwb-settings`, { ...radio, ...(gain_db === null ? {} : { gain_db }) }, { 'If-Match': '*' }));
}
export const forget_device = (id: string): Promise<unknown> => request('DELETE', `/devices/${id}`, undefined, { 'If-Match': '*' });

export const tokens = (): Promise<Token[]> => items('/tokens', (o) => ({ id: str(o.id), name: str(o.name), roles: words(o.roles), created_at: str(o.created_at), expires_at: str(o.expires_at) || null, revoked_at: str(o.revoked_at) || null, last_used_at: str(o.last_used_at) || null }));
/// The secret is in this answer and nowhere else.
export async function create_token(name: string, role: string): Promise<string> {
  return str(obj(await request('POST', '/tokens', { name, roles: [role] }, { 'Idempotency-Key': idempotency_key() }))?.token);
}
export const revoke_token = (id: string): Promise<unknown> => request('DELETE', `/tokens/${id}`);
export const audit = (): Promise<AuditLine[]> => items('/audit?limit=100', (o) => ({ at: str(o.at), who: str(o.who), what: str(o.what), result: str(o.result) }));

/// Outside /api/v1: answers of the program, not of its data.
async function plain(path: string): Promise<Record<string, unknown> | null> {
  const answer = await fetch(new URL(path, document.baseURI.split('#')[0]), { credentials: 'same-origin', cache: 'no-cache' });
  return obj(await answer.json());
}
export async function version(): Promise<Version> {
  const o = await plain('version');
  return { version: str(o?.version), git: str(o?.git), schema: num(o?.schema), build: str(o?.build) };
}
export async function checks(): Promise<Check[]> {
  const o = await plain('readyz');
  return Object.entries(obj(o?.checks) ?? {}).map(([name, v]) => ({ name, ok: v === 'ok' || v === true || str(obj(v)?.status) === 'ok', text: typeof v === 'string' ? v : str(obj(v)?.detail) || str(obj(v)?.status) }));
}
