import { describe, expect, it } from 'vitest';
import {
  lines_of,
  missing,
  NEW_PLACE,
  setting_of,
  spread,
  truth_query,
  typed_number,
  type Place,
} from '../src/views/measurements/take';

const place = (over: Partial<Place> = {}): Place => ({
  ...NEW_PLACE,
  campaign: 'halls',
  anchor: '0x6a01',
  los: 'nlos',
  distance_m: '5,25',
  ...over,
});

describe('a number typed in the field', () => {
  it('has a comma or a point', () => expect([typed_number('5,25'), typed_number(' 5.25 ')]).toEqual([5.25, 5.25]));
  it('is none where the field is empty, and wrong where it is a word', () =>
    expect([typed_number(' '), typed_number('far')]).toEqual([null, undefined]));
});

describe('a place that can be measured', () => {
  it('needs campaign, anchor, label and distance', () =>
    expect(missing(NEW_PLACE)).toEqual(['campaign', 'anchor', 'LOS or NLOS', 'true distance']));
  it('needs nothing more', () => expect(missing(place())).toEqual([]));
  it('has possible numbers', () =>
    expect(missing(place({ heading_deg: '721', thickness_m: 'x', wanted: '0' })).length).toBe(3));
});

describe('the truth of a place', () => {
  it('goes along as the import takes it, empty fields left out', () =>
    expect(truth_query(place({ environment: ' room 1 ', material: 'brick', thickness_m: '0.14' }))).toEqual({
      environment: 'room 1',
      setting: '5.25 m, brick, NLOS',
      material: 'brick',
      distance_m: 5.25,
      thickness_m: 0.14,
      los: false,
    }));
  it('names the place where no name was typed', () =>
    expect(setting_of(place({ heading_deg: '45', height_difference_m: '0,5', los: 'los' }))).toBe(
      '5.25 m, 45 °, 0.5 m up, LOS',
    ));
  it('leaves a typed name as it is', () => expect(setting_of(place({ setting: ' by the door ' }))).toBe('by the door'));
});

describe('the lines that are sent', () => {
  it('carry range, time, levels and the response, and nothing the import does not know', () => {
    const lines = lines_of([
      { id: 7, t_us: 1_700_000_000_250_000, distance_m: 5.31, rss_dbm: -84, cir: { n: 1 } },
      { t_us: 2, distance_m: 5.3, rx_dbm: -80, rss_dbm: -84, fp_dbm: -86, std_noise: 40 },
    ]);
    expect(
      lines
        .trimEnd()
        .split('\n')
        .map((l): unknown => JSON.parse(l)),
    ).toEqual([
      { range_m: 5.31, t_s: 1_700_000_000.25, rx_dbm: -84, cir: { n: 1 } },
      { range_m: 5.3, t_s: 0.000002, rx_dbm: -80, fp_dbm: -86, std_noise: 40 },
    ]);
  });
});

describe('mean and standard deviation', () => {
  it('of 2, 4, 4, 4, 5, 5, 7, 9 are 5 and the root of 32/7', () => {
    const s = spread([2, 4, 4, 4, 5, 5, 7, 9]);
    expect(s.mean).toBe(5);
    expect(s.sd).toBeCloseTo(Math.sqrt(32 / 7), 12);
  });
  it('of one value has no deviation, of none no mean', () =>
    expect([spread([3]), spread([])]).toEqual([
      { n: 1, mean: 3, sd: null },
      { n: 0, mean: null, sd: null },
    ]));
});
