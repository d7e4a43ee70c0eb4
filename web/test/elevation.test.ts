import { describe, expect, it } from 'vitest';
import { along, building_bearing, extent, fit, intervals95, wind } from '../src/map/elevation';

describe('the side elevation', () => {
  it('puts to the right what lies in the direction looked along', () => {
    expect(along(90, [3, 4])).toBeCloseTo(3, 12); // west to east: east to the right
    expect(along(0, [3, 4])).toBeCloseTo(4, 12); // south to north
    expect(along(270, [3, 4])).toBeCloseTo(-3, 12);
    // 36.87 degrees east of north is the direction of (3, 4): its whole length.
    expect(along(36.86989764584402, [3, 4, 9])).toBeCloseTo(5, 12);
  });
  it('takes the 95 % interval along the picture from the covariance of that direction', () => {
    // East and north fully correlated: all of it along 045, none across. Sigma of the sum: 0.1 * sqrt 2.
    const cov_enu_m2 = [0.01, 0.01, 0, 0.01, 0, 0.04];
    expect(intervals95({ cov_enu_m2, v95_m: null }, 45)!.along_m).toBeCloseTo(1.96 * 0.1 * Math.SQRT2, 4);
    expect(intervals95({ cov_enu_m2, v95_m: null }, 135)!.along_m).toBeCloseTo(0, 6);
    expect(intervals95({ cov_enu_m2, v95_m: null }, 135)!.up_m).toBeCloseTo(1.96 * 0.2, 4);
    expect(intervals95({ cov_enu_m2, v95_m: 0.5 }, 135)!.up_m).toBe(0.5); // the server's word wins: it knows the mirror
    expect(intervals95({ cov_enu_m2: null, v95_m: 0.5 }, 0)).toBeNull();
    expect(intervals95({ cov_enu_m2: [0.01, 0, 0, 0.01, 0, -1], v95_m: null }, 0)).toBeNull();
  });
  it('looks along the longest wall, whichever way round it is drawn', () => {
    const hall = [
      [0, 0],
      [30, 30],
      [20, 40],
      [-10, 10],
    ] as const;
    expect(building_bearing(hall)).toBeCloseTo(45, 9);
    expect(building_bearing([...hall].reverse())).toBeCloseTo(45, 9);
    expect(building_bearing([])).toBe(90);
  });
  it('keeps true proportions, and makes heights larger only by a whole number that leaves them inside', () => {
    // 60 m by 12 m into 900 x 180 px: 15 px a metre fills both.
    expect(fit({ s0: -30, s1: 30, u0: 0, u1: 12 }, 900, 180)).toEqual({
      px_per_m: 15,
      up_px_per_m: 15,
      exaggeration: 1,
    });
    // 300 m by 12 m: 3 px a metre, and five times that is 180 px.
    expect(fit({ s0: 0, s1: 300, u0: 0, u1: 12 }, 900, 180)).toEqual({ px_per_m: 3, up_px_per_m: 15, exaggeration: 5 });
    // Higher than wide: the heights decide.
    expect(fit({ s0: 0, s1: 10, u0: 0, u1: 60 }, 900, 180)).toEqual({ px_per_m: 3, up_px_per_m: 3, exaggeration: 1 });
  });
  it('has no extent while nothing is known, and names directions by the wind', () => {
    expect(extent([])).toBeNull();
    expect(extent([[1, 2]])).toEqual({ s0: 1, s1: 1, u0: 2, u1: 2 });
    expect([0, 44, 90, 180, 270, 359, -90].map(wind)).toEqual(['N', 'NE', 'E', 'S', 'W', 'N', 'W']);
  });
});
