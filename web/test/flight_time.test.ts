import { describe, expect, it } from 'vitest';
import { flight_time_words, type FlightTime } from '../src/views/flight/flight_time_words';

const of = (more: Partial<FlightTime>): string =>
  flight_time_words({
    forecast_s: { low: 344, expected: 412, high: 563 },
    flown_s: 400,
    completed: true,
    plan_changed: false,
    against_forecast: 'within',
    ...more,
  });

describe('the flown time', () => {
  it('is shown beside its forecast, and where it lies', () => {
    expect(of({})).toBe('Flown in 06:40; forecast at Start 05:44 to 09:23: within the forecast.');
    expect(of({ flown_s: 695, against_forecast: 'longer' })).toBe(
      'Flown in 11:35; forecast at Start 05:44 to 09:23: 02:12 longer than forecast.',
    );
    expect(of({ flown_s: 300, against_forecast: 'shorter' })).toContain('00:44 shorter than forecast.');
  });
  it('is not compared where the two are not of one flight, and says why', () => {
    expect(of({ against_forecast: null, completed: false })).toContain('ended before its plan was flown');
    expect(of({ against_forecast: null, plan_changed: true })).toContain('the plan was changed in flight');
    expect(of({ against_forecast: null, forecast_s: null })).toBe('Flown in 06:40; nothing was forecast.');
  });
});
