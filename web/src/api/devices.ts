/// Devices of this server, radios it heard, and the radio settings of tags.
import { idempotency_key } from './client';
import { call, get, given, list, type Wire } from './contract';
import type { operations, paths } from './generated/schema';

type Configured = Wire<'ConfiguredDevice'>;
/// A device of the contract, or a radio that was only received: then without an id, an address and a state. Text that is absent is empty.
export interface Device extends Pick<Configured, 'kind' | 'network_id' | 'last_seen_us' | 'options' | 'dropped'> {
  readonly id: string | null;
  readonly name: string;
  readonly address: string;
  readonly enabled: boolean;
  readonly state: Configured['state'] | null;
  readonly reason: string;
  readonly conflict: string;
  readonly in_state_s: number | null;
  readonly rate_hz: number | null;
  readonly firmware: string;
  readonly model: string;
  readonly serial: string;
  readonly counters: Readonly<Record<string, number>>;
  readonly rover: NonNullable<Configured['rover']> | null;
  readonly clock: NonNullable<Configured['clock']> | null; ///< of a device that stamps by its own
  readonly base: NonNullable<Configured['base']> | null; ///< where corrections come from
}
export type Found = Wire<'Discovery'>['items'][number];

export function device_of(o: Partial<Configured> | Wire<'HeardRadio'>): Device {
  const d: Partial<Configured> = o;
  return {
    id: d.id ?? null,
    kind: d.kind ?? '',
    name: d.name ?? '',
    network_id: d.network_id ?? null,
    address: d.address ?? '',
    enabled: d.enabled ?? true,
    state: d.state ?? null,
    reason: d.reason ?? '',
    conflict: d.conflict ?? '',
    in_state_s: d.in_state_s ?? null,
    last_seen_us: d.last_seen_us ?? null,
    rate_hz: d.rate_hz ?? null,
    firmware: d.firmware ?? '',
    model: d.model ?? '',
    serial: d.serial ?? '',
    options: d.options ?? {},
    counters: d.counters ?? {},
    dropped: d.dropped ?? {},
    rover: d.rover ?? null,
    clock: d.clock ?? null,
    base: d.base ?? null,
  };
}

export const devices = async (): Promise<Device[]> => (await list('/devices')).map(device_of);
export async function discover(): Promise<Found[]> {
  const headers = { 'Idempotency-Key': idempotency_key(), Prefer: 'wait=30' };
  const { body } = await call('post', '/discovery', { headers });
  return (body as Partial<Wire<'Discovery'>>).items ?? []; // a job that takes longer has none yet
}
export type DeviceForm = Required<Pick<Wire<'DeviceWrite'>, 'kind' | 'name' | 'address' | 'options'>>;
const at = (id: string): { readonly path: { readonly id: string } } => ({ path: { id } });
const PATCH = 'application/merge-patch+json';
export const add_device = ({ kind, name, address, options }: DeviceForm): Promise<unknown> =>
  call('post', '/devices', {
    body: given<Wire<'DeviceWrite'>>({
      kind,
      address,
      name,
      options: Object.keys(options ?? {}).length ? options : null,
    }),
    headers: { 'Idempotency-Key': idempotency_key() },
  });
type Asked = operations['actOnDevice']['requestBody']['content']['application/json'];
/// What the device answers, which is its own to say.
export const act_on_device = async (id: string, action: string, args?: Record<string, unknown>): Promise<unknown> =>
  (
    await call('post', '/devices/{id}/actions', {
      ...at(id),
      body: given<Asked>({ action, arguments: args }),
      headers: { 'Idempotency-Key': idempotency_key() },
    })
  ).body.result;
type Patch = Partial<Wire<'DeviceWrite'>>;
/// The newest state is what the button showed; a device is changed by one person at a time.
export const change_device = (id: string, change: Patch): Promise<unknown> => edit_device(id, '*', change);
type UwbWanted = NonNullable<
  paths['/api/v1/devices/{id}/uwb-settings']['put']['requestBody']
>['content']['application/json'];
/// Another device of the air: whether it has the settings of the tag, and why not.
export type Peer = Required<NonNullable<Wire<'UwbSettings'>['devices']>[number]>;
export type Radio = Omit<Wire<'UwbSettings'>, 'devices'> & { readonly devices: readonly Peer[] };
const radio_of = ({ devices, ...radio }: Wire<'UwbSettings'>): Radio => ({
  ...radio,
  devices: (devices ?? []).map((d) => ({ ...d, why: d.why ?? '' })),
});
export const read_radio = async (id: string): Promise<Radio> =>
  radio_of(await get('/devices/{id}/uwb-settings', at(id)));
/// Asks every anchor the tag knows, by radio: up to 15 s, and no ranges meanwhile.
export const compare_radio = async (id: string): Promise<Radio> =>
  radio_of(await get('/devices/{id}/uwb-settings', { ...at(id), query: { devices: true } }));
export async function set_radio(id: string, { devices: _, gain_db, ...radio }: Radio): Promise<Radio> {
  const body = { ...radio, ...(gain_db === null ? {} : { gain_db }) } as UwbWanted; // choices of the form
  return radio_of(
    (await call('put', '/devices/{id}/uwb-settings', { ...at(id), body, headers: { 'If-Match': '*' } })).body,
  );
}
export async function device_at(id: string): Promise<{ readonly device: Device; readonly etag: string }> {
  const { body, etag } = await call('get', '/devices/{id}', at(id));
  return { device: device_of(body), etag };
}
export const edit_device = (id: string, etag: string, body: Patch): Promise<unknown> =>
  call('patch', '/devices/{id}', { ...at(id), body, headers: { 'If-Match': etag, 'Content-Type': PATCH } });
export const forget_device = (id: string): Promise<unknown> =>
  call('delete', '/devices/{id}', { ...at(id), headers: { 'If-Match': '*' } });
