import { describe, expect, it } from 'vitest';
import type { StoredFlight } from '../src/api/missions';
import { declared_for } from '../src/views/system/new_flight';

const flown = (kit: string, tag: string, more: object = {}): StoredFlight => ({
  id: kit,
  name: kit,
  site: 'hall',
  kit,
  frame: 'wgs84',
  track_point: 'body',
  tags: [{ tag, antenna: 0, lever_arm_body_m: [0.1, 0, -0.2] }],
  lever_arm_sigma_m: 0.02,
  state: 'finished',
  created_at: '2026-05-04T10:00:00Z',
  ...more,
});
const NOON_US = Date.UTC(2026, 4, 4, 12, 30, 15) * 1000;

describe('what a new flight is declared as before anybody types', () => {
  it('is what the newest flight of its tag was, under a name of its own', () => {
    expect(declared_for(['0x6e01'], [flown('other', '0x6e09'), flown('quad', '0x6e01')], NOON_US)).toEqual({
      name: 'Flight 2026-05-04 12:30',
      site: 'hall',
      kit: 'quad',
      point: 'body',
      arms: [{ tag: '0x6e01', antenna: 0, arm_m: ['0.1', '0', '-0.2'] }],
      sigma_m: '0.02',
    });
  });
  it('has an empty arm for a tag that never flew, for nobody measured it', () => {
    const d = declared_for(['0x6e01', '0x6e02'], [flown('quad', '0x6e01')], NOON_US);
    expect(d.arms.map((a) => [a.tag, ...a.arm_m])).toEqual([
      ['0x6e01', '0.1', '0', '-0.2'],
      ['0x6e02', '', '', ''],
    ]);
    expect(declared_for(['0x6e01'], [], NOON_US)).toMatchObject({
      kit: '',
      site: '',
      point: 'gnss_antenna',
      sigma_m: '',
    });
  });
  it('is not that of the demonstration', () => {
    expect(declared_for(['0x6e01'], [flown('simulated', '0x6e01')], NOON_US).kit).toBe('');
  });
  it('is that of the newest flight where no tag of this server is known', () => {
    expect(declared_for([], [flown('quad', '0x6e01')], NOON_US)).toMatchObject({ kit: 'quad' });
  });
});
