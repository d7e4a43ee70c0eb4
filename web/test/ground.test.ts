import { describe, expect, it, vi } from 'vitest';
vi.hoisted(() => {
  Object.assign(globalThis, { location: { search: '', hash: '' }, document: { baseURI: 'http://localhost/' } });
});
import { EMPTY } from '../src/api/plans';
import { mission, pose } from '../src/live/messages';
import { geodetic_from_enu } from '../src/map/enu';
import { Scene } from '../src/state/scene';
import { around, corners_of_walk, no_corner, plan_content, rover_of, walked } from '../src/views/plan/ground';
import type { Point } from '../src/views/plan/tools';

const origin = { lon: 3.7131, lat: 51.0231, h_m: 0 };
/// A walk along straight walls, a step every quarter of a metre, with the sideways error of a hand.
function walk(corners: readonly Point[], wobble: (i: number) => number): Point[] {
  const out: Point[] = [];
  corners.forEach((a, k) => {
    const b = corners[(k + 1) % corners.length]!,
      l = Math.hypot(b[0] - a[0], b[1] - a[1]),
      [ux, uy] = [(b[0] - a[0]) / l, (b[1] - a[1]) / l];
    for (let d = 0; d < l; d += 0.25) {
      const w = wobble(out.length);
      out.push([a[0] + ux * d - uy * w, a[1] + uy * d + ux * w]);
    }
  });
  return out;
}
const hall: Point[] = [
  [0, 0],
  [30, 0],
  [30, 20],
  [12, 20],
  [12, 12],
  [0, 12],
];

describe('an outline walked with the rover', () => {
  it('has the corners of the building, within what a hand wobbles', () => {
    const found = corners_of_walk(walk(hall, (i) => 0.08 * Math.sin(i * 1.7)));
    expect(found).toHaveLength(6);
    for (const c of hall) expect(Math.min(...found.map((f) => Math.hypot(f[0] - c[0], f[1] - c[1])))).toBeLessThan(0.4);
  });
  it('has no corner where the walk began in the middle of a wall', () => {
    const path = walk(hall, () => 0),
      turned = [...path.slice(40), ...path.slice(0, 40)]; // begins 10 m along the first wall
    const found = corners_of_walk(turned);
    expect(found).toHaveLength(6);
    expect(found.some((f) => Math.hypot(f[0] - 10, f[1]) < 1)).toBe(false);
  });
  it('is left as it is with fewer than three places', () => {
    expect(corners_of_walk([])).toEqual([]);
    expect(corners_of_walk([[1, 2]])).toEqual([[1, 2]]);
  });
  it('has every place with RTK since it began, a quarter of a metre apart, about the origin of the plan', () => {
    const s = new Scene('m'),
      add = (t_s: number, e: number, fix: string): void => {
        const g = geodetic_from_enu(e + 50, 7, origin); // the flight's own origin is 50 m east, 7 m north
        s.add_pose(pose({ mission: 'm', t_us: t_s * 1e6, lon: g.lon, lat: g.lat, h_m: 5, fix, enu_m: [e, 0, 5] })!, 0);
      };
    add(1, 0, 'fixed'); // before it began
    add(2, 1, 'fixed');
    add(3, 1.15, 'fixed'); // too near
    add(4, 1.3, 'float');
    add(5, 2, 'single'); // no RTK
    add(6, 3, 'fixed');
    const path = walked(s, 2e6, origin);
    expect(path.map(([e]) => Math.round(e * 100) / 100)).toEqual([51, 51.3, 53]);
    for (const [, n] of path) expect(n).toBeCloseTo(7, 2);
    expect(walked(null, 0, origin)).toEqual([]);
  });
  it('sets no corner without a fresh position that has RTK', () => {
    const at = (fix: string, age_ms: number) => {
      const s = new Scene('m');
      s.add_pose(pose({ mission: 'm', t_us: 1e6, ...origin, fix, enu_m: [0, 0, 5] })!, 10_000);
      return rover_of(s, origin, 10_000 + age_ms, false);
    };
    expect(no_corner(at('fixed', 0))).toBe('');
    expect(no_corner(at('float', 0))).toBe('');
    expect(no_corner(null)).toMatch(/no position/);
    expect(no_corner(at('single', 0))).toMatch(/FIX or FLOAT/);
    expect(no_corner(at('fixed', 2500))).toMatch(/silent/);
  });
  it('sets no corner and shows nothing as fresh while the link is lost, however lately the position came', () => {
    const s = new Scene('m');
    s.add_pose(pose({ mission: 'm', t_us: 1e6, ...origin, fix: 'fixed', enu_m: [0, 0, 5] })!, 10_000);
    const rover = rover_of(s, origin, 10_400, true);
    expect(rover).toMatchObject({ fresh: false, age_ms: 400 });
    expect(no_corner(rover)).toMatch(/silent/);
    expect(rover_of(s, origin, 10_400, false)!.fresh).toBe(true);
  });
});

describe('the plan from the side', () => {
  it('shows the flight about the ground of the plan', () => {
    const g = geodetic_from_enu(40, 10, origin),
      flight = mission({
        mission: 'm',
        name: 'm',
        state: 'recording',
        frame: 'wgs84',
        t_us: 1,
        origin: { ...g, h_m: 57 },
      })!,
      scene = new Scene('m');
    scene.add_pose(pose({ mission: 'm', t_us: 1e6, ...g, h_m: 60, fix: 'fixed', enu_m: [0, 0, 3] })!, 0);
    // The plan says where its ground is: 55 m above the ellipsoid; the aircraft at 60 m is 5 m above it.
    const plan = { ...EMPTY, rest: { origin: { lon: origin.lon, lat: origin.lat, h_m: 55 } } },
      near = around(plan, origin, flight, scene)!;
    const flying = { running: true, link_lost: false };
    const made = plan_content(plan, origin, scene, near, new Map(), flying, null).scene!.pose!.value.enu_m!;
    expect(made[0]).toBeCloseTo(40, 3);
    expect(made[1]).toBeCloseTo(10, 3);
    expect(made[2]).toBeCloseTo(5, 9);
    // Without a height of its own, the lowest place of the track is the ground.
    expect(around(EMPTY, origin, flight, scene)!.ground_h_m).toBeCloseTo(60, 9);
    // A flight of another town is not of this plan.
    const far = mission({ ...flight, origin: { lon: 4.7, lat: 51, h_m: 0 } })!;
    expect(around(plan, origin, far, scene)).toBeNull();
  });
});
