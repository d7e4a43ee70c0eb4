/// A device's settings between the form and the server: the address in its parts, the options of each kind. What the form does not know it leaves
/// as it is. No DOM.
import type { Device, DeviceForm } from '../../api/devices';

export const KINDS = [
  ['pozyx', 'Pozyx tag'],
  ['gnss', 'RTK rover'],
  ['ntrip', 'NTRIP corrections'],
] as const;
export const kind_words = (kind: string): string => KINDS.find(([id]) => id === kind)?.[1] ?? kind;
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
};

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
/// Merge-patch of what changed; null when nothing did.
export function patch_of(was: Device, s: Setup): Record<string, unknown> | null {
  const out: Record<string, unknown> = {},
    options: Record<string, unknown> = {},
    address = address_of(s);
  if (s.name.trim() !== was.name) out.name = s.name.trim();
  if (address !== address_of(setup_of(was))) out.address = address;
  for (const [key, v] of Object.entries(options_of(s)))
    if (JSON.stringify(v) !== JSON.stringify(was.options[key] ?? null)) options[key] = v;
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
  if (s.password_of && !s.password && address_of(s) !== address_of({ ...s, ...parts_of(s.password_of) }))
    return 'The password belongs to the old address: type it again.';
  const id =
    s.kind === 'pozyx'
      ? s.anchors
          .split(/[\s,;]+/)
          .filter(Boolean)
          .find((a) => !/^0x[0-9a-fA-F]{1,8}$/.test(a))
      : undefined;
  return id ? `${id} is no network id like 0x6a21.` : '';
}
