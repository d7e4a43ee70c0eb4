import { describe, expect, it, vi } from 'vitest';
vi.hoisted(() => {
  Object.assign(globalThis, { location: { search: '', hash: '' }, document: { baseURI: 'http://localhost/' } });
});
import { row_of_estimate, type AnchorRow } from '../src/api/anchors';
import { EMPTY, type Waypoint } from '../src/api/plans';
import { estimate } from '../src/live/messages';
import { geodetic_from_enu } from '../src/map/enu';
import { again } from '../src/views/fly_again';

const origin = { lon: 3.7131, lat: 51.0231, h_m: 0 };
const waypoint = (e: number, n: number, measure = true): Waypoint => {
  const { lon, lat } = geodetic_from_enu(e, n, origin);
  return {
    lon,
    lat,
    height_above_ground_m: 4,
    heading_deg: null,
    dwell_s: null,
    measure,
    turn: false,
    height_search: false,
  };
};
const anchor = (id: string, e: number, n: number, mirror?: readonly [number, number]): AnchorRow => {
  const at = geodetic_from_enu(e, n, origin),
    m = mirror && geodetic_from_enu(mirror[0], mirror[1], origin);
  const row = row_of_estimate(estimate({ mission: 'm', anchor: id, t_us: 1, status: 'estimating', ...at })!);
  return { ...row, lon: at.lon, lat: at.lat, mirror: m ? { ...m, enu_m: null, probability: 0.4 } : null };
};
/// Round a building of 60 by 20 m, 5 m off: every 5 m.
const ring: Waypoint[] = [];
for (let e = -5; e <= 65; e += 5) ring.push(waypoint(e, -5));
for (let n = 0; n <= 25; n += 5) ring.push(waypoint(65, n));
for (let e = 60; e >= -5; e -= 5) ring.push(waypoint(e, 25));

describe('fly again', () => {
  it('measures about the anchors that lack something, and seeks side and height at the nearest point of each', () => {
    const made = again({ ...EMPTY, name: 'Hall' }, ring, [anchor('0x6a21', 3, 3)])!;
    const measured = made.waypoints.filter((w) => w.measure);
    expect(measured.length).toBeGreaterThanOrEqual(4);
    expect(measured.length).toBeLessThanOrEqual(12);
    for (const w of measured) expect((w.lon - origin.lon) * 70_100).toBeLessThan(28.5);
    expect(made.waypoints.filter((w) => w.turn && w.height_search)).toHaveLength(1);
    expect(made.expected).toEqual(['0x6a21']);
    expect([made.id, made.revision, made.name]).toEqual([null, 0, 'Again: 0x6a21']);
    // It flies round the building between them, without measuring there.
    expect(made.waypoints.length).toBeGreaterThan(measured.length);
  });
  it('goes to both places of an ambiguous anchor', () => {
    const made = again(EMPTY, ring, [anchor('0x6a24', 0, 0, [60, 0])])!,
      east = made.waypoints.filter((w) => w.measure).map((w) => (w.lon - origin.lon) * 70_100);
    expect(Math.min(...east)).toBeLessThan(10);
    expect(Math.max(...east)).toBeGreaterThan(50);
  });
  it('has no plan where no anchor has a place, or nothing is measured', () => {
    expect(again(EMPTY, ring, [{ ...anchor('0x6a21', 0, 0), lon: null }])).toBeNull();
    expect(again(EMPTY, [waypoint(0, 0, false)], [anchor('0x6a21', 0, 0)])).toBeNull();
    expect(again(EMPTY, ring, [])).toBeNull();
  });
});
