import { describe, expect, it } from 'vitest';
import { body_of, EMPTY, type Plan } from '../src/api/plans';
import { enu_from_geodetic, geodetic_from_enu } from '../src/map/enu';
import {
  added,
  begun,
  changed,
  corners,
  from_m,
  moved,
  NEW_WAYPOINT,
  origin_of,
  redone,
  removed,
  to_m,
  undone,
} from '../src/views/plan/draft';

const ORIGIN = { lon: 3.7131, lat: 51.0231, h_m: 0 };
const square: Plan = {
  ...EMPTY,
  name: 'Hall',
  building_height_m: 8,
  outline: [
    [0, 0],
    [30, 0],
    [30, 20],
    [0, 20],
  ].map(([e, n]) => from_m(e!, n!, ORIGIN)),
};

describe('metres of the plan map', () => {
  it.each([
    [0, 0],
    [250, -400],
    [-999, 750],
  ])('come back as they went, %d %d', (e, n) => {
    const [e2, n2] = enu_from_geodetic(geodetic_from_enu(e, n, ORIGIN), ORIGIN);
    expect(Math.hypot(e2 - e, n2 - n)).toBeLessThan(1e-6);
  });
  it('work near the pole and south of the equator', () => {
    for (const lat of [-33.9, 84]) {
      const o = { lon: 179.9999, lat, h_m: 0 };
      expect(to_m(from_m(120, -80, o), o)[0]).toBeCloseTo(120, 6);
    }
  });
  it('are about the middle of the outline', () => {
    const o = origin_of(square, null)!;
    expect(to_m({ lon: o.lon, lat: o.lat }, ORIGIN)).toEqual([expect.closeTo(15, 4), expect.closeTo(10, 4)]);
  });
  it('have no place while nothing is drawn and no flight is known', () => expect(origin_of(EMPTY, null)).toBeNull());
});

describe('a draft', () => {
  const c = { lon: 3.7, lat: 51 };
  it('gives a new waypoint the height and flags of the last one', () => {
    const one = added(EMPTY, 'waypoints', c),
      taller = { ...one, waypoints: [{ ...one.waypoints[0]!, height_above_ground_m: 9, turn: true }] };
    expect(added(taller, 'waypoints', c).waypoints[1]).toMatchObject({ height_above_ground_m: 9, turn: true });
  });
  it('starts a waypoint from the defaults', () => {
    expect(corners(added(EMPTY, 'waypoints', { lon: 1, lat: 2 }), 'waypoints')[0]).toMatchObject({ lon: 1, lat: 2 });
    expect(NEW_WAYPOINT.height_above_ground_m).toBe(4);
  });
  it('keeps the other points when one is moved', () => {
    const m = moved(square, { shape: 'outline', index: 1 }, c);
    expect(m.outline[1]).toMatchObject(c);
    expect(m.outline[0]).toBe(square.outline[0]);
  });
  it('loses a no-fly area with its last corner', () => {
    const p = added(square, 'no_fly/0', c);
    expect(p.no_fly).toHaveLength(1);
    expect(removed(p, { shape: 'no_fly/0', index: 0 }).no_fly).toHaveLength(0);
  });
  it('undoes and redoes', () => {
    const h = changed(begun(EMPTY), square);
    expect(undone(h).now).toBe(EMPTY);
    expect(redone(undone(h)).now).toBe(square);
  });
  it('remembers fifty steps', () => {
    let h = begun(EMPTY);
    for (let i = 0; i < 80; i++) h = changed(h, { ...EMPTY, name: String(i) });
    expect(h.before).toHaveLength(50);
  });
  it('is sent as a closed ring, and an unfinished area as none', () => {
    const body = body_of(added(square, 'fence', c)) as { outline: { coordinates: number[][][] }; fence: unknown };
    expect(body.outline.coordinates[0]).toHaveLength(5);
    expect(body.outline.coordinates[0]![0]).toEqual(body.outline.coordinates[0]![4]);
    expect(body.fence).toBeNull();
  });
});
