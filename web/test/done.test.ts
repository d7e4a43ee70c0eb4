import { describe, expect, it } from 'vitest';
import { procedure } from '../src/live/flight_messages';
import { estimate, mission } from '../src/live/messages';
import { as_shown, done_count, goal_of, likelier } from '../src/state/done';
import { Scene } from '../src/state/scene';
import { STATUS_LOOK } from '../src/ui/marks';
import { why_not_done } from '../src/ui/words';

const goal = (h95_m: number) => ({ name: 'goal_h95_m', value: h95_m, limit: 0.25, passed: h95_m <= 0.25, why: '' });
const target = (sigma_m: number, limit: number) => ({
  name: 'target_sigma_m',
  value: sigma_m,
  limit,
  passed: sigma_m <= limit,
  why: '',
});
const anchor = (id: string, status: string, h95_m = 0.1) =>
  estimate({ mission: 'm', anchor: id, t_us: 1, status, verdict: 'ok', h95_m, gates: [goal(h95_m)] })!;
const flight = (tasks: object[], status = 'running') =>
  procedure({ mission: 'm', status, step: 'ranging', target_sigma_m: 0.03, anchors: tasks })!;
const task = (network_id: string, done: boolean, reached: boolean, why = '') => ({ network_id, done, reached, why });
const m = mission({ mission: 'm', anchors_found: 4, anchors_converged: 4 })!;

describe('an anchor is done', () => {
  it('by the word of the server where no procedure flies', () => {
    expect(as_shown(anchor('0x1', 'converged'), null).status).toBe('converged');
    expect(goal_of(anchor('0x1', 'estimating'))).toEqual({ of: 'h95', limit_m: 0.25 });
    expect(goal_of({ ...anchor('0x1', 'estimating'), gates: [target(0.4, 0.03)] })).toEqual({
      of: 'sigma',
      limit_m: 0.03,
    });
    expect(goal_of(null)).toBeNull();
  });
  it('when the procedure reached its target, not while it still works on it', () => {
    const p = flight([task('0x1', true, true), task('0x2', false, false, 'accuracy 0.083 m, wanted 0.030 m')]);
    expect(as_shown(anchor('0x1', 'converged'), p).status).toBe('converged');
    expect(as_shown(anchor('0x2', 'converged'), p).status).toBe('estimating');
  });
  it('for good once the procedure reached its target, unless another gate holds it back', () => {
    const p = flight([task('0x1', true, true), task('0x2', false, false)]),
      far = { ...anchor('0x1', 'estimating'), gates: [target(3.1, 3)] },
      shown = as_shown(far, p);
    expect(shown.status).toBe('converged');
    expect(shown.gates.map((g) => [g.name, g.limit, g.passed])).toEqual([['target_sigma_m', 3, true]]);
    expect(why_not_done(shown)).toBeNull();
    const near = as_shown({ ...anchor('0x2', 'estimating'), gates: [target(3.1, 3)] }, p);
    expect(near.status).toBe('estimating');
    expect(near.gates.map((g) => g.passed)).toEqual([false]);
    const held = { name: 'halves', value: 30, limit: 16, passed: false, why: '' };
    expect(as_shown({ ...far, gates: [...far.gates, held] }, p).status).toBe('estimating');
  });
  it('never when its time ran out, nor when the flight ended before: given up is not green', () => {
    for (const p of [flight([task('0x1', true, false)]), flight([task('0x1', false, false)], 'aborted')]) {
      const shown = as_shown(anchor('0x1', 'converged'), p);
      expect(shown.status).toBe('gave_up');
      expect(STATUS_LOOK[shown.status][1]).not.toBe('ok');
      expect(why_not_done(shown, 'time over: 300 s of 300 s')!.text).toBe('Time over: 300 s of 300 s.');
    }
    expect(as_shown(anchor('0x1', 'accepted'), flight([task('0x1', true, false)])).status).toBe('accepted');
    expect(as_shown(anchor('0x1', 'ambiguous'), flight([task('0x1', true, false)])).status).toBe('ambiguous');
  });
  it('when a person accepted it in flight, unless it is ambiguous; and reads so, not given up', () => {
    const p = flight([{ ...task('0x1', true, false, 'accepted by A. Pilot'), ended_by: 'A. Pilot', accepted: true }]);
    expect(as_shown(anchor('0x1', 'estimating'), p).status).toBe('accepted');
    expect(as_shown(anchor('0x1', 'ambiguous'), p).status).toBe('ambiguous');
    const s = new Scene('m');
    s.add_estimate(anchor('0x1', 'estimating'), 0);
    s.add_procedure(p, 0);
    expect(done_count(s, null)).toEqual({ done: 1, gave_up: 0, total: 1 });
  });
  it('in one number for every place of a screen', () => {
    const s = new Scene('m');
    for (const id of ['0x1', '0x2', '0x3']) s.add_estimate(anchor(id, 'converged'), 0);
    expect(done_count(s, m)).toEqual({ done: 3, gave_up: 0, total: 4 });
    const drawn = s.estimates_version;
    s.add_procedure(flight([task('0x1', true, true), task('0x2', true, false), task('0x9', false, false)]), 0);
    expect(s.estimates_version).toBeGreaterThan(drawn); // the map has to be drawn anew
    expect(done_count(s, m)).toEqual({ done: 2, gave_up: 1, total: 4 }); // 0x3 is not the procedure's business
    expect(done_count(new Scene('x'), m)).toEqual({ done: 4, gave_up: 0, total: 4 });
  });
});

describe('the likelier of two solutions', () => {
  const two = (probability: number, mirror_m: [number, number, number]) =>
    estimate({
      mission: 'm',
      anchor: '0x1',
      t_us: 1,
      status: 'ambiguous',
      verdict: 'ambiguous',
      enu_m: [0, 0, 2],
      lon: 3.7,
      lat: 51,
      probability,
      cov_enu_m2: [4, 1, 0.5, 9, 0.25, 1],
      ellipse95: { major_m: 7, minor_m: 4, azimuth_deg: 20 },
      mirror: { lon: 3.8, lat: 51, enu_m: mirror_m, probability: 1 - probability },
    })!;
  it('is the anchor, the other its mirror', () => {
    expect(likelier(two(0.6, [10, 0, 2])).enu_m).toEqual([0, 0, 2]);
    const e = as_shown(two(0.3, [10, 0, 2]), null);
    expect(e).toMatchObject({ enu_m: [10, 0, 2], lon: 3.8, probability: 0.7 });
    expect(e.mirror).toMatchObject({ enu_m: [0, 0, 2], lon: 3.7, probability: 0.3 });
    // Reflected in a north-south line: east changes its sign, azimuth 20 becomes 160.
    expect(e.cov_enu_m2).toEqual([4, -1, -0.5, 9, 0.25, 1]);
    expect(e.ellipse95!.azimuth_deg).toBeCloseTo(160, 9);
  });
  it('above or below keeps its horizontal part', () => {
    const e = likelier(two(0.3, [0, 0, 6]));
    expect(e.enu_m).toEqual([0, 0, 6]);
    expect(e.ellipse95!.azimuth_deg).toBe(20);
    expect(e.cov_enu_m2![1]).toBe(1);
  });
});
