/// Commanding a flight: who has control, what must be green before take-off, and the commands. Everything here is answered by the server's guard.
import { num, obj, str } from '../live/messages';
import { idempotency_key, request } from './client';

export interface Lease {
  readonly key: string;
  readonly expires_us: number;
}
export interface ChecklistItem {
  readonly id: string;
  readonly text: string;
  readonly detail: string;
  readonly state: 'ok' | 'open' | 'failed';
  readonly manual: boolean;
  readonly overridable: boolean;
  readonly overridden_by: string;
  readonly reason: string;
}

const path = (mission: string, part: string): string => `/missions/${encodeURIComponent(mission)}/${part}`;
const lease_of = (v: unknown): Lease => ({ key: str(obj(v)?.lease), expires_us: num(obj(v)?.expires_us) ?? 0 });

export const take_control = async (mission: string, force: boolean): Promise<Lease> =>
  lease_of(await request('POST', path(mission, 'control'), { action: 'take', ...(force ? { force } : {}) }));
export const renew_control = async (mission: string, lease: string): Promise<Lease> =>
  lease_of(await request('POST', path(mission, 'control'), { action: 'renew', lease }));
export const release_control = (mission: string, lease: string): Promise<unknown> =>
  request('POST', path(mission, 'control'), { action: 'release', lease });
export const command = (mission: string, action: string, lease: string, more: object = {}): Promise<unknown> =>
  request('POST', path(mission, 'actions'), { action, lease, ...more }, { 'Idempotency-Key': idempotency_key() });

export async function checklist(mission: string, plan: string | null): Promise<ChecklistItem[]> {
  const items = obj(await request('GET', path(mission, `checklist${plan ? `?plan=${plan}` : ''}`)))?.items;
  return (Array.isArray(items) ? items : [])
    .map(obj)
    .filter((o) => o !== null)
    .map((o) => ({
      id: str(o.id),
      text: str(o.text),
      detail: str(o.detail),
      state: o.state === 'ok' ? 'ok' : o.state === 'open' ? 'open' : 'failed',
      manual: o.manual === true,
      overridable: o.overridable === true,
      overridden_by: str(o.overridden_by),
      reason: str(o.override_reason),
    }));
}
export const set_item = (mission: string, item: string, reason: string): Promise<unknown> =>
  request('POST', path(mission, `checklist/${encodeURIComponent(item)}`), { reason });
