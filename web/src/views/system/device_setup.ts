/// A device's settings between the form and the server: the address in its parts, the options of each kind. What the form does not know it leaves
/// as it is. No DOM.
import { ApiError } from '../../api/client';
import type { Device, DeviceForm } from '../../api/devices';
import { bytes_of, mapping_fault, mapping_of, mapping_text, topic_fault } from './device_mapping';

/// Kind, its words in the list of devices, and in the form where those need more.
const KIND_WORDS = [
  ['pozyx', 'Pozyx tag', ''],
  ['dwm1001', 'DWM1001 tag', 'DWM1001 tag (serial or TCP)'],
  ['mqtt', 'MQTT broker', 'MQTT broker (mapping file, or Pozyx positions)'],
  ['ndjson', 'NDJSON tag', 'NDJSON tag (mapping file)'],
  ['gnss', 'RTK rover', ''],
  ['ntrip', 'NTRIP corrections', ''],
] as const;
export const KINDS: readonly (readonly [string, string])[] = KIND_WORDS.map(([id, words, long]) => [id, long || words]);
export const kind_words = (kind: string): string => KIND_WORDS.find(([id]) => id === kind)?.[1] ?? kind;
/// Kinds that this server connects to, and nothing else: the port they have by custom.
const SERVICES: Readonly<Record<string, string>> = { ntrip: '2101', mqtt: '1883' };
export const is_service = (kind: string): boolean => kind in SERVICES;
export const LINKS = [
  ['serial', 'USB or serial port'],
  ['tcp', 'TCP, this server connects'],
  ['tcp-listen', 'TCP, the device connects'],
  ['udp', 'UDP'],
] as const;
export const BAUDS = [9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600] as const;

/// What is typed; numbers stay text until they are sent. A password is only written: `password_of` is the address that the server keeps one for.
export interface Setup {
  readonly kind: string;
  readonly name: string;
  readonly link: string;
  readonly path: string;
  readonly baud: string;
  readonly host: string;
  readonly port: string;
  readonly format: string;
  readonly corrections: string;
  readonly latency_ms: string;
  readonly gpsd_device: string;
  readonly anchors: string;
  readonly cir: string;
  readonly heading: boolean;
  readonly anchor_anchor_s: string;
  readonly mount: string;
  readonly user: string;
  readonly password: string;
  readonly password_of: string;
  readonly version: string;
  readonly send_gga: boolean;
  readonly payload: string; ///< of mqtt: mapping or pozyx
  readonly topic: string;
  readonly mapping: string; ///< JSON
  readonly mode: string;
  readonly tag: string;
}
export const EMPTY: Setup = {
  kind: 'pozyx',
  name: '',
  link: 'serial',
  path: '',
  baud: '115200',
  host: '',
  port: '',
  format: 'auto',
  corrections: 'own',
  latency_ms: '',
  gpsd_device: '',
  anchors: '',
  cir: 'window',
  heading: false,
  anchor_anchor_s: '',
  mount: '',
  user: '',
  password: '',
  password_of: '',
  version: '2',
  send_gga: false,
  payload: 'mapping',
  topic: '',
  mapping: '',
  mode: 'shell',
  tag: '',
};

/// What another kind changes of the place: a service is connected to at its usual port, and a device gets its port back.
export function of_kind(s: Setup, kind: string): Partial<Setup> {
  const port = s.port === SERVICES[s.kind] ? '' : s.port;
  if (is_service(kind)) return { kind, link: 'tcp', port: port || SERVICES[kind]! };
  return { kind, port, ...(is_service(s.kind) && !s.host.trim() ? { link: 'serial' } : {}) };
}

export function address_of(s: Setup): string {
  if (s.link === 'serial') return `serial:${s.path.trim()}${s.baud === '115200' ? '' : `?baud=${s.baud}`}`;
  const host = s.host.trim();
  return `${s.link}://${host.includes(':') && !host.startsWith('[') ? `[${host}]` : host}:${s.port.trim()}`;
}
export function parts_of(address: string): Pick<Setup, 'link' | 'path' | 'baud' | 'host' | 'port'> {
  const none = { link: 'serial', path: '', baud: '115200', host: '', port: '' };
  const serial = /^serial:([^?]*)(?:\?baud=(\d+))?/.exec(address);
  if (serial) return { ...none, path: serial[1]!, baud: serial[2] ?? '115200' };
  const net = /^(tcp-listen|tcp|udp):\/\/(.*):(\d+)$/.exec(address);
  return net
    ? { ...none, link: net[1]!, host: net[2]!.replace(/^\[(.*)\]$/, '$1'), port: net[3]! }
    : { ...none, path: address };
}
const text = (v: unknown): string => (typeof v === 'string' ? v : typeof v === 'number' ? String(v) : '');
export function setup_of(d: Device): Setup {
  const o = d.options;
  return {
    ...EMPTY,
    kind: d.kind,
    name: d.name,
    ...parts_of(d.address),
    format: text(o.format) || 'auto',
    corrections: text(o.corrections) || 'own',
    latency_ms: text(o.latency_ms),
    gpsd_device: text(o.gpsd_device),
    anchors: Array.isArray(o.anchors) ? o.anchors.filter((a) => typeof a === 'string').join(' ') : '',
    cir: text(o.cir) || 'window',
    heading: o.heading === true,
    anchor_anchor_s: text(o.anchor_anchor_s),
    mount: text(o.mount),
    user: text(o.user),
    password_of: o.password_set === true ? d.address : '',
    version: text(o.version) || '2',
    send_gga: o.send_gga === true,
    payload: text(o.format) === 'pozyx' ? 'pozyx' : 'mapping',
    topic: text(o.topic),
    mapping: mapping_text(o.mapping),
    mode: text(o.mode) || 'shell',
    tag: text(o.tag),
  };
}
const number = (s: string): number | null => {
  const t = s.trim().replace(',', '.');
  return t === '' || !Number.isFinite(Number(t)) ? null : Number(t);
};
/// Options that differ from what the server takes by itself; null where the server's own holds.
function options_of(s: Setup): Record<string, unknown> {
  const other = <T>(v: T, usual: T): T | null => (v === usual ? null : v),
    ids = s.anchors.split(/[\s,;]+/).filter(Boolean);
  if (s.kind === 'gnss')
    return {
      format: other(s.format, 'auto'),
      corrections: other(s.corrections, 'own'),
      latency_ms: number(s.latency_ms),
      gpsd_device: s.gpsd_device.trim() || null,
    };
  if (s.kind === 'pozyx')
    return {
      anchors: ids.length ? ids : null,
      cir: other(s.cir, 'window'),
      heading: other(s.heading, false),
      anchor_anchor_s: number(s.anchor_anchor_s) || null,
    };
  if (s.kind === 'dwm1001') return { mode: other(s.mode, 'shell'), tag: s.tag.trim() || null };
  if (s.kind === 'ndjson') return { mapping: mapping_of(s.mapping) };
  if (s.kind === 'mqtt')
    return {
      format: other(s.payload, 'mapping'),
      mapping: s.payload === 'mapping' ? mapping_of(s.mapping) : null,
      topic: s.topic.trim() || null,
      user: s.user.trim() || null,
      password: s.password || null,
    };
  return {
    mount: s.mount.trim() || null,
    user: s.user.trim() || null,
    password: s.password || null,
    version: other(Number(s.version), 2),
    send_gga: other(s.send_gga, false),
  };
}
export const config_of = (s: Setup): DeviceForm => ({
  kind: s.kind as DeviceForm['kind'], // one of the choices of the form
  name: s.name.trim(),
  address: address_of(s),
  options: Object.fromEntries(Object.entries(options_of(s)).filter(([, v]) => v !== null)),
});
/// A broker takes no password without a user: who empties the user wants to be nobody there.
export const forgets_password = (s: Setup): boolean =>
  s.kind === 'mqtt' && s.password_of !== '' && !s.password && !s.user.trim();
/// Merge-patch of what changed; null when nothing did.
export function patch_of(was: Device, s: Setup): Record<string, unknown> | null {
  const out: Record<string, unknown> = {},
    options: Record<string, unknown> = {},
    address = address_of(s),
    before = options_of(setup_of(was));
  if (s.name.trim() !== was.name) out.name = s.name.trim();
  if (address !== address_of(setup_of(was))) out.address = address;
  for (const [key, v] of Object.entries(options_of(s)))
    if (JSON.stringify(v) !== JSON.stringify(before[key] ?? null)) options[key] = v;
  if (forgets_password(s)) options.password = null;
  if (Object.keys(options).length) out.options = options;
  return Object.keys(out).length ? out : null;
}
/// What is missing or cannot be, before the server is asked; empty when it can be sent.
export function missing(s: Setup): string {
  if (s.link === 'serial' ? !s.path.trim() : !s.port.trim())
    return s.link === 'serial' ? 'Which port?' : 'Which port number?';
  if (s.link === 'tcp' && !s.host.trim()) return 'Which computer or address?';
  if (s.link !== 'serial' && !(Number(s.port) >= 1 && Number(s.port) <= 65_535)) return 'A port number is 1 to 65535.';
  if (s.kind === 'ntrip' && !s.mount.trim()) return 'Which mount point of the caster?';
  if (
    s.password_of &&
    !s.password &&
    !forgets_password(s) &&
    address_of(s) !== address_of({ ...s, ...parts_of(s.password_of) })
  )
    return 'The password belongs to the old address: type it again.';
  if (s.kind === 'ndjson') return mapping_fault(s.mapping, null) || size_fault(s);
  if (s.kind === 'mqtt') return broker_fault(s);
  if (s.kind === 'dwm1001') return module_fault(s);
  const id =
    s.kind === 'pozyx'
      ? s.anchors
          .split(/[\s,;]+/)
          .filter(Boolean)
          .find((a) => !/^0x[0-9a-fA-F]{1,8}$/.test(a))
      : undefined;
  return id ? `${id} is not a network id like 0x6a21.` : '';
}

/// Of api/devices/device_json.cpp: all options that are sent at once.
const MOST_OPTIONS_BYTES = 10_000;
function size_fault(s: Setup): string {
  const bytes = bytes_of(JSON.stringify(config_of(s).options));
  return bytes > MOST_OPTIONS_BYTES
    ? `Mapping: ${(bytes / 1000).toFixed(1)} kB with the other settings (limit 10 kB). Shorten "ids": id_prefix and id_format may replace them.`
    : '';
}
function broker_fault(s: Setup): string {
  if (s.password && !s.user.trim())
    return 'User: missing, and a password needs a user. Type it, or clear the password.';
  return (
    topic_fault(s.topic.trim()) || (s.payload === 'mapping' ? mapping_fault(s.mapping, s.topic) || size_fault(s) : '')
  );
}
function module_fault(s: Setup): string {
  const id = s.tag.trim();
  if (!id)
    return s.mode === 'tlv' ? 'Id of the tag: missing, and binary needs it. Type it as on its label, like 0x6e01.' : '';
  return /^(?:0[xX][0-9a-fA-F]+|\d+)$/.test(id) && Number(id) < 2 ** 32
    ? ''
    : `Id of the tag: ${id} is not an id. Type 32 bits at most, like 0x6e01.`;
}

/// What the server rejected of one field of the form; null where it is of no single one of these.
export interface Rejected {
  readonly field: 'mapping' | 'topic' | 'user' | 'password' | 'tag';
  readonly faults: readonly string[];
}
const REJECTED = /^(mapping|topic|user|password|tag)(?:\/|: )/;
export function rejected_of(e: unknown, kind: string): Rejected | null {
  if (!(e instanceof ApiError) || !['mqtt', 'ndjson', 'dwm1001'].includes(kind)) return null;
  const [first, ...others] = e.problem.errors;
  if (!first || others.length || !first.pointer.startsWith('/options')) return null;
  // The driver names the option in its text, the reader of the request in the pointer.
  const at = first.pointer.slice('/options/'.length),
    text = at ? `${at}: ${first.detail}` : first.detail,
    field = REJECTED.exec(text)?.[1];
  return field
    ? { field: field as Rejected['field'], faults: text.split(/; (?=mapping\/)/) } // words of the pattern
    : null;
}
