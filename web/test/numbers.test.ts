import { describe, expect, it } from 'vitest';
import { estimate } from '../src/live/messages';
import {
  ecef_from_geodetic,
  ellipse_from_covariance,
  enu_from_geodetic,
  magnification,
  round_length,
  sigma_h,
} from '../src/map/enu';
import { accuracy, age, axis_m, bearing, clock, fixed, grouped, latlon, plain } from '../src/ui/format';
import { why_not_done } from '../src/ui/words';

describe('ENU', () => {
  it('puts the equator at the semi-major axis and the pole at the semi-minor one', () => {
    expect(ecef_from_geodetic({ lon: 0, lat: 0, h_m: 0 })[0]).toBeCloseTo(6378137, 6);
    expect(ecef_from_geodetic({ lon: 0, lat: 90, h_m: 0 })[2]).toBeCloseTo(6356752.314245, 5); // NIMA TR8350.2 table 3.1
  });
  it('agrees with the cartesian example of the EPSG guidance note 7-2 (9602)', () => {
    // 53°48'33.820"N 2°07'46.380"E 73.0 m -> X 3771793.968, Y 140253.342, Z 5124304.349
    const [x, y, z] = ecef_from_geodetic({ lat: 53 + 48 / 60 + 33.82 / 3600, lon: 2 + 7 / 60 + 46.38 / 3600, h_m: 73 });
    expect([x, y, z].map((v) => v.toFixed(2))).toEqual(['3771793.97', '140253.34', '5124304.35']);
  });
  it('is zero at its origin, up is height, and one metre of arc is one metre', () => {
    const o = { lon: 3.713, lat: 51.023, h_m: 55 };
    for (const v of enu_from_geodetic(o, o)) expect(v).toBeCloseTo(0, 9);
    expect(enu_from_geodetic({ ...o, h_m: 58 }, o)[2]).toBeCloseTo(3, 6);
    // Length of one second of latitude at 51.023°N is 30.905 m, of longitude 19.50 m (radii of curvature M and N cos lat)
    expect(enu_from_geodetic({ ...o, lat: o.lat + 1 / 3600 }, o)[1]).toBeCloseTo(30.905, 1);
    expect(enu_from_geodetic({ ...o, lon: o.lon + 1 / 3600 }, o)[0]).toBeCloseTo(19.5, 1);
  });
});

describe('95 % ellipse of a covariance', () => {
  const k = Math.sqrt(5.991464547);
  it('points east when east is loose, north when north is', () => {
    expect(ellipse_from_covariance([4, 0, 0, 1, 0, 1])).toMatchObject({ azimuth_deg: 90 });
    expect(ellipse_from_covariance([1, 0, 0, 4, 0, 1])!.azimuth_deg % 180).toBeCloseTo(0, 12);
    const e = ellipse_from_covariance([4, 0, 0, 1, 0, 1])!;
    expect([e.major_m, e.minor_m]).toEqual([expect.closeTo(2 * k, 8), expect.closeTo(k, 8)]);
  });
  it('points north-east for a positive and south-east for a negative correlation', () => {
    expect(ellipse_from_covariance([2, 1, 0, 2, 0, 1])!.azimuth_deg).toBeCloseTo(45, 9);
    expect(ellipse_from_covariance([2, -1, 0, 2, 0, 1])!.azimuth_deg).toBeCloseTo(135, 9);
  });
  it('is a line for a singular covariance and nothing for an impossible one', () => {
    expect(ellipse_from_covariance([1, 1, 0, 1, 0, 1])!.minor_m).toBeCloseTo(0, 6);
    expect(ellipse_from_covariance([-1, 0, 0, 1, 0, 1])).toBeNull();
    expect(ellipse_from_covariance([1, 5, 0, 1, 0, 1])).toBeNull();
  });
  it('gives the larger sigma', () => expect(sigma_h([4, 0, 0, 1, 0, 1])).toBeCloseTo(2, 9));
});

describe('scales', () => {
  it('are round', () => expect([0.034, 7, 49, 1].map(round_length)).toEqual([expect.closeTo(0.02, 9), 5, 20, 1]));
  it('magnify small ellipses and leave large ones', () => {
    expect(magnification([0.05, 0.06], 20)).toBe(20);
    expect(magnification([30], 20)).toBe(1);
    expect(magnification([], 20)).toBe(1);
  });
});

describe('format', () => {
  it('has a true minus, fixed decimals, and a dash for the unknown', () => {
    expect([fixed(-1.5, 2), fixed(-0.0001, 2), fixed(null, 2), fixed(NaN, 1), fixed(2, 3)]).toEqual([
      '−1.50',
      '0.00',
      '–',
      '–',
      '2.000',
    ]);
  });
  it('shows nine decimals of a degree in groups of three, and copies them plain', () => {
    expect(latlon(51.023181327)).toBe('51.023\u202f181\u202f327');
    expect(latlon(-0.1)).toBe('−0.100\u202f000\u202f000');
    expect(plain(-3.7134918, 9)).toBe('-3.713491800');
  });
  it('writes bearings with three digits', () =>
    expect([44, 0, 359.7, -90].map(bearing)).toEqual(['044', '000', '000', '270']));
  it('groups thousands, also negative ones', () =>
    expect([152823, -58992, 999].map(grouped)).toEqual(['152\u202f823', '−58\u202f992', '999']));
  it('runs clocks', () =>
    expect([clock(761), clock(12, true), clock(3725, true), clock(null)]).toEqual([
      '00:12:41',
      '00:12',
      '01:02:05',
      '–',
    ]));
  it('says ages and accuracies as people do', () => {
    expect([6000, 240_000, 7.2e6, Infinity].map(age)).toEqual(['6 s', '4 min', '2 h', 'long']);
    expect([0.0004, 0.008, 0.07, 0.41, 1.44, 21.3, null].map(accuracy)).toEqual([
      '±1 mm',
      '±8 mm',
      '±7 cm',
      '±41 cm',
      '±1.4 m',
      '±21 m',
      '–',
    ]);
  });
});

describe('what to do about a twin', () => {
  const twin = (e: number, u: number) =>
    why_not_done(
      estimate({
        anchor: '0x1',
        verdict: 'ambiguous',
        status: 'ambiguous',
        enu_m: [0, 0, 3],
        mirror: { enu_m: [e, 0, 3 + u], probability: 0.3 },
      })!,
    )!.text;
  it('is another height where the twin lies above', () => expect(twin(0.1, 7)).toMatch(/higher or lower/));
  it('is to leave the line where it lies beside', () => expect(twin(6, 0)).toMatch(/across/));
});

describe('a length on an axis', () => {
  it('has the unit a person would use, and no word where the axis has no room for one', () => {
    expect([100, 10, 1, 0.1, 0.01, 0.001].map(axis_m)).toEqual(['100 m', '10 m', '1 m', '10 cm', '1 cm', '1 mm']);
    expect(axis_m(null)).toBe('');
  });
});
