import { describe, expect, it } from 'vitest';
import { estimate, pose, range, type RangeMsg } from '../src/live/messages';
import { trail_of } from '../src/state/archive';
import { interpolated, range_class, rate_hz, Scene } from '../src/state/scene';

const at = (t_s: number, e: number, extra: object = {}) =>
  pose({ mission: 'm', t_us: t_s * 1e6, enu_m: [e, 0, 5], fix: 'fixed', heading_deg: 350, ...extra })!;
const heard = (t_s: number, d: number): RangeMsg =>
  range({ t_us: t_s * 1e6, mission: 'm', anchor: '0x1', distance_m: d, used: true })!;

describe('Scene', () => {
  it('does not fill the trail while the drone stands still', () => {
    const s = new Scene('m');
    for (let i = 0; i < 100; i++) s.add_pose(at(i * 0.01, 0.0001 * i), i);
    expect(s.trail.length).toBe(1);
  });
  it('starts the trail anew when a looped replay jumps back', () => {
    const s = new Scene('m');
    s.add_pose(at(0, 0), 0);
    s.add_pose(at(100, 50), 100);
    s.add_pose(at(0, 0), 200);
    expect(s.trail).toHaveLength(1);
  });
  it('keeps 20 s of ranges and knows their rate', () => {
    const s = new Scene('m');
    for (let i = 0; i <= 300; i++) s.add_range(heard(i / 10, 3), i);
    const row = s.ranges.get('0x1')!;
    expect(row.recent[0]!.t_us).toBe(10e6);
    expect(rate_hz(row)).toBeCloseTo(10, 6);
  });
  it('does not let an older range replace a newer one', () => {
    const s = new Scene('m');
    s.add_range(heard(2, 5), 0);
    s.add_range(heard(1, 9), 1);
    expect(s.ranges.get('0x1')!.last.distance_m).toBe(5);
  });
  it('moves the drone evenly between two poses and through north the short way', () => {
    const s = new Scene('m');
    s.add_pose(at(0, 0), 0);
    s.add_pose(at(0.1, 1, { heading_deg: 10 }), 100);
    const half = interpolated(s, 150)!;
    expect(half.body[0]).toBeCloseTo(0.5, 9);
    expect(half.heading_deg).toBeCloseTo(360, 9);
    expect(interpolated(s, 5000)!.body[0]).toBe(1);
  });
  it('calls a range unclear without a model or between 0.4 and 0.6', () => {
    expect([null, 0.4, 0.5, 0.6, 0.61, 0.39].map(range_class)).toEqual([
      'unclear',
      'unclear',
      'unclear',
      'unclear',
      'los',
      'nlos',
    ]);
  });
});

describe('the trail after a reload', () => {
  const feature = {
    geometry: {
      coordinates: [
        [3.7131, 51.0231, 10],
        [3.71310143, 51.0231, 10],
      ],
    },
    properties: { t_us: [1e6, 2e6], fix: ['fixed' as const, 'float' as const], local_m: null },
  };
  it('is in metres about the origin of the flight', () => {
    const [first, second] = trail_of(feature, { lon: 3.7131, lat: 51.0231, h_m: 10 });
    expect([first!.e, first!.n, first!.fix]).toEqual([0, 0, 'fixed']);
    expect(second!.e).toBeCloseTo(0.1003, 3); // 1.43e-6 deg of longitude at 51 deg north, N cos(lat) = 4 020 km
  });
  it('is empty on the globe without an origin', () => expect(trail_of(feature, null)).toEqual([]));
  it('comes before what the stream has told', () => {
    const scene = new Scene('m');
    scene.trail = [{ t_us: 3e6, e: 5, n: 5, u: 0, fix: 'fixed' }];
    scene.add_earlier_trail(trail_of(feature, { lon: 3.7131, lat: 51.0231, h_m: 10 }));
    expect(scene.trail.map((p) => p.t_us)).toEqual([1e6, 2e6, 3e6]);
  });
});

describe('the convergence of a page that was opened late', () => {
  it('begins with the flight: what the server estimated before comes first, what the page saw stays', () => {
    const scene = new Scene('m'),
      at = (t_s: number, h95_m: number) =>
        estimate({ mission: 'm', anchor: '0x6a21', t_us: t_s * 1e6, status: 'estimating', h95_m })!;
    scene.add_estimate(at(100, 1), 0);
    scene.add_estimate(at(101, 0.9), 0);
    scene.add_earlier_estimates([at(2, 9), at(50, 3), at(100.5, 7), { ...at(10, 4), anchor: '0x6a22' }]);
    expect(scene.history.get('0x6a21')!.map((h) => h.h95_m)).toEqual([9, 3, 1, 0.9]);
    expect(scene.history.get('0x6a22')!.map((h) => h.h95_m)).toEqual([4]);
    expect(scene.anchors.size).toBe(1); // no estimate is made newer by what was before
  });
});
