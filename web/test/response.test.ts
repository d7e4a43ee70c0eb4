import { describe, expect, it } from 'vitest';
import { impulse_of, type Impulse } from '../src/api/measurements';
import { marks_of, ns_of, ordered, shown_taps, summary, unit_of } from '../src/views/measurements/response';

/// 1016 taps as the DW1000 gives them: noise of 10, first path at tap 740, strongest at 743.
const record = (over: Partial<Impulse> = {}): Impulse => {
  const magnitude = new Array<number>(1016).fill(10);
  magnitude[740] = 400;
  magnitude[743] = 1000;
  return { tap_ns: 1, first_path: 740, magnitude, ...over };
};

describe('an impulse response from the wire', () => {
  it('is the length of each pair of int16, little endian', () => {
    // 3, 4 and -5, 12 by hand: 03 00 04 00 fb ff 0c 00
    expect(impulse_of({ n: 2, dt_ps: 1001.6, first_path_idx: 0.5, b64: 'AwAEAPv/DAA=' })).toEqual({
      tap_ns: 1.0016,
      first_path: 0.5,
      magnitude: [5, 13],
    });
  });
  it('is none without taps', () => expect(impulse_of({ n: 0, b64: '' })).toBeNull());
  it('has the spacing of the DW1000 where none is named', () =>
    expect(impulse_of({ n: 1, b64: 'AwAEAA==' })!.tap_ns).toBeCloseTo(1 / (2 * 0.4992), 3));
});

describe('the marks of an impulse response', () => {
  it('are first path, strongest tap and the rms of the taps before any path', () => {
    const m = marks_of(record(), { mean_excess_delay_ns: 12.5, rms_delay_spread_ns: 4 });
    expect(m).toMatchObject({ first: 740, peak: 743, mean_ns: 12.5, spread_ns: 4 });
    expect(m.noise).toBeCloseTo(10, 9);
  });
  it('take the first path from the server where the radio did not say', () =>
    expect(marks_of(record({ first_path: null }), { peak_delay_ns: 2.5 }).first).toBeCloseTo(740.5, 9));
  it('stand at the strongest tap where nobody says', () =>
    expect(marks_of(record({ first_path: null }), {}).first).toBe(743));
  it('have no noise floor where the record begins at the signal', () =>
    expect(marks_of(record({ magnitude: [1, 2, 9, 4], first_path: 1 }), {}).noise).toBeNull());
  it('count time from the first path', () => expect(ns_of(record({ tap_ns: 2 }), marks_of(record(), {}), 743)).toBe(6));
});

describe('the taps that are drawn', () => {
  it('lie from 20 ns before the first path to 120 ns after it', () =>
    expect(shown_taps(record(), marks_of(record(), {}), false)).toEqual([720, 861]));
  it('are all of them when asked', () => expect(shown_taps(record(), marks_of(record(), {}), true)).toEqual([0, 1016]));
  it('end where a short record ends', () =>
    expect(
      shown_taps(
        record({ magnitude: [1, 2, 9, 4], first_path: 1 }),
        marks_of(record({ magnitude: [1, 2, 9, 4], first_path: 1 }), {}),
        false,
      ),
    ).toEqual([0, 4]));
});

describe('the words for the plot', () => {
  it('say every mark, with its unit', () => {
    const features = { mean_excess_delay_ns: 12.5, rms_delay_spread_ns: 4, kurtosis: 31.2 };
    expect(summary(record(), marks_of(record(), features), features)).toBe(
      'Impulse response of 1016 taps, 1.00 ns each, first path at tap 740.0, strongest 3.0 ns after it, 40 dB ' +
        'above the noise floor of 10.0, mean excess delay 12.5 ns, RMS delay spread 4.0 ns, kurtosis 31.2',
    );
  });
  it('leave out what is not known', () =>
    expect(
      summary(
        record({ magnitude: [1, 2, 9, 4], first_path: 1 }),
        marks_of(record({ magnitude: [1, 2, 9, 4], first_path: 1 }), {}),
        {},
      ),
    ).toBe('Impulse response of 4 taps, 1.00 ns each, first path at tap 1.0, strongest 1.0 ns after it'));
});

describe('the features in a list', () => {
  it('begin with the shape of the response and the levels', () =>
    expect(ordered(['range_m', 'fp_dbm', 'kurtosis', 'mean_excess_delay_ns'])).toEqual([
      'mean_excess_delay_ns',
      'kurtosis',
      'fp_dbm',
      'range_m',
    ]));
  it('have the unit their name ends in', () =>
    expect(['peak_delay_ns', 'rx_dbm', 'rx_minus_fp_db', 'range_m', 'kurtosis', 'fp_index'].map(unit_of)).toEqual([
      'ns',
      'dBm',
      'dB',
      'm',
      '',
      '',
    ]));
});
