import { describe, expect, it } from 'vitest';
import type { LiveSink, LiveSource } from '../src/live/source';
import { back_words, connect, now_ms, scene_of } from '../src/state/store';

const SERVER_US = 1_800_000_000_000_000; // years from the clock of this machine
let sink: LiveSink | null = null;
const source: LiveSource = {
  start: (s) => void (sink = s),
  stop: () => undefined,
  retryNow: () => undefined,
  pause: () => undefined,
  offers: () => true,
  now_us: () => SERVER_US,
  silence_ms: () => 0,
  data_age_ms: () => 0,
  slow: () => false,
  retry_in_ms: () => null,
};
connect(
  source,
  () => undefined,
  () => undefined,
);

describe('a page that is loaded while the devices of a flight are silent', () => {
  const t_us = SERVER_US - 240_000_000,
    age_s = (at_ms: number): number => (now_ms() - at_ms) / 1000;
  it('gives every value the age of its measurement', () => {
    const place = { lon: 3.7, lat: 51, h_m: 50 };
    sink!.snap('drone.pose', [{ mission: 'm', t_us, fix: 'fixed', ...place }], t_us);
    sink!.snap('rtk.status', [{ mission: 'm', t_us, fix: 'fixed' }], t_us);
    sink!.snap('ranges', [{ mission: 'm', t_us, anchor: '0x1', distance_m: 3 }], t_us);
    sink!.snap('anchors.estimates', [{ mission: 'm', t_us, anchor: '0x1' }], t_us);
    sink!.snap('procedure', [{ mission: 'm', t_us }], t_us);
    sink!.snap('mission.grid', [{ mission: 'm', t_us }], t_us);
    sink!.snap('mission.turn', [{ mission: 'm', t_us, anchor: '0x1' }], t_us);
    sink!.snap('mission.height', [{ mission: 'm', t_us, anchor: '0x1' }], t_us);
    const s = scene_of('m'),
      ages = [s.pose, s.rtk, s.anchors.get('0x1'), s.procedure, s.grid, s.turns.get('0x1'), s.heights.get('0x1')];
    for (const heard of ages) expect(age_s(heard!.at_ms)).toBeCloseTo(240, 0);
    expect(age_s(s.ranges.get('0x1')!.at_ms)).toBeCloseTo(240, 0);
    expect(age_s(s.range_at_ms)).toBeCloseTo(240, 0);
  });
  it('shows what is measured from then on as it comes', () => {
    sink!.data('rtk.status', { mission: 'm', t_us: SERVER_US, fix: 'fixed' }, SERVER_US);
    expect(age_s(scene_of('m').rtk!.at_ms)).toBeCloseTo(0, 0);
  });
  it('never claims after an outage that a device is current', () => {
    expect(back_words(8000, new Map(), true)).not.toContain('current');
  });
});
