/// Devices that this server drives, radios it heard, and the radio settings of tags.
import { num, obj, str } from '../live/messages';
import { exchange, idempotency_key, request } from './client';
import { items } from './system';

export interface Device {
  readonly id: string | null; ///< null: a radio that was only heard
  readonly kind: string;
  readonly name: string;
  readonly network_id: string | null;
  readonly address: string;
  readonly enabled: boolean;
  readonly state: string | null;
  readonly reason: string;
  readonly conflict: string;
  readonly in_state_s: number | null;
  readonly last_seen_us: number | null;
  readonly rate_hz: number | null;
  readonly firmware: string;
  readonly model: string;
  readonly serial: string;
  readonly options: Readonly<Record<string, unknown>>;
  readonly counters: Readonly<Record<string, number>>;
  readonly dropped: Readonly<Record<string, number>>;
  readonly rover: {
    readonly fix: string;
    readonly satellites: number | null;
    readonly age_s: number | null;
    readonly sigma_h_m: number | null;
  } | null;
  readonly clock: {
    readonly drift_ppm: number;
    readonly sigma_s: number | null;
    readonly settled: boolean;
    readonly skewed: boolean;
  } | null; ///< of a device that stamps by its own
  readonly base: {
    readonly station: number | null;
    readonly lat: number;
    readonly lon: number;
    readonly h_m: number;
    readonly antenna_height_m: number | null;
  } | null; ///< where corrections come from
}
export interface Found {
  readonly address: string;
  readonly kind: string | null;
  readonly evidence: string;
  readonly configured: boolean;
}

const numbers = (v: unknown): Record<string, number> =>
  Object.fromEntries(Object.entries(obj(v) ?? {}).filter((e): e is [string, number] => num(e[1]) !== null));
export function device_of(o: Record<string, unknown>): Device {
  const rover = obj(o.rover),
    clock = obj(o.clock),
    base = obj(o.base),
    [lat, lon, h_m] = [num(base?.lat), num(base?.lon), num(base?.h_m)];
  return {
    options: obj(o.options) ?? {},
    in_state_s: num(o.in_state_s),
    rover: rover && {
      fix: str(rover.fix),
      satellites: num(rover.satellites),
      age_s: num(rover.age_s),
      sigma_h_m: num(rover.sigma_h_m),
    },
    clock: clock && {
      drift_ppm: num(clock.drift_ppm) ?? 0,
      sigma_s: num(clock.sigma_s),
      settled: clock.settled === true,
      skewed: clock.skewed === true,
    },
    base:
      lat === null || lon === null || h_m === null
        ? null
        : { station: num(base?.station), lat, lon, h_m, antenna_height_m: num(base?.antenna_height_m) },
    id: str(o.id) || null,
    kind: str(o.kind),
    name: str(o.name),
    network_id: str(o.network_id) || null,
    address: str(o.address),
    enabled: o.enabled !== false,
    state: str(o.state) || null,
    reason: str(o.reason),
    conflict: str(o.conflict),
    last_seen_us: num(o.last_seen_us),
    rate_hz: num(o.rate_hz),
    firmware: str(o.firmware),
    model: str(o.model),
    serial: str(o.serial),
    counters: numbers(o.counters),
    dropped: numbers(o.dropped),
  };
}
const found_of = (o: Record<string, unknown>): Found => ({
  address: str(o.address),
  kind: str(o.kind) || null,
  evidence: str(o.evidence),
  configured: o.configured === true,
});

export const devices = (): Promise<Device[]> => items('/devices', device_of);
export async function discover(): Promise<Found[]> {
  const answer = obj(
    await request('POST', '/discovery', {}, { 'Idempotency-Key': idempotency_key(), Prefer: 'wait=30' }),
  );
  return (Array.isArray(answer?.items) ? answer.items : [])
    .map(obj)
    .filter((o) => o !== null)
    .map((o) => found_of(o));
}
export interface DeviceForm {
  readonly kind: string;
  readonly name: string;
  readonly address: string;
  readonly options: Readonly<Record<string, unknown>>;
}
export const add_device = ({ kind, name, address, options }: DeviceForm): Promise<unknown> =>
  request(
    'POST',
    '/devices',
    { kind, address, ...(name ? { name } : {}), ...(Object.keys(options).length ? { options } : {}) },
    { 'Idempotency-Key': idempotency_key() },
  );
export const act_on_device = (id: string, action: string, args?: object): Promise<unknown> =>
  request(
    'POST',
    `/devices/${id}/actions`,
    { action, ...(args ? { arguments: args } : {}) },
    { 'Idempotency-Key': idempotency_key() },
  );
/// The newest state is what the button showed; a device is changed by one person at a time.
export const change_device = (id: string, change: object): Promise<unknown> =>
  request('PATCH', `/devices/${id}`, change, { 'If-Match': '*', 'Content-Type': 'application/merge-patch+json' });
/// Another device of the air: whether it has the settings of the tag, and why not.
export interface Peer {
  readonly network_id: string;
  readonly done: boolean;
  readonly why: string;
}
export interface Radio {
  readonly channel: number;
  readonly rate_kbps: number;
  readonly prf_mhz: number;
  readonly preamble_symbols: number;
  readonly gain_db: number | null;
  readonly devices: readonly Peer[];
}
const radio_of = (v: unknown): Radio => {
  const o = obj(v),
    devices = Array.isArray(o?.devices) ? o.devices.map(obj).filter((d) => d !== null) : [];
  return {
    channel: num(o?.channel) ?? 0,
    rate_kbps: num(o?.rate_kbps) ?? 0,
    prf_mhz: num(o?.prf_mhz) ?? 0,
    preamble_symbols: num(o?.preamble_symbols) ?? 0,
    gain_db: num(o?.gain_db),
    devices: devices.map((d) => ({ network_id: str(d.network_id), done: d.done === true, why: str(d.why) })),
  };
};
export const read_radio = async (id: string): Promise<Radio> =>
  radio_of(await request('GET', `/devices/${id}/uwb-settings`));
/// Asks every anchor the tag knows, by radio: up to 15 s, and no ranges meanwhile.
export const compare_radio = async (id: string): Promise<Radio> =>
  radio_of(await request('GET', `/devices/${id}/uwb-settings?devices=true`));
export async function set_radio(id: string, { devices: _, gain_db, ...radio }: Radio): Promise<Radio> {
  return radio_of(
    await request(
      'PUT',
      `/devices/${id}/uwb-settings`,
      { ...radio, ...(gain_db === null ? {} : { gain_db }) },
      { 'If-Match': '*' },
    ),
  );
}
export async function device_at(id: string): Promise<{ readonly device: Device; readonly etag: string }> {
  const { body, etag } = await exchange('GET', `/devices/${id}`);
  return { device: device_of(obj(body) ?? {}), etag };
}
export const edit_device = (id: string, etag: string, patch: object): Promise<unknown> =>
  request('PATCH', `/devices/${id}`, patch, { 'If-Match': etag, 'Content-Type': 'application/merge-patch+json' });
export const forget_device = (id: string): Promise<unknown> =>
  request('DELETE', `/devices/${id}`, undefined, { 'If-Match': '*' });
