import { describe, expect, it } from 'vitest';
import { grid } from '../src/live/flight_messages';
import { range } from '../src/live/messages';
import { Scene } from '../src/state/scene';
import { told_apart } from '../src/ui/format';
import { grid_measure, grid_outcome, turn_runs, value_words } from '../src/views/flight/words';
import { curve_mae } from '../src/views/models/mae';
import { last_seen_of_each, radio_state } from '../src/views/system/radio_state';

describe('a radio', () => {
  const scene = new Scene('m');
  scene.add_range(range({ t_us: 1, mission: 'm', tag: '0x6e01', anchor: '0x1', distance_m: 3 })!, 10_000);
  it('is live by what arrives now, tag and anchor alike', () => {
    expect(radio_state('0x1', [scene], 12_000)).toBe('live');
    expect(radio_state('0x6e01', [scene], 12_000)).toBe('live');
    expect(radio_state('0x1', [scene], 16_000)).toBe('late');
    expect(radio_state('0x1', [scene], 50_000)).toBe('lost');
  });
  it('of an old flight is not live because another one is recorded', () => {
    expect(radio_state('0x9', [scene], 12_000)).toBe('not in this flight');
    expect(radio_state('0x1', [], 12_000)).toBe('no flight');
  });
  it('that was in range in several flights is one row, last seen in the newest of them', () => {
    const seen = (network_id: string | null, last_seen_us: number | null) => ({ network_id, last_seen_us });
    expect(
      last_seen_of_each([seen('0x1', 20), seen('0x6e01', 20), seen('0x1', 900), seen('0x1', null), seen(null, 5)]),
    ).toEqual([seen('0x1', 900), seen('0x6e01', 20), seen(null, 5)]);
  });
});

describe('the next point', () => {
  const g = (o: object) => grid({ mission: 'm', candidates: [], ...o })!;
  it('has one number, in the unit of the reason: the root of a variance is metres', () => {
    // "lowest expected error: 0.127 m rms": the planner's value is its square.
    expect(value_words(g({ rule: 'a_optimal' }), 0.016129)).toBe('0.127 m');
    expect(value_words(g({ rule: 'dissertation' }), 6.25)).toBe('2.50');
    expect(value_words(g({ rule: 'd_optimal' }), -12.3)).toBe('−12.30');
    expect(value_words(g({ rule: 'a_optimal' }), null)).toBe('–');
    expect(grid_measure(g({ rule: 'a_optimal' }))).toBe('Expected error, rms');
  });
  it('is chosen only where the aircraft goes there', () => {
    expect(
      grid_outcome({ chosen: 3, outcome: 'done_here: the best point would improve the result by only 1 %' }),
    ).toMatchObject({
      word: 'ENOUGH HERE',
      why: 'the best point would improve the result by only 1 %',
      flown: false,
    });
    expect(grid_outcome({ chosen: null, outcome: 'no_point: no point left to fly to' }).word).toBe('NO POINT');
    expect(grid_outcome({ chosen: 3, outcome: 'point: 33 % better' })).toMatchObject({ word: 'CHOSEN', tone: 'ok' });
  });
});

describe('the MAE beside a curve', () => {
  const scores = (mae_m: number | null, mae_raw_m: number | null = null) => ({
    accuracy: null,
    fpr: null,
    mae_m,
    mae_raw_m,
    brier: null,
    confusion: null,
  });
  it('without correction is that of the raw ranges, never that of a model', () => {
    const run = {
      results: [{ name: 'mixture of a, quantile 0.5', method: 'none', cv: scores(0.021), test: null }],
      test: scores(0.021, 0.112),
      metrics: scores(0.02, 0.11),
    } as unknown as Parameters<typeof curve_mae>[1];
    expect(curve_mae({ method: 'none' }, run)).toBe(0.112);
    expect(curve_mae({ method: 'mixture of a, quantile 0.5' }, run)).toBe(0.021);
  });
});

describe('flights of one name', () => {
  const flight = (name: string, started_us: number | null) => ({ name, started_us });
  it('are told apart by their time, others keep their name', () => {
    const list = [
      flight('demonstration', 1_777_889_472e6),
      flight('demonstration', 1_777_893_072e6),
      flight('hall', 1),
    ];
    expect([...told_apart(list).values()]).toEqual([
      'demonstration, 2026-05-04 10:11 UTC',
      'demonstration, 2026-05-04 11:11 UTC',
      'hall',
    ]);
  });
});

describe('a turn', () => {
  it('is closed round the compass where it was looked at, and open where not', () => {
    const all = Array.from({ length: 36 }, (_, i): [number, number] => [i * 10, -80]);
    expect(turn_runs(all)).toHaveLength(1);
    expect(turn_runs(all)[0]!.at(-1)).toEqual([360, -80]); // north again
    const half = turn_runs(all.filter(([deg]) => deg <= 90 || (deg >= 180 && deg < 300)));
    expect(half.map((r) => [r[0]![0], r.at(-1)![0]])).toEqual([
      [0, 90],
      [180, 290],
    ]);
    expect(turn_runs([])).toEqual([]);
  });
});
