import { describe, expect, it } from 'vitest';
import type { StoredFlight } from '../src/api/missions';
import { correction_of } from '../src/views/system/flight_form';

const flight: StoredFlight = {
  id: 'm',
  name: 'first',
  site: null,
  kit: 'quad',
  frame: 'wgs84',
  track_point: 'gnss_antenna',
  tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.1, 0, -0.2] }],
  lever_arm_sigma_m: null,
  state: 'finished',
  created_at: '2026-05-04T10:00:00Z',
};
const same = {
  name: 'first',
  site: '',
  kit: 'quad',
  point: 'gnss_antenna',
  arms: [{ tag: '0x6e01', antenna: 0, arm_m: ['0.1', '0', '-0.2'] }],
  sigma_m: '',
};

describe('the correction of a flight', () => {
  it('is empty where nothing differs, however numbers are written', () => {
    expect(correction_of(flight, same)).toEqual({});
    expect(correction_of(flight, { ...same, arms: [{ ...same.arms[0]!, arm_m: ['0,10', '0.0', '-0.20'] }] })).toEqual(
      {},
    );
  });
  it('has what differs and nothing else', () => {
    expect(correction_of(flight, { ...same, name: 'second' })).toEqual({ name: 'second' });
    expect(
      correction_of(flight, { ...same, arms: [{ ...same.arms[0]!, arm_m: ['0.1', '0', '-0,32'] }], sigma_m: '0.02' }),
    ).toEqual({
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.1, 0, -0.32] }],
      lever_arm_sigma_m: 0.02,
    });
    expect(correction_of({ ...flight, site: 's', lever_arm_sigma_m: 0.02 }, same)).toEqual({
      site: null,
      lever_arm_sigma_m: null,
    });
  });
  it('is none where a number is none', () => {
    expect(correction_of(flight, { ...same, sigma_m: 'two' })).toBeNull();
    expect(correction_of(flight, { ...same, arms: [{ ...same.arms[0]!, arm_m: ['', '0', '0'] }] })).toBeNull();
  });
});
