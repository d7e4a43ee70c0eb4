/// Commanding a flight: who has control, what must be green before take-off, and the commands. Everything here is answered by the server's guard.
import { idempotency_key } from './client';
import { call, get, given, type Wire } from './contract';

export type Action = NonNullable<Wire<'MissionAction'>['action']>;
export interface Lease {
  readonly key: string;
  readonly since_us: number; // tells this control from one that somebody took later
  readonly expires_us: number;
}
export type ChecklistItem = Wire<'Checklist'>['items'][number];

const at = (id: string): { readonly path: { readonly id: string } } => ({ path: { id } });
async function control(mission: string, body: Wire<'ControlAction'>): Promise<Lease> {
  const held = (await call('post', '/missions/{id}/control', { ...at(mission), body })).body;
  return { key: held.lease ?? '', since_us: held.since_us ?? 0, expires_us: held.expires_us ?? 0 };
}
export const take_control = (mission: string, force: boolean): Promise<Lease> =>
  control(mission, given<Wire<'ControlAction'>>({ action: 'take', force: force || null }));
export const renew_control = (mission: string, lease: string): Promise<Lease> =>
  control(mission, { action: 'renew', lease });
export const release_control = (mission: string, lease: string): Promise<unknown> =>
  control(mission, { action: 'release', lease });
/// Whoever has it sees an event, and gives it back or refuses.
export const ask_for_control = (mission: string): Promise<unknown> => control(mission, { action: 'ask' });
export const refuse_control = (mission: string, lease: string): Promise<unknown> =>
  control(mission, { action: 'refuse', lease });
export const command = (
  mission: string,
  action: Action,
  lease: string,
  more: Omit<Wire<'MissionAction'>, 'action' | 'lease'> = {},
): Promise<unknown> =>
  call('post', '/missions/{id}/actions', {
    ...at(mission),
    body: { action, lease, ...more },
    headers: { 'Idempotency-Key': idempotency_key() },
  });

export type AnchorOrder = 'accept' | 'give_up' | 'reopen';
/// Ends the work on an anchor, or takes that back.
export const order_anchor = (mission: string, anchor: string, lease: string, action: AnchorOrder): Promise<unknown> =>
  call('post', '/missions/{id}/anchors/{anchor}/work', {
    path: { id: mission, anchor },
    body: { lease, action },
    headers: { 'Idempotency-Key': idempotency_key() },
  });

export const checklist = async (mission: string, plan: string | null): Promise<ChecklistItem[]> =>
  (await get('/missions/{id}/checklist', { ...at(mission), query: plan ? { plan } : {} })).items;
/// This plan is to be flown: the aircraft gets its fence.
export const work_off_checklist = async (mission: string, plan: string): Promise<ChecklistItem[]> =>
  (await call('post', '/missions/{id}/checklist', { ...at(mission), body: { plan } })).body.items;
export const set_item = (mission: string, item: string, reason: string): Promise<unknown> =>
  call('post', '/missions/{id}/checklist/{item}', { path: { id: mission, item }, body: { reason } });
