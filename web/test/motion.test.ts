import { expect, test } from 'vitest';
import { pose } from '../src/live/messages';
import { ms_a_pixel } from '../src/map/motion';
import { Scene } from '../src/state/scene';

const at = (t_s: number, e: number, heading_deg = 350) =>
  pose({ mission: 'm', t_us: t_s * 1e6, enu_m: [e, 0, 5], fix: 'fixed', heading_deg })!;

test('knows how long the drone takes to move by a pixel, or to turn by what one sees', () => {
  const s = new Scene('m');
  expect(ms_a_pixel(s, 10)).toBe(Infinity);
  s.add_pose(at(0, 0), 0);
  expect(ms_a_pixel(s, 10)).toBe(Infinity);
  s.add_pose(at(0.1, 0.2), 100); // 2 m/s
  expect(ms_a_pixel(s, 10)).toBeCloseTo(50, 6);
  expect(ms_a_pixel(s, 40)).toBeCloseTo(12.5, 6);
  s.add_pose(at(0.2, 0.2), 200);
  expect(ms_a_pixel(s, 10)).toBe(Infinity);
  s.add_pose(at(0.3, 0.2, 10), 300); // by 20 degrees, through north
  expect(ms_a_pixel(s, 10)).toBeCloseTo(10, 6);
});
