import { expect, it } from 'vitest';
import { alarms_at, decision_at, places_at, procedure_at } from '../src/state/moment';
import type { Mark } from '../src/state/recording';

const at = (s: number, code: string, text: string, level = 'info', place: Mark['place'] = null): Mark => ({
  t_us: s * 1e6,
  code,
  text,
  level,
  place,
});
const marks = [
  at(1, 'control.taken', 'operator has control'),
  at(5, 'procedure.take_off', 'started by the operator'),
  at(20, 'procedure.go_to_waypoint', 'in the air, to the first waypoint'),
  at(22, 'alarm.raised', 'rtk.lost: no RTK for 2.1 s', 'critical'),
  at(25, 'alarm.cleared', 'rtk.lost is over'),
  at(30, 'procedure.ranging', 'anchors in range, ranging'),
  at(34, 'procedure.find_next_point', 'enough ranges at this point'),
  at(34, 'anchor.done', '0x6a21: accuracy reached: 0.041 m, wanted 0.050 m'),
  at(35, 'procedure.plan_changed', 'Hall: revision 2 is flown'),
  at(40, 'alarm.raised', 'uwb.none: no range for 5 s: check the tag', 'warning'),
];

it('is the step of that moment with its reason and its time, and nothing before the take-off', () => {
  expect(procedure_at(marks, 4e6)).toBeNull();
  expect(procedure_at(marks, 21e6)).toMatchObject({
    step: 'go_to_waypoint',
    reason: 'in the air, to the first waypoint',
    since_us: 20e6,
    started_us: 5e6,
    iteration: 0,
    reached: [],
  });
  expect(procedure_at(marks, 33e6)).toMatchObject({ step: 'ranging', iteration: 0 });
  expect(procedure_at(marks, 36e6)).toMatchObject({
    step: 'find_next_point',
    iteration: 1,
    reached: ['0x6a21: accuracy reached: 0.041 m, wanted 0.050 m'],
  });
});
it('begins anew with a second flight of the same mission', () => {
  const second = [...marks, at(60, 'procedure.done', 'landed'), at(90, 'procedure.take_off', 'started again')];
  expect(procedure_at(second, 91e6)).toMatchObject({ step: 'take_off', started_us: 90e6, iteration: 0, reached: [] });
});
it('has the alarms that stood then as the list of Live has them, with since when by the clock of the flight', () => {
  const known = { advice: '', acknowledged: false };
  expect(alarms_at(marks, 21e6)).toEqual([]);
  expect(alarms_at(marks, 23e6)).toEqual([
    { id: 'rtk.lost', priority: 'critical', title: 'no RTK for 2.1 s', since_ms: 22e3, ...known },
  ]);
  expect(alarms_at(marks, 26e6)).toEqual([]);
  expect(alarms_at(marks, 41e6)).toEqual([
    { id: 'uwb.none', priority: 'warning', title: 'no range for 5 s: check the tag', since_ms: 40e3, ...known },
  ]);
});

it('knows what was last decided about where to measure next, until the way home or another flight', () => {
  const decided = [
    ...marks,
    at(36, 'procedure.go_to_point', 'better point found: lowest expected error: 1.780 m rms, before: 2.899 m'),
    at(38, 'procedure.hold', 'held by the operator'),
    at(50, 'procedure.find_next_point', 'time at this point is over'),
    at(51, 'procedure.go_to_waypoint', 'enough here, to the next waypoint: 2 points measured at this waypoint'),
    at(70, 'procedure.return_home', 'battery'),
  ];
  expect(decision_at(decided, 35e6)).toBeNull();
  expect(decision_at(decided, 45e6)?.text).toMatch(/^better point found/);
  expect(decision_at(decided, 50.5e6)?.text).toMatch(/^better point found/);
  expect(decision_at(decided, 60e6)?.text).toMatch(/^enough here/);
  expect(decision_at(decided, 71e6)).toBeNull();
});

it('knows where the aircraft was sent to then, and where it had measured', () => {
  const sent = (s: number, step: string, lon: number): Mark => at(s, `procedure.${step}`, '', 'info', { lon, lat: 51 }),
    way = [
      at(1, 'procedure.take_off', ''),
      sent(10, 'go_to_waypoint', 3.1),
      at(20, 'procedure.ranging', ''),
      at(25, 'procedure.find_next_point', ''),
      sent(26, 'go_to_point', 3.2),
      at(30, 'rtk.lost', 'an event of something else'),
      at(40, 'procedure.hold', ''),
      sent(45, 'go_to_point', 3.2),
      at(50, 'procedure.ranging', ''),
      at(60, 'procedure.return_home', ''),
      at(99, 'procedure.take_off', 'a second flight'),
    ],
    lon = (s: number) => {
      const p = places_at(way, s * 1e6);
      return [p.target?.lon ?? null, p.measured.map((m) => m.lon)];
    };
  expect(lon(5)).toEqual([null, []]);
  expect(lon(12)).toEqual([3.1, []]);
  expect(lon(25)).toEqual([3.1, [3.1]]);
  expect(lon(31)).toEqual([3.2, [3.1]]);
  expect(lon(41)).toEqual([null, [3.1]]);
  expect(lon(55)).toEqual([3.2, [3.1, 3.2]]);
  expect(lon(61)).toEqual([null, [3.1, 3.2]]);
  expect(lon(99)).toEqual([null, []]);
});
