import { expect, it } from 'vitest';
import { Whole } from '../src/live/deltas';

const a = {
  mission: 'm',
  anchor: '0x1',
  status: 'found',
  enu_m: [1, 2, 3],
  ellipse95: { major_m: 1, minor_m: 0.5, azimuth_deg: 10 },
  gates: [
    { name: 'n', value: 1, passed: false },
    { name: 'o', value: 2, passed: true },
  ],
  mirror: null,
};

it('puts together what changed: members, members of members, elements of lists by their index', () => {
  const whole = new Whole();
  whole.snap([a, { ...a, anchor: '0x2' }]);
  expect(
    whole.data({
      mission: 'm',
      anchor: '0x1',
      enu_m: [1, 2, 4],
      ellipse95: { minor_m: 0.4 },
      gates: { 1: { value: 3 } },
      mirror: { probability: 0.2 },
    }),
  ).toEqual([
    {
      ...a,
      enu_m: [1, 2, 4],
      ellipse95: { major_m: 1, minor_m: 0.4, azimuth_deg: 10 },
      gates: [a.gates[0], { name: 'o', value: 3, passed: true }],
      mirror: { probability: 0.2 },
    },
  ]);
  expect(whole.data([{ mission: 'm', anchor: '0x1', mirror: null, gates: [] }])).toEqual([
    { ...a, enu_m: [1, 2, 4], ellipse95: { ...a.ellipse95, minor_m: 0.4 }, gates: [], mirror: null },
  ]);
  expect(whole.data({ mission: 'm', anchor: '0x2', status: 'converged' })).toEqual([
    { ...a, anchor: '0x2', status: 'converged' },
  ]);
});
it('takes a new anchor whole, and has what it cannot complete asked for anew', () => {
  const whole = new Whole();
  whole.snap([]);
  expect(whole.data({ mission: 'm', anchor: '0x3', enu_m: null })).toBeNull();
  expect(whole.data(a)).toEqual([a]);
  whole.snap([]);
  expect(whole.data({ mission: 'm', anchor: '0x1', h_m: 2 })).toBeNull();
});
