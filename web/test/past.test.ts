import { describe, expect, it } from 'vitest';
import { past_of } from '../src/api/anchors';

const published = (revision: number, lon: number, lat: number, h_m: number): object => ({
  revision,
  published_at: '2026-05-04T10:11:12.000000Z',
  calibration: 'c',
  network_id: '0x6a2f',
  verdict: 'ok',
  geometry: { type: 'Point', coordinates: [lon, lat, h_m] },
  accuracy: { relative: { h95_m: 0.05, v95_m: 0.08 } },
});

describe('the published positions of an anchor', () => {
  it('tell how far each is from the one before', () => {
    // On the equator a millionth of a degree of latitude is 0.110574 m of the WGS84 meridian.
    const [newest, oldest] = past_of([published(2, 3, 1e-6, 10.02), published(1, 3, 0, 10)]);
    expect(newest!.horizontal_m).toBeCloseTo(0.110574, 5);
    expect(newest!.vertical_m).toBeCloseTo(0.02, 6);
    expect(oldest).toMatchObject({ revision: 1, h95_m: 0.05, v95_m: 0.08, horizontal_m: null, vertical_m: null });
  });
  it('are none of an anchor that never was', () => expect(past_of(null)).toEqual([]));
});
