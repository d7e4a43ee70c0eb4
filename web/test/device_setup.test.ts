import { describe, expect, it } from 'vitest';
import { device_of } from '../src/api/devices';
import { address_of, config_of, EMPTY, missing, parts_of, patch_of, setup_of } from '../src/views/system/device_setup';
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
    expect(missing({ ...EMPTY, path: '/dev/x', anchors: '6a21' })).toBe('6a21 is no network id like 0x6a21.');
    expect(missing(caster)).toBe('');
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
