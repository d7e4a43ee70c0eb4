import { describe, expect, it } from 'vitest';
import { ApiError, problem_of } from '../src/api/client';
import { device_of } from '../src/api/devices';
import {
  address_of,
  config_of,
  EMPTY,
  kind_words,
  KINDS,
  missing,
  of_kind,
  parts_of,
  patch_of,
  rejected_of,
  setup_of,
  type Setup,
} from '../src/views/system/device_setup';
import { radio_differences } from '../src/views/system/radio_words';

/// The forms of drivers/link/address.hpp.
const ADDRESSES = [
  'serial:/dev/serial/by-id/usb-Pozyx_1',
  'serial:/dev/ttyUSB0?baud=9600',
  'tcp://192.168.2.15:9001',
  'tcp-listen://:9002',
  'tcp-listen://127.0.0.1:9002',
  'udp://:14550',
  'udp://0.0.0.0:14550',
  'tcp://[fe80::1]:9001',
];

describe('the address of a device', () => {
  it.each(ADDRESSES)('%s comes back from its parts as it was', (a) =>
    expect(address_of({ ...EMPTY, ...parts_of(a) })).toBe(a),
  );
  it('keeps a baud rate that no list has', () => expect(parts_of('serial:/dev/x?baud=1500000').baud).toBe('1500000'));
});

describe('the settings of a device', () => {
  const caster = {
    ...EMPTY,
    kind: 'ntrip',
    name: ' base ',
    link: 'tcp',
    host: 'caster.example',
    port: '2101',
    mount: 'NEAR',
    user: 'me',
    version: '1',
    send_gga: true,
  };
  it('are sent without what the server takes by itself', () => {
    expect(config_of(caster)).toEqual({
      kind: 'ntrip',
      name: 'base',
      address: 'tcp://caster.example:2101',
      options: { mount: 'NEAR', user: 'me', version: 1, send_gga: true },
    });
    expect(config_of({ ...EMPTY, path: '/dev/x', anchors: '0x6a21, 0x6a22', anchor_anchor_s: '0,5' }).options).toEqual({
      anchors: ['0x6a21', '0x6a22'],
      anchor_anchor_s: 0.5,
    });
    expect(config_of({ ...EMPTY, kind: 'gnss', path: '/dev/x' }).options).toEqual({});
  });
  it('change only what was changed, and keep options the form does not know', () => {
    const was = device_of({
      id: 'x',
      kind: 'gnss',
      name: 'rover',
      address: 'tcp://10.0.0.2:9001',
      options: { format: 'ubx', gst_order: 'standard' },
    });
    expect(patch_of(was, setup_of(was))).toBeNull();
    expect(patch_of(was, { ...setup_of(was), format: 'auto', port: '9002' })).toEqual({
      address: 'tcp://10.0.0.2:9002',
      options: { format: null },
    });
    expect(patch_of(was, { ...setup_of(was), corrections: 'ntrip' })).toEqual({ options: { corrections: 'ntrip' } });
  });
  it('send a password when one is typed, know only that there is one, and ask for it again with another address', () => {
    const was = device_of({
      id: 'x',
      kind: 'ntrip',
      name: 'base',
      address: 'tcp://caster.example:2101',
      options: { mount: 'NEAR', user: 'me', password_set: true },
    });
    const kept = setup_of(was);
    expect(kept.password).toBe('');
    expect(patch_of(was, kept)).toBeNull();
    expect(missing(kept)).toBe('');
    expect(patch_of(was, { ...kept, password: 'secret' })).toEqual({ options: { password: 'secret' } });
    expect(missing({ ...kept, host: 'other.example' })).toBe('The password belongs to the old address: type it again.');
    expect(missing({ ...kept, host: 'other.example', password: 'secret' })).toBe('');
    expect(config_of({ ...caster, password: 'secret' }).options).toEqual({
      mount: 'NEAR',
      user: 'me',
      password: 'secret',
      version: 1,
      send_gga: true,
    });
  });
  it('say what is missing before they are sent', () => {
    expect(missing(EMPTY)).toBe('Which port?');
    expect(missing({ ...caster, mount: ' ' })).toBe('Which mount point of the caster?');
    expect(missing({ ...caster, port: '70000' })).toBe('A port number is 1 to 65535.');
    expect(missing({ ...EMPTY, path: '/dev/x', anchors: '6a21' })).toBe('6a21 is not a network id like 0x6a21.');
    expect(missing(caster)).toBe('');
  });
});

/// The mapping of docs/integration.md.
const MAPPING = {
  array: '/r',
  tag: '#/id',
  anchor: '/to',
  id_format: 'hex',
  distance: { pointer: '/mm', unit: 'mm' },
  time: { pointer: '#/ts', unit: 'ms', clock: 'device', wrap_bits: 32 },
  rss: { pointer: '/dbm', unit: 'dBm' },
};
const at_broker = { kind: 'mqtt', link: 'tcp', host: '192.168.2.20', port: '1883', topic: 'uwb/+/ranges' };
const BROKER: Setup = { ...EMPTY, ...at_broker, mapping: JSON.stringify(MAPPING) };
const LINES: Setup = { ...EMPTY, kind: 'ndjson', path: '/dev/ttyUSB0', mapping: JSON.stringify(MAPPING) };
const MODULE: Setup = { ...EMPTY, kind: 'dwm1001', path: '/dev/serial/by-id/usb-SEGGER' };

describe('the settings of a tag of another maker', () => {
  it.each<[string, Setup, string, object]>([
    ['mqtt', BROKER, 'tcp://192.168.2.20:1883', { mapping: MAPPING, topic: 'uwb/+/ranges' }],
    [
      'mqtt with a user',
      { ...BROKER, user: 'me' },
      'tcp://192.168.2.20:1883',
      { mapping: MAPPING, topic: 'uwb/+/ranges', user: 'me' },
    ],
    ['mqtt of Pozyx', { ...BROKER, payload: 'pozyx', topic: '' }, 'tcp://192.168.2.20:1883', { format: 'pozyx' }],
    ['ndjson', { ...LINES, baud: '9600' }, 'serial:/dev/ttyUSB0?baud=9600', { mapping: MAPPING }],
    ['ndjson over UDP', { ...LINES, link: 'udp', port: '9001' }, 'udp://:9001', { mapping: MAPPING }],
    ['dwm1001', MODULE, 'serial:/dev/serial/by-id/usb-SEGGER', {}],
    [
      'dwm1001 in binary',
      { ...MODULE, mode: 'tlv', tag: '0x6e01' },
      'serial:/dev/serial/by-id/usb-SEGGER',
      { mode: 'tlv', tag: '0x6e01' },
    ],
  ])('of %s is sent, comes back into the form as it was, and is not sent again', (_, s, address, options) => {
    expect(missing(s)).toBe('');
    const sent = config_of(s);
    expect(sent).toEqual({ kind: s.kind, name: '', address, options });
    const was = device_of({ id: 'x', ...sent, options: sent.options! });
    expect(config_of(setup_of(was))).toEqual(sent);
    expect(patch_of(was, setup_of(was))).toBeNull();
  });
  it('is not sent again where it names what the server takes by itself', () => {
    const was = device_of({
      id: 'x',
      kind: 'dwm1001',
      name: 'n',
      address: 'serial:/dev/x',
      options: { mode: 'shell' },
    });
    expect(patch_of(was, setup_of(was))).toBeNull();
  });
  it('changes a mapping as a whole, and takes it out for positions of Pozyx', () => {
    const { options, ...sent } = config_of(BROKER),
      was = device_of({ id: 'x', ...sent, options: options! }),
      other = { ...MAPPING, array: '/ranges' };
    expect(patch_of(was, { ...setup_of(was), mapping: JSON.stringify(other) })).toEqual({
      options: { mapping: other },
    });
    expect(patch_of(was, { ...setup_of(was), payload: 'pozyx', topic: '' })).toEqual({
      options: { format: 'pozyx', mapping: null, topic: null },
    });
  });
  it('keeps the password of a broker on the server, asks for it with another address, and forgets it with the user', () => {
    const { options, ...sent } = config_of({ ...BROKER, user: 'me' }),
      was = device_of({ id: 'x', ...sent, options: { ...options, password_set: true } }),
      kept = setup_of(was);
    expect([kept.password, patch_of(was, kept)]).toEqual(['', null]);
    expect(patch_of(was, { ...kept, password: 'secret' })).toEqual({ options: { password: 'secret' } });
    expect(missing({ ...kept, host: '10.0.0.9' })).toBe('The password belongs to the old address: type it again.');
    const nobody = { ...kept, user: '', host: '10.0.0.9' };
    expect(missing(nobody)).toBe('');
    expect(patch_of(was, nobody)).toEqual({
      address: 'tcp://10.0.0.9:1883',
      options: { user: null, password: null },
    });
  });
  it('is refused without a mapping, or with one that is no JSON object, with the place of the fault', () => {
    expect(missing({ ...LINES, mapping: ' ' })).toBe('Mapping: missing. Paste the JSON object, or choose its file.');
    expect(missing({ ...LINES, mapping: '[]' })).toMatch(/^Mapping: must be a JSON object/);
    expect(missing({ ...LINES, mapping: '{\n  "tag": "/id",\n}' })).toMatch(
      /^Mapping: not valid JSON at line 3, column 1\. /,
    );
    expect(missing({ ...LINES, mapping: 'array = "/r"\ntag = "#/id"' })).toMatch(/TOML.*as JSON.*mapping_file=/);
  });
  it.each<[string, object, RegExp]>([
    ['no tag', { tag: undefined }, /"tag" is missing\. Add/],
    ['no anchor', { anchor: undefined }, /"anchor" is missing\. Add/],
    ['no distance', { distance: undefined }, /"distance" needs a pointer and a unit \(m, cm, mm, ft\)/],
    ['a distance without a unit', { distance: '/mm' }, /"distance" needs a pointer and a unit/],
    ['a distance in inches', { distance: { pointer: '/mm', unit: 'in' } }, /"distance" needs a pointer and a unit/],
    ['a topic on a line', { topic: 'uwb/+' }, /"topic" is only for MQTT.*Remove it/],
    [
      '10 kB and more',
      { id_prefix: 'x'.repeat(10_000) },
      /10\.\d kB with the other settings \(limit 10 kB\)\. Shorten/,
    ],
  ])('is refused where its mapping has %s', (_, part, words) =>
    expect(missing({ ...LINES, mapping: JSON.stringify({ ...MAPPING, ...part }) })).toMatch(words),
  );
  it('takes the topic of the form or of the mapping, and refuses none and what is no filter', () => {
    const inside = JSON.stringify({ ...MAPPING, topic: 'uwb/#' });
    expect(missing({ ...BROKER, topic: '', mapping: inside })).toBe('');
    expect(missing({ ...BROKER, topic: ' ' })).toMatch(/^Topic: missing\. Type it/);
    expect(missing({ ...BROKER, topic: 'uwb/#/x' })).toMatch(/^Topic: "#" cannot be a level/);
    expect(missing({ ...BROKER, topic: 'uwb/a+' })).toMatch(/^Topic: "a\+" cannot be a level/);
    expect(missing({ ...BROKER, topic: 'x'.repeat(1001) })).toMatch(/longer than 1000 bytes/);
    expect(missing({ ...BROKER, payload: 'pozyx', topic: '', mapping: '' })).toBe('');
  });
  it('is refused with a password and no user, and without the id that binary needs', () => {
    expect(missing({ ...BROKER, password: 'secret' })).toMatch(/^User: missing, and a password needs a user/);
    expect(missing({ ...MODULE, mode: 'tlv' })).toMatch(/^Id of the tag: missing, and binary needs it/);
    for (const tag of ['6e01', '0x', '0x100000000', '-1'])
      expect(missing({ ...MODULE, tag })).toBe(
        `Id of the tag: ${tag} is not an id. Type 32 bits at most, like 0x6e01.`,
      );
    expect(missing({ ...MODULE, tag: '27183' })).toBe('');
  });
  it('is asked for where the kind is: a broker at its usual port, a tag at a serial port again', () => {
    expect(KINDS.map(([id]) => id).sort()).toEqual(['dwm1001', 'gnss', 'mqtt', 'ndjson', 'ntrip', 'pozyx']);
    expect(kind_words('dwm1001')).toBe('DWM1001 tag');
    const broker = { ...EMPTY, ...of_kind(EMPTY, 'mqtt') };
    expect([broker.link, broker.port]).toEqual(['tcp', '1883']);
    expect(of_kind(broker, 'ntrip')).toMatchObject({ link: 'tcp', port: '2101' });
    expect(of_kind(broker, 'dwm1001')).toEqual({ kind: 'dwm1001', link: 'serial', port: '' });
    expect(of_kind({ ...broker, host: 'h', port: '7000' }, 'ndjson')).toEqual({ kind: 'ndjson', port: '7000' });
  });
});

describe('what the server rejects', () => {
  const refused = (pointer: string, detail: string): ApiError =>
    new ApiError(problem_of({ title: 'Validation', detail, errors: [{ pointer, detail }] }, 422));
  it('is of the field that it names, every fault of a mapping by itself', () => {
    const text = 'mapping/tag: is needed, like "/tag"; mapping/x: there is no such key; the keys are topic, array';
    expect(rejected_of(refused('/options', text), 'ndjson')).toEqual({
      field: 'mapping',
      faults: ['mapping/tag: is needed, like "/tag"', 'mapping/x: there is no such key; the keys are topic, array'],
    });
    expect(rejected_of(refused('/options', 'tag: must be an id like 0x022e'), 'dwm1001')?.field).toBe('tag');
    expect(rejected_of(refused('/options/password', 'must be a string'), 'mqtt')).toEqual({
      field: 'password',
      faults: ['password: must be a string'],
    });
  });
  it('is of the whole form where it names no field of it', () => {
    expect(rejected_of(refused('/address', 'tag: the host is missing'), 'mqtt')).toBeNull();
    expect(rejected_of(refused('/options', 'must be an object below 10 kB'), 'mqtt')).toBeNull();
    expect(rejected_of(refused('/options', 'mount: must be the name of a mount point'), 'ntrip')).toBeNull();
    expect(rejected_of(new Error('no answer'), 'mqtt')).toBeNull();
  });
});

describe('radio settings that differ', () => {
  const air = { channel: 5, rate_kbps: 110, prf_mhz: 64, preamble_symbols: 4096, gain_db: 11.5, devices: [] };
  const tag = (name: string, part: object, options = {}) => ({ id: name, name, options, radio: { ...air, ...part } });
  it('are none where all agree, or only the gain differs', () =>
    expect(radio_differences([tag('a', {}), tag('b', { gain_db: 20 })])).toEqual([]));
  it('are told between tags', () =>
    expect(radio_differences([tag('a', {}), tag('b', { channel: 2 })])[0]).toMatchObject({
      id: 'b',
      title: 'Two tags, two radio settings.',
    }));
  it('are told of anchors, apart from those that only do not answer', () => {
    const peer = (network_id: string, why: string) => ({ network_id, done: why === '', why });
    expect(
      radio_differences([
        tag('a', {
          devices: [
            peer('0x1', ''),
            peer('0x2', 'has channel 5, 110 kbit/s, PRF 64 MHz, 4096 symbols, gain 20.0 dB'),
            peer('0x3', '0x3 does not answer: not_acknowledged'),
          ],
        }),
      ]).map((d) => d.title),
    ).toEqual(['1 of 3 anchors has other radio settings than a.', '1 of 3 anchors does not answer a.']);
  });
  it('are told of a tag that is not as it was set up', () =>
    expect(radio_differences([tag('a', {}, { uwb: { channel: 3 } })])).toHaveLength(1));
  it('are not guessed of a tag that was not asked', () =>
    expect(radio_differences([{ id: 'a', name: 'a', radio: null, options: { uwb: { channel: 3 } } }])).toEqual([]));
});
