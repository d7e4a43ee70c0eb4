import { expect, test } from 'vitest';
import type { PlanDifference } from '../src/api/plans';
import { difference_lines, next_words } from '../src/views/flight/change_words';

const time = { low: 60, expected: 90, high: 120 };
const difference = (more: Partial<PlanDifference>): PlanDifference => ({
  mission: 'm',
  from_revision: 1,
  to_revision: 2,
  takeable: true,
  refused: [],
  notes: [],
  next_waypoint: 3,
  n_waypoints: 6,
  waypoints: [],
  areas: [],
  anchors_added: [],
  anchors_removed: [],
  anchor_targets: [],
  settings: [],
  forecast_before_s: time,
  forecast_after_s: time,
  ...more,
});

test('a change is told in sentences with their units, and what is passed is said to be not flown', () => {
  const lines = difference_lines(
    difference({
      waypoints: [
        { change: 'moved', before: 1, after: 1, moved_m: 2.504, passed: true },
        { change: 'added', before: null, after: 4, moved_m: 0, passed: false },
        { change: 'removed', before: 5, after: null, moved_m: 0, passed: false },
      ],
      areas: [
        { area: 'no_fly', change: 'added', before: null, after: 1 },
        { area: 'fence', change: 'moved', before: null, after: null },
      ],
      anchors_added: ['0x6a21'],
      anchor_targets: [{ network_id: '0x6a21', before: null, after: 0.015 }],
      settings: [
        { name: 'target_sigma_m', before: 0.05, after: 0.02 },
        { name: 'min_battery', before: 0.3, after: 0.4 },
        { name: 'turn', before: true, after: false },
        { name: 'max_flight_s', before: null, after: 600 },
      ],
    }),
  );
  expect(lines).toEqual([
    'Waypoint 1 moved by 2.50 m, already passed: not flown',
    'Waypoint 4 added',
    'Waypoint 5 of the flown plan removed',
    'No-fly area 1 added',
    'Fence changed',
    'Expected as well: 0x6a21',
    'Target sigma of 0x6a21: that of the plan, now 0.015 m',
    'Target sigma 0.05 m, now 0.02 m',
    'Min battery 30 %, now 40 %',
    'Turn on, now off',
    'Max flight none, now 600 s',
  ]);
});
test('where it goes on is a number of the new plan, or the way home', () => {
  expect(next_words(difference({}))).toBe('From waypoint 3 of 6 on');
  expect(next_words(difference({ next_waypoint: 7 }))).toBe('No waypoint is left: it returns after this one');
});
