/// How a device stands for somebody who has to act on it: one word, what is wrong, what to do. A link that is open is not yet a device that
/// measures: a tag that talks and gives no range is as bad as one that is unplugged. No DOM.
import type { Device } from '../../api/devices';
import type { Shape, Tone } from '../../ui/marks';
import { grouped } from '../../ui/format';

export interface Standing {
  readonly shape: Shape;
  readonly tone: Tone;
  readonly word: string;
  readonly what: string;
  readonly todo: string;
  readonly command: string;
}
/// What came and what was dropped lately, over `span_s` seconds.
export interface Lately {
  readonly span_s: number;
  readonly rows: number;
  readonly dropped: Readonly<Record<string, number>>;
}
export interface Look {
  readonly at_ms: number;
  readonly counters: Readonly<Record<string, number>>;
  readonly dropped: Readonly<Record<string, number>>;
}

export const LATELY_MS = 12_000;
const grown = (now: number | undefined, then: number | undefined): number => {
  const n = now ?? 0,
    t = then ?? 0;
  return n >= t ? n - t : n;
}; // a server that began anew counts from zero
/// Difference between the oldest look that is not too old and the newest.
export function lately(looks: readonly Look[]): Lately {
  const newest = looks.at(-1),
    oldest = newest && looks.find((l) => newest.at_ms - l.at_ms <= LATELY_MS);
  if (!newest || !oldest || oldest === newest) return { span_s: 0, rows: 0, dropped: {} };
  const dropped = Object.fromEntries(
    Object.entries(newest.dropped)
      .map(([why, n]) => [why, grown(n, oldest.dropped[why])] as const)
      .filter(([, n]) => n > 0),
  );
  const rows = ['ranges', 'fixes'].reduce((sum, key) => sum + grown(newest.counters[key], oldest.counters[key]), 0);
  return { span_s: (newest.at_ms - oldest.at_ms) / 1000, rows, dropped };
}

const DROPPED: Readonly<Record<string, string>> = {
  no_answer: 'an anchor did not answer',
  refused: 'the tag refused to range',
  zero_distance: 'distance 0, the value of a failed exchange',
  stale_range: 'a repeated range',
  distance_impossible: 'a distance beyond the range of the radio',
  rss_impossible: 'an impossible RSS',
  not_acknowledged: 'an anchor did not accept the command',
  no_event: 'the tag did not report the end of the range',
  no_cir: 'no impulse response',
  no_compass: 'no compass',
  no_reply: 'no reply on the cable',
  bad_reply: 'an unreadable reply',
  stray_line: 'an unexpected line',
  byte_outside_any_frame: 'bytes outside any message',
  other_format: 'another format than the one in use',
  no_time: 'no time yet',
  no_fix: 'no fix',
  no_ellipsoidal_height: 'no height above the ellipsoid',
  implausible_position: 'an impossible position',
  repeated_epoch: 'a repeated epoch',
  out_of_order: 'out of order',
  time_step: 'a time that jumped once (a damaged one, or another receiver on this line?)',
  caster_refused: 'the caster refused',
  no_rtcm_bytes: 'bytes that are not RTCM',
  not_utf8: 'messages that are not UTF-8',
  not_json: 'messages that are not JSON',
  too_deep: 'messages that are nested too deeply',
  too_large: 'messages that are too large',
  no_array: 'no array at the place in the mapping',
  too_many: 'more than 10 000 elements in a message',
  bad_tag: 'no tag at the place in the mapping',
  bad_anchor: 'no anchor at the place in the mapping',
  bad_distance: 'no distance at the place in the mapping',
  out_of_reach: 'distances below 0.05 m or above 150 m (unit of the mapping?)',
  bad_time: 'no time at the place in the mapping',
  time_off: 'times more than a minute away (clock not set, or unit of the mapping?)',
  bad_power: 'a power outside of -200 to 50 dBm',
  too_many_tags: 'more than 64 tags',
  retained: 'retained messages of the broker',
  write_refused: 'the device no longer accepts data',
  write_without_link: 'no receiver to send to',
  port_conflict: 'the port is used by another device of this server',
  driver_fault: 'a fault of anchord itself',
};
const FORMATS: Readonly<Record<string, string>> = { nmea: 'NMEA', ubx: 'UBX', erb: 'ERB', llh: 'LLH', gpsd: 'gpsd' };
export function dropped_words(reason: string): string {
  if (DROPPED[reason]) return DROPPED[reason];
  const [format, ...rest] = reason.split('_');
  return FORMATS[format!] ? `${FORMATS[format!]}: ${rest.join(' ')}` : reason.replaceAll('_', ' ');
}
/// Counted in bytes, where the others count messages: they say how noisy a line is, not how much was lost.
const IN_BYTES = new Set(['byte_outside_any_frame', 'nmea_byte_that_is_no_text', 'no_rtcm_bytes']);
export const lost_messages = (dropped: Readonly<Record<string, number>>): number =>
  Object.entries(dropped).reduce((sum, [why, n]) => sum + (IN_BYTES.has(why) ? 0 : n), 0);
const noise_bytes = (dropped: Readonly<Record<string, number>>): number =>
  Object.entries(dropped).reduce((sum, [why, n]) => sum + (IN_BYTES.has(why) ? n : 0), 0);
/// Most frequent first.
export const by_count = (dropped: Readonly<Record<string, number>>): [string, number][] =>
  Object.entries(dropped)
    .filter(([, n]) => n > 0)
    .sort((a, b) => b[1] - a[1]);
const total = (dropped: Readonly<Record<string, number>>): number => Object.values(dropped).reduce((a, b) => a + b, 0);
const without_ids = (text: string): string => text.replace(/ \([0-9a-f]{8}-[0-9a-f-]{27}\)/g, '');
const sentence = (text: string): string =>
  text ? `${text[0]!.toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? '' : '.'}` : '';

const stand = (shape: Shape, tone: Tone, word: string, what = '', todo = '', command = ''): Standing => ({
  shape,
  tone,
  word,
  what,
  todo,
  command,
});
const bad = (word: string, what: string, todo: string, command = ''): Standing =>
  stand('bad', 'bad', word, what, todo, command);
const caution = (word: string, what: string, todo: string): Standing => stand('caution', 'caution', word, what, todo);

/// Of a link that does not stand: `reason` is the server's line.
function not_linked(d: Device): Standing {
  // The address stands beside it already.
  const reason = sentence(without_ids(d.reason).replace(/^(\w[\w-]*:)?\/\S*: /, '')),
    by_id = d.address.includes('/by-id/'),
    word = d.in_state_s !== null && d.last_seen_us === null && d.state === 'lost' ? 'NEVER SEEN' : 'LOST';
  if (/permission denied/.test(d.reason)) {
    const command = /"([^"]+)"/.exec(d.reason)?.[1] ?? 'sudo usermod -aG dialout $USER',
      group = /belongs to group (\S+?)[;,]/.exec(d.reason)?.[1] ?? 'dialout';
    return bad(
      'NOT ALLOWED',
      `The port belongs to the group ${group}, and the server is not in it.`,
      'Run this on the computer of the server as the user that runs it, log in again and start the server again:',
      command,
    );
  }
  if (/the same port as/.test(d.conflict || d.reason))
    return bad(
      'PORT TWICE',
      `It is ${/the same port as device "[^"]*"/.exec(d.conflict || d.reason)![0]}: one port serves one device.`,
      'Remove one of the two, or give this one its own port.',
    );
  if (/busy/.test(d.reason))
    return bad(
      'PORT BUSY',
      'Another program has this port open.',
      'Close it there (gpsd, ModemManager, a terminal); this server then opens the port by itself.',
    );
  if (/no such device|unplugged/.test(d.reason))
    return bad(
      word === 'NEVER SEEN' ? word : 'UNPLUGGED',
      'Its port is not there.',
      'Plug it in and switch it on: it is connected within a ' +
        `second.${by_id ? '' : ' If the plug moved, Discover finds its new port; a name under by-id stays.'}`,
    );
  if (/rejects the user/.test(d.reason))
    return bad('REFUSED', reason, 'Edit: check the user, and send the password again.');
  if (/no mount/.test(d.reason))
    return bad('NO SUCH MOUNT', reason, 'Edit: choose one of the mount points listed here.');
  if (/caster|mount/.test(d.reason)) return bad('REFUSED', reason, 'Check address, mount point and NTRIP version.');
  if (/refused: is the service/.test(d.reason))
    return bad(
      word,
      'The computer at this address answers, but nothing listens on this port.',
      'Switch the output of the device on, or check the port in its address.',
    );
  if (/the other side closed/.test(d.reason))
    return bad(
      word,
      'The other side closed the connection.',
      'It is opened again automatically. If this repeats, another program may be using its only connection.',
    );
  if (/no such host/.test(d.reason))
    return bad(word, 'There is no computer with this name.', 'Check the address; an IP address always works.');
  if (/no answer|unreachable|timed out|No route/i.test(d.reason))
    return bad(
      word,
      'There is no answer at this address.',
      'Check power, cable or Wi-Fi of the device, and that it is on this network.',
    );
  if (/no Pozyx tag answers/.test(d.reason))
    return d.network_id
      ? silent(d)
      : bad(
          'NO POZYX',
          'The port is open, but no Pozyx tag answers on it.',
          'Another device may be in this port: Discover shows which one answers.',
        );
  if (/received for too long/.test(d.reason)) return silent(d);
  return bad(word, reason || 'The link is gone.', 'It is opened again by itself.');
}
function silent(d: Device, noise = /make no frame|none of them can be used/.test(d.reason)): Standing {
  if (d.kind === 'pozyx')
    return bad(
      'SILENT',
      noise ? 'The port is open, but the data cannot be read.' : 'The port is open, but the tag sends nothing.',
      noise
        ? 'Is a Pozyx tag on this port? Discover shows it. If it is: unplug it and plug it in again, then try another cable.'
        : 'Unplug the tag and plug it in again. If it stays silent: another cable, another port.',
    );
  if (d.kind === 'ntrip')
    return bad(
      'SILENT',
      noise ? 'The caster sends data, but it is not RTCM 3.' : 'The caster is connected, but sends no corrections.',
      noise
        ? 'Edit: choose a mount point that sends RTCM 3.'
        : 'Check the mount point; some casters want to know where the rover is (Edit).',
    );
  if (d.kind === 'mqtt' || d.kind === 'ndjson')
    return bad(
      'SILENT',
      noise ? 'Messages are received, but none of them can be used.' : 'The link is open, but no message is received.',
      noise
        ? 'Details shows why messages are rejected: correct the mapping.'
        : d.kind === 'mqtt'
          ? 'Check that the broker runs.'
          : 'Check that the tag sends, and that each line has a line end.',
    );
  return bad(
    'SILENT',
    noise ? 'Data is received, but cannot be read.' : 'The link is open, but the receiver sends nothing.',
    noise
      ? 'Edit: check the baud rate and the format.'
      : 'Switch its output on (position, NMEA or UBX) in the receiver, or check its baud rate.',
  );
}
const LOW_FIX: Readonly<Record<string, readonly [Tone, string, string]>> = {
  none: ['bad', 'NO FIX', 'Antenna under the open sky? Antenna cable? A cold start takes a minute.'],
  single: ['bad', 'SINGLE', 'No corrections reach the rover: check base or caster, and the radio link between them.'],
  dgps: [
    'caution',
    'DGPS',
    'Corrections are received, but not for RTK: check what the base sends (RTCM 3 with carrier phase).',
  ],
  float: [
    'caution',
    'FLOAT',
    'Wait for the fix under open sky. It stays float if the base is far away or its corrections are old.',
  ],
};
/// Ranges of another system; a position stream makes no rows.
const by_mapping = (d: Device): boolean =>
  d.kind === 'ndjson' || (d.kind === 'mqtt' && d.options['format'] !== 'pozyx');
export const of_ranges = (d: Device): boolean => d.kind === 'pozyx' || d.kind === 'dwm1001' || by_mapping(d);
/// Of a tag or rover whose link is good: does it deliver what it is there for?
function delivering(d: Device, recent: Lately): Standing {
  // One stray line is no reason; what comes once in two seconds is.
  const drops = lost_messages(recent.dropped),
    [first] = by_count(recent.dropped).filter(([, n]) => 2 * n >= recent.span_s),
    known = recent.span_s >= 5;
  if (d.kind === 'dwm1001' && known && recent.rows === 0)
    return bad(
      'NO RANGES',
      first ? `The module answers, but not with ranges: ${dropped_words(first[0])}.` : 'The module measures no anchor.',
      'Switch its anchors on; they must be in its network (panid).',
    );
  if (by_mapping(d)) {
    const why = first ? ` Most are rejected: ${dropped_words(first[0])}.` : '';
    if (known && recent.rows === 0)
      return bad(
        'NO RANGES',
        first ? `No message gives a range.${why}` : 'No message is received.',
        first ? 'Correct the mapping: anchord devices settings.' : 'Check that the tags send, and the topic.',
      );
    if (known && drops > recent.rows)
      return caution(
        'FEW RANGES',
        `More is rejected than used.${why}`,
        'Details shows what was rejected, and how often.',
      );
  }
  if (d.kind === 'pozyx') {
    // A failed exchange now and then is the air; more than half of them is a fault.
    const none = known && recent.rows === 0,
      many = known && drops > recent.rows && first !== undefined;
    if (none || many) {
      const word = none ? 'NO RANGES' : 'FEW RANGES',
        say = (what: string, todo: string): Standing => (none ? bad(word, what, todo) : caution(word, what, todo)),
        most = none ? 'Every' : 'Nearly every';
      if (!first)
        return say(
          'The tag answers, but it knows no anchor to range to.',
          'Switch on anchors in its range. If they are on, their radio settings differ: Radio.',
        );
      if (first[0] === 'no_answer')
        return say(
          `${most} exchange gets no answer.`,
          'Anchors switched off, out of range, or on other radio settings: Radio compares them.',
        );
      if (first[0] === 'refused' || first[0] === 'no_event')
        return say(
          `The tag answers the cable, but ${first[0] === 'refused' ? 'refuses to range' : 'its radio never finishes'}.`,
          'Reboot it (Details). If that does not help, unplug it for some seconds.',
        );
      if (first[0] === 'zero_distance' || first[0] === 'stale_range')
        return say(
          `${most} range is a known failure value (${dropped_words(first[0])}); none of these is stored.`,
          'Reboot the tag (Details); then the anchor it names in Measurements.',
        );
      if (/reply|stray/.test(first[0]))
        return say(
          'Most of the data on the cable is damaged.',
          'A bad cable or plug: change it. Keep USB away from motor wires.',
        );
      return say(
        `${most} exchange fails: ${dropped_words(first[0])}.`,
        'Details shows what was rejected, and how often.',
      );
    }
  }
  if (d.kind === 'gnss') {
    // A receiver that never had a fix knows no time either: nothing of it is an epoch yet.
    const fix =
        d.rover?.fix ??
        (known && recent.rows === 0 && (first?.[0] === 'no_time' || first?.[0] === 'no_fix') ? 'none' : null),
      low = fix === null ? undefined : LOW_FIX[fix];
    if (low)
      return stand(
        low[0] === 'bad' ? 'bad' : 'caution',
        low[0],
        low[1],
        fix === 'none'
          ? 'The receiver sends, but it has no position.'
          : fix === 'float'
            ? 'The position is accurate to decimetres, not centimetres; ranges measured now are weighted less.'
            : 'The position is accurate only to metres.',
        low[2],
      );
    if (known && recent.rows === 0)
      return bad(
        'NO POSITIONS',
        first
          ? `It sends, but nothing of it can be used: ${dropped_words(first[0])}.`
          : 'It is connected, but sends no positions.',
        first?.[0] === 'no_ellipsoidal_height'
          ? 'Let the receiver send the height above the ellipsoid (GGA with geoid separation, or UBX NAV-PVT).'
          : 'Let the receiver send positions: GGA with GST, UBX NAV-PVT, ERB or LLH.',
      );
    if (d.rover?.age_s != null && d.rover.age_s > 5)
      return caution(
        'OLD FIX',
        `The corrections are ${Math.round(d.rover.age_s)} s old.`,
        'Check the radio link to the base, or the caster.',
      );
    if (known && drops > recent.rows && first)
      return caution(
        'FEW POSITIONS',
        `More is lost than used: ${dropped_words(first[0])}.`,
        'Details shows what was rejected, and how often.',
      );
    // A receiver's text at start-up is some lines; what goes on is the line.
    if (noise_bytes(recent.dropped) > 20 * recent.span_s)
      return caution(
        'NOISY',
        `Unreadable bytes between its messages: ${noise_bytes(recent.dropped)} bytes in ${Math.round(recent.span_s)} s. Complete messages are used.`,
        'A loose plug, a cable beside motor wires, or two formats mixed.',
      );
  }
  // Linked for less than the five seconds that a verdict takes: not wrong yet, but nothing was delivered that would make it working.
  if (d.kind === 'gnss' && !d.rover && recent.rows === 0)
    return stand('estimating', 'info', 'OPENING', 'It is connected; waiting for its first position.');
  if (of_ranges(d) && !d.counters.ranges && recent.rows === 0)
    return stand('estimating', 'info', 'OPENING', 'It is connected; waiting for its first range.');
  return stand('ok', 'ok', 'WORKING');
}
/// `same_id_speaks`: another device here with this one's id has a link.
export function standing(d: Device, recent: Lately, same_id_speaks = true): Standing {
  const trouble = /^not started: (.*?)(; correct its settings or remove it)?$/.exec(d.reason)?.[1];
  if (d.enabled && trouble) return bad('NOT STARTED', sentence(trouble), 'Edit: correct its settings, or remove it.');
  if (!d.enabled || d.state === 'off') return stand('off', 'off', 'OFF');
  const same_id = same_id_speaks && /is also device/.test(d.conflict),
    linked = d.state !== 'lost' && d.state !== 'found';
  if (same_id && !linked)
    return caution(
      'ELSEWHERE',
      sentence(without_ids(d.conflict).replace('is also', 'identifies itself as')),
      'If the tag was moved to another port: remove this one. If these are two tags: one needs another id.',
    );
  if (same_id)
    return bad(
      'ID TWICE',
      sentence(without_ids(d.conflict)),
      "Two tags with one id cannot be distinguished: switch one of them off, or give it another id with the maker's tool.",
    );
  if (d.state === 'found' && d.address.startsWith('tcp-listen:'))
    return caution(
      'WAITING',
      (d.counters.opened ?? 0) > 0 ? 'The device is no longer connected.' : 'The device has not connected yet.',
      `Let its output connect to this computer, port ${d.address.split(':').at(-1)}.`,
    );
  if (d.state === 'found' && (d.counters.opened ?? 0) === 0 && !d.reason.includes(':'))
    return stand('found', 'info', 'OPENING', 'Its link is being opened.');
  if (!linked) return not_linked(d);
  if (d.state === 'silent')
    return silent(
      d,
      total(recent.dropped) > (recent.dropped.no_reply ?? 0) || /make no frame|none of them can be used/.test(d.reason),
    );
  if (d.state === 'open' && noise_bytes(recent.dropped) > 0) return silent(d, true);
  if (d.state === 'open' && (d.counters.opened ?? 0) > 1)
    return caution(
      'OPENED AGAIN',
      'Its link was lost and is open again.',
      'No readable data yet; this takes some seconds.',
    );
  if (d.state === 'open') return stand('estimating', 'info', 'OPENING', 'Waiting for the first readable bytes.');
  const now = delivering(d, recent);
  if (now.tone === 'ok' && d.clock?.skewed)
    return bad(
      'CLOCK WRONG',
      `Its clock runs ${Math.round(Math.abs(d.clock.drift_ppm))} ppm too ` +
        `${d.clock.drift_ppm > 0 ? 'fast' : 'slow'}: more than any working crystal, so its times cannot be trusted.`,
      'Use another tag; have this one repaired.',
    );
  return now;
}

/// What it delivers, in one line.
export function doing(d: Device): string {
  if (d.kind === 'gnss' && d.rover)
    return [
      ({ fixed: 'FIX', float: 'FLOAT', dgps: 'DGPS', single: 'SINGLE', none: 'no fix' } as Record<string, string>)[
        d.rover.fix
      ] ?? d.rover.fix,
      d.rover.satellites === null ? '' : `${d.rover.satellites} satellites`,
      d.rover.age_s === null ? '' : `corrections ${d.rover.age_s.toFixed(1)} s old`,
      d.rover.sigma_h_m === null
        ? ''
        : `σ ${d.rover.sigma_h_m < 1 ? `${Math.round(d.rover.sigma_h_m * 100)} cm` : `${d.rover.sigma_h_m.toFixed(1)} m`}`,
    ]
      .filter(Boolean)
      .join(', ');
  if (of_ranges(d)) return d.counters.ranges ? `${grouped(d.counters.ranges)} ranges` : '';
  return d.kind === 'ntrip' && d.counters.frames
    ? `${grouped(d.counters.frames)} correction${d.counters.frames === 1 ? '' : 's'}`
    : '';
}
/// For the line above the table.
export function summary(all: readonly Standing[]): {
  readonly working: number;
  readonly look: number;
  readonly wrong: number;
  readonly off: number;
} {
  const n = (...tones: Tone[]): number => all.filter((s) => tones.includes(s.tone)).length;
  return { working: n('ok', 'info'), look: n('caution'), wrong: n('bad'), off: n('off') };
}
