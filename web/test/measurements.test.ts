import { describe, expect, it, vi } from 'vitest';
import {
  download_url,
  EVERYTHING,
  ranges_query,
  samples_query,
  type Filter,
  type Sample,
  type Source,
} from '../src/api/measurements';
import {
  every_of,
  histogram,
  level_at,
  percentile,
  PRINTED_LINE,
  sides,
  time_text,
  typed_time,
} from '../src/views/measurements/choice';

const sample = (id: number, over: Partial<Sample> = {}): Sample => ({
  id,
  t_us: id,
  who: '0x6a01',
  distance_m: id,
  rx_dbm: -80,
  truth_m: null,
  los: null,
  has_cir: false,
  features: {},
  predicted: null,
  ...over,
});

const flight: Source = { kind: 'mission', id: 'm1', name: 'flight' },
  rooms: Source = { kind: 'campaign', id: 'c/1', name: 'rooms' };
const query = (s: Source, over: Partial<Filter>): object =>
  s.kind === 'mission' ? ranges_query(s.id, { ...EVERYTHING, ...over }) : samples_query({ ...EVERYTHING, ...over });
describe('the filter of measurements', () => {
  it('asks for the whole flight when nothing is asked', () => expect(query(flight, {})).toEqual({ mission: 'm1' }));
  it('is the query of the server, zero and negative limits included', () =>
    expect(
      query(flight, {
        who: '0x6a02',
        label: 'none',
        cls: 'unclear',
        fix: 'float',
        min_m: 0,
        max_m: 12.5,
        min_dbm: -95,
        max_dbm: -70,
        since_us: 1,
        until_us: 2,
      }),
    ).toEqual({
      mission: 'm1',
      anchor: '0x6a02',
      label: 'none',
      class: 'unclear',
      fix: 'float',
      min_distance_m: 0,
      max_distance_m: 12.5,
      min_level_dbm: -95,
      max_level_dbm: -70,
      since: '1',
      until: '2',
    }));
  it('leaves time and fix out for a campaign, whose places may be settings', () => {
    expect(query(rooms, { who: 'room 1', fix: 'float', since_us: 1 })).toEqual({ environment: 'room 1' });
    expect(query(rooms, { who: 's1', by: 'setting' })).toEqual({ setting: 's1' });
  });
  it('goes into the file that is downloaded', () => {
    vi.stubGlobal('document', { baseURI: 'http://127.0.0.1:8420/#/measurements' });
    expect(download_url(rooms, { ...EVERYTHING, max_m: 5 }, 'ndjson')).toBe(
      'http://127.0.0.1:8420/api/v1/campaigns/c%2F1/samples?max_distance_m=5&format=ndjson',
    );
    vi.unstubAllGlobals();
  });
});

describe('a typed time', () => {
  it('is UTC', () => {
    expect(typed_time('1970-01-02T00:00:01')).toBe(86_401_000_000);
    expect(typed_time('1970-01-01T00:01')).toBe(60_000_000);
  });
  it('is none while it is half typed', () =>
    expect([typed_time(''), typed_time('2026-05'), typed_time('2026-13-40T10:00')]).toEqual([null, null, null]));
  it('reads back as it was', () => expect(time_text(typed_time('2026-05-04T10:09:30'))).toBe('2026-05-04T10:09:30'));
});

describe('what is drawn of many', () => {
  it('is all up to two thousand, then each n-th', () =>
    expect([null, 0, 2000, 2001, 1_000_000].map(every_of)).toEqual([1, 1, 1, 2, 500]));
});

describe('the RSS line', () => {
  it('is eq 5.1 at ten metres', () => expect(level_at(PRINTED_LINE, 10)).toBeCloseTo(-88.8685, 4));
  it('counts on-the-line as NLOS, and says nothing of a class it has not met', () => {
    const flat = { at_zero_dbm: -80, slope_dbm_per_m: 0 };
    expect(
      sides(
        [
          sample(1, { los: true, rx_dbm: -79 }),
          sample(2, { los: true, rx_dbm: -80 }),
          sample(3, { los: true, rx_dbm: null }),
        ],
        flat,
      ),
    ).toEqual({ los: 0.5, nlos: null });
    expect(sides([sample(1, { los: false, rx_dbm: -80 })], flat)).toEqual({ los: null, nlos: 1 });
  });
});

describe('the histogram of a feature', () => {
  it('counts every measurement once, outliers in the end bins', () => {
    const all = Array.from({ length: 200 }, (_, i) =>
        sample(i, { los: i % 2 === 0, features: { kurtosis: i === 199 ? 1e6 : i } }),
      ),
      h = histogram(all, 'kurtosis')!;
    const sum = (v: readonly number[]): number => v.reduce((a, b) => a + b, 0);
    expect(sum(h.los)).toBe(100);
    expect(sum(h.nlos)).toBe(100);
    expect(h.unlabelled.every((n) => n === 0)).toBe(true);
  });
  it('is absent where every value is the same', () =>
    expect(histogram([sample(1, { features: { a: 2 } }), sample(2, { features: { a: 2 } })], 'a')).toBeNull());
});

describe('the percentile of a feature', () => {
  it('is the share below', () => expect(percentile([1, 2, 3, 4, 5, 6, 7, 8, 9, 10], 4)).toBe(30));
  it('says nothing of fewer than five', () => expect(percentile([1, 2, 3, 4], 2)).toBeNull());
});
