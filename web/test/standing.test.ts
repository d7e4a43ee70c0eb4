import { describe, expect, it } from 'vitest';
import { device_of, type Device } from '../src/api/devices';
import {
  by_count,
  dropped_words,
  lately,
  lost_messages,
  standing,
  summary,
  type Lately,
} from '../src/views/system/standing';

/// Answers of a server with the simulator's faults, shortened: GET /devices.
const device = (part: Record<string, unknown>): Device =>
  device_of({
    id: '01a1ff6b-4649-78c7-a9aa-0611fa043203',
    kind: 'pozyx',
    name: 'tag',
    address: 'serial:/dev/serial/by-id/usb-Pozyx',
    enabled: true,
    state: 'talking',
    network_id: '0x6e01',
    last_seen_us: 1,
    counters: { opened: 1 },
    dropped: {},
    options: {},
    ...part,
  });
const recent = (rows: number, dropped: Record<string, number> = {}): Lately => ({ span_s: 10, rows, dropped });
const state_of = (part: Record<string, unknown>, r: Lately = recent(300)): [string, string] => {
  const s = standing(device(part), r);
  return [s.tone, s.word];
};

describe('what a device stands for', () => {
  it('is well while it delivers, a failed exchange now and then included', () =>
    expect(state_of({}, recent(300, { no_answer: 45, zero_distance: 2 }))).toEqual(['ok', 'WORKING']));
  it('is not well only because the link is: a tag that talks and ranges to nobody', () => {
    expect(state_of({}, recent(0, { refused: 80 }))).toEqual(['bad', 'NO RANGES']);
    expect(state_of({}, recent(0, { zero_distance: 60 }))).toEqual(['bad', 'NO RANGES']);
    expect(state_of({}, recent(0))).toEqual(['bad', 'NO RANGES']);
    expect(standing(device({}), recent(0, { stray_line: 1 })).what).toContain('knows no anchor');
    expect(state_of({}, recent(10, { bad_reply: 69, no_answer: 5 }))).toEqual(['caution', 'FEW RANGES']);
  });
  it('waits for five seconds of looking before it complains', () =>
    expect(standing(device({ counters: { ranges: 40 } }), { span_s: 2, rows: 0, dropped: {} }).word).toBe('WORKING'));
  it('does not call a device working that has delivered nothing yet', () => {
    const little: Lately = { span_s: 2, rows: 0, dropped: {} };
    expect(state_of({ kind: 'gnss', rover: null, counters: { frames: 1 } }, little)).toEqual(['info', 'OPENING']);
    expect(state_of({ counters: { frames: 7 } }, little)).toEqual(['info', 'OPENING']);
    expect(state_of({ kind: 'ntrip', counters: { frames: 1 } }, little)).toEqual(['ok', 'WORKING']);
  });
  it('says of ranges by a mapping what the mapping gets wrong, and asks none of a position stream', () => {
    const mqtt = (options: Record<string, unknown>): Record<string, unknown> => ({ kind: 'mqtt', options });
    const wrong = standing(device(mqtt({ mapping: {} })), recent(0, { out_of_reach: 90 }));
    expect([wrong.tone, wrong.word]).toEqual(['bad', 'NO RANGES']);
    expect(wrong.what).toContain('unit of the mapping?');
    expect(state_of({ kind: 'ndjson' }, recent(0))).toEqual(['bad', 'NO RANGES']);
    expect(state_of({ kind: 'ndjson' }, recent(10, { bad_anchor: 30 }))).toEqual(['caution', 'FEW RANGES']);
    expect(state_of({ kind: 'ndjson' })).toEqual(['ok', 'WORKING']);
    expect(state_of(mqtt({ format: 'pozyx' }), recent(0))).toEqual(['ok', 'WORKING']);
    expect(state_of({ kind: 'ndjson', state: 'silent' }, recent(0))).toEqual(['bad', 'SILENT']);
    expect(standing(device({ kind: 'dwm1001' }), recent(0)).what).toContain('no anchor');
    expect(state_of({ kind: 'dwm1001' })).toEqual(['ok', 'WORKING']);
  });
  it('names the fix of a rover, and what a float costs', () => {
    const rover = (fix: string, age_s: number | null = 1): Record<string, unknown> => ({
      kind: 'gnss',
      network_id: null,
      rover: { fix, satellites: 12, age_s, sigma_h_m: 0.01 },
    });
    expect(state_of(rover('fixed'))).toEqual(['ok', 'WORKING']);
    expect(state_of(rover('fixed', 8))).toEqual(['caution', 'OLD FIX']);
    expect(state_of(rover('float'))).toEqual(['caution', 'FLOAT']);
    expect(state_of(rover('single'))).toEqual(['bad', 'SINGLE']);
    expect(state_of(rover('none'), recent(0, { no_fix: 50 }))).toEqual(['bad', 'NO FIX']);
    expect(state_of({ kind: 'gnss', rover: null }, recent(0, { no_time: 50 }))).toEqual(['bad', 'NO FIX']);
    expect(state_of({ kind: 'gnss', rover: null }, recent(0, { no_ellipsoidal_height: 50 }))).toEqual([
      'bad',
      'NO POSITIONS',
    ]);
    expect(state_of(rover('fixed'), recent(50, { byte_outside_any_frame: 560 }))).toEqual(['caution', 'NOISY']);
  });
  it('tells two devices with one id, and a clock that is none', () => {
    const twin = standing(
      device({ conflict: '0x6e07 is also device "twin" (01a1ff6b-46f3-7fd2-b37d-f69d00c91ff0)' }),
      recent(300),
    );
    expect([twin.word, twin.what]).toEqual(['ID TWICE', '0x6e07 is also device "twin".']);
    expect(state_of({ clock: { drift_ppm: 899, sigma_s: 1e-4, settled: true, skewed: true } })).toEqual([
      'bad',
      'CLOCK WRONG',
    ]);
  });
  it('tells a tag that was moved to another port from two tags with one id', () => {
    const conflict = '0x6e02 is also device "new" (01a1ff6b-46f3-7fd2-b37d-f69d00c91ff0)',
      was = { state: 'lost', reason: '/dev/x: no such device: is it plugged in and powered?', conflict };
    expect(standing(device(was), recent(0))).toMatchObject({
      word: 'ELSEWHERE',
      tone: 'caution',
      what: '0x6e02 identifies itself as device "new".',
    });
    expect(standing(device({ conflict }), recent(300), false).word).toBe('WORKING');
    expect(standing(device(was), recent(0), false).word).toBe('UNPLUGGED');
  });
  it('gives the command of a port that may not be opened', () => {
    const s = standing(
      device({
        state: 'lost',
        reason:
          '/dev/ttyACM0: permission denied: it belongs to group uucp; run "sudo usermod -aG uucp $USER" and log in again',
      }),
      recent(0),
    );
    expect([s.word, s.command]).toEqual(['NOT ALLOWED', 'sudo usermod -aG uucp $USER']);
    expect(s.what).toContain('group uucp,');
  });
  it.each([
    ['UNPLUGGED', '/dev/x: no such device: is it plugged in and powered?', {}],
    ['UNPLUGGED', 'serial:/dev/x: unplugged', {}],
    ['NEVER SEEN', '/dev/x: no such device: is it plugged in and powered?', { last_seen_us: null, in_state_s: 3 }],
    ['PORT BUSY', '/dev/x: busy: another program has this port open', {}],
    ['PORT TWICE', '/dev/pts/1: the same port as device "tag" (01a1ff6b-4649-78c7-a9aa-0611fa043203)', {}],
    ['LOST', 'tcp://127.0.0.1:9: refused: is the service of the device switched on?', {}],
    ['LOST', 'tcp://10.0.0.9:9001: no answer: is it on this network?', {}],
    ['SILENT', 'nothing received for too long: opened again', {}],
    ['LOST', 'tcp://10.0.0.9:9001: the other side closed the connection', {}],
    ['REFUSED', 'the caster rejects the user or the password', { kind: 'ntrip' }],
    ['NO SUCH MOUNT', 'the caster has no mount "X"; it has A, B', { kind: 'ntrip' }],
    ['NO POZYX', 'no Pozyx tag answers on this port', { network_id: null }],
    ['SILENT', 'no Pozyx tag answers on this port', {}],
  ])('is %s for "%s"', (word, reason, part) => {
    const s = standing(device({ state: 'lost', reason, ...part }), recent(0));
    expect([s.word, s.tone]).toEqual([word, 'bad']);
    expect(s.what.length * s.todo.length).toBeGreaterThan(0);
    expect(s.what).not.toMatch(/[0-9a-f]{8}-/);
  });
  it('says of a caster that what it sends is no RTCM', () =>
    expect(
      standing(device({ kind: 'ntrip', state: 'open', counters: { opened: 3 } }), recent(0, { no_rtcm_bytes: 900 }))
        .what,
    ).toContain('not RTCM 3'));
  it('does not repeat the address', () =>
    expect(
      standing(device({ state: 'lost', reason: 'tcp://10.0.0.9:9001: Connection reset by peer' }), recent(0)).what,
    ).toBe('Connection reset by peer.'));
  it('waits for a device that is to connect', () =>
    expect(
      standing(
        device({
          kind: 'gnss',
          state: 'found',
          reason: 'not opened yet',
          address: 'tcp-listen://0.0.0.0:9002',
          counters: {},
        }),
        recent(0),
      ),
    ).toMatchObject({ word: 'WAITING', todo: 'Let its output connect to this computer, port 9002.' }));
  it('is off when it was switched off, whatever else', () =>
    expect(state_of({ enabled: false, state: 'off', conflict: 'x is also device y' })).toEqual(['off', 'OFF']));
  it('adds up to one line', () =>
    expect(
      summary([
        standing(device({}), recent(9)),
        standing(device({ state: 'silent' }), recent(0)),
        standing(device({ enabled: false }), recent(0)),
      ]),
    ).toEqual({ working: 1, look: 0, wrong: 1, off: 1 }));
});

describe('what was dropped lately', () => {
  const look = (at_ms: number, refused: number, ranges: number) => ({
    at_ms,
    counters: { ranges, fixes: 0 },
    dropped: { refused, zero_distance: 5 },
  });
  it('is the growth since the oldest look of the last seconds', () =>
    expect(lately([look(0, 0, 0), look(4000, 100, 50), look(14_000, 130, 90)])).toEqual({
      span_s: 10,
      rows: 40,
      dropped: { refused: 30 },
    }));
  it('counts from zero where the server began anew', () =>
    expect(lately([look(0, 500, 900), look(2000, 3, 7)])).toMatchObject({ rows: 7, dropped: { refused: 3 } }));
  it('is nothing after one look', () => expect(lately([look(0, 5, 5)]).span_s).toBe(0));
  it('counts bytes apart from messages', () =>
    expect(lost_messages({ byte_outside_any_frame: 560, ubx_checksum_wrong: 6 })).toBe(6));
  it('is said in words, most frequent first', () =>
    expect(by_count({ no_cir: 1, ubx_checksum_wrong: 6, x_y: 0 }).map(([why]) => dropped_words(why))).toEqual([
      'UBX: checksum wrong',
      'no impulse response',
    ]));
});
