import { describe, expect, it } from 'vitest';
import { EMPTY, type Plan, type Waypoint } from '../src/api/plans';
import { differences } from '../src/views/plan/differences';
import { from_m, NEW_WAYPOINT, plan_origin, to_m } from '../src/views/plan/draft';
import { typed_address } from '../src/views/plan/expected';
import { floors, step_of, summary } from '../src/views/plan/predicted';
import { profile } from '../src/views/plan/profile';
import { snapped } from '../src/views/plan/snap';
import {
  denser,
  distance_to_edge,
  inside,
  spaced_along,
  typed_heights,
  usual_heights,
  with_even_spacing,
  type Point,
} from '../src/views/plan/tools';

const ORIGIN = { lon: 3.7131, lat: 51.0231, h_m: 0 };
const at = (e: number, n: number) => from_m(e, n, ORIGIN);
const wp = (e: number, n: number, over: Partial<Waypoint> = {}): Waypoint => ({
  ...NEW_WAYPOINT,
  ...at(e, n),
  ...over,
});
const square: Point[] = [
  [0, 0],
  [20, 0],
  [20, 20],
  [0, 20],
];
const hall: Plan = { ...EMPTY, name: 'Hall', building_height_m: 8, outline: square.map(([e, n]) => at(e, n)) };
const gaps = (p: readonly Point[]): number[] =>
  p.map((a, i) => {
    const b = p[(i + 1) % p.length]!;
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  });

describe('points along an outline', () => {
  // A square of 20 m at 4 m: four sides of 20 m and one whole circle of radius 4, 80 + 8 pi = 105.13 m.
  it('are as many as fit round it, at the distance asked for', () => {
    const p = spaced_along(square, 4, 5);
    expect(p).toHaveLength(21);
    for (const q of p) expect(distance_to_edge(q, square)).toBeCloseTo(4, 2);
    expect(p.some((q) => inside(q, square))).toBe(false);
    // Along the curve 105.13 / 21 = 5.006 m apart; the chord over an arc is shorter, by no more than 2 R (1 - sin(t)/t).
    for (const g of gaps(p)) {
      expect(g).toBeLessThan(5.02);
      expect(g).toBeGreaterThan(4.6);
    }
  });
  it('go the same way round whichever way the outline was drawn', () =>
    expect(spaced_along([...square].reverse(), 4, 5)).toHaveLength(21));
  it('keep off both walls inside of an L', () => {
    const l: Point[] = [
      [0, 0],
      [30, 0],
      [30, 10],
      [10, 10],
      [10, 30],
      [0, 30],
    ];
    for (const q of spaced_along(l, 4, 2)) {
      expect(distance_to_edge(q, l)).toBeGreaterThan(3.99);
      expect(inside(q, l)).toBe(false);
    }
  });
  it('are at least three, and none without an outline', () => {
    expect(spaced_along(square, 4, 100)).toHaveLength(3);
    expect(
      spaced_along(
        [
          [0, 0],
          [1, 0],
        ],
        4,
        5,
      ),
    ).toEqual([]);
  });
  it('take the heights in turn and the flags of the first waypoint, and leave out what may not be flown', () => {
    const no_fly = [at(-10, 5), at(-2, 5), at(-2, 15), at(-10, 15)],
      { plan, left_out } = with_even_spacing(
        {
          ...hall,
          no_fly: [no_fly],
          waypoints: [wp(0, -4, { height_above_ground_m: 7, turn: true, heading_deg: 90 })],
        },
        ORIGIN,
        5,
        [3, 9],
      );
    expect(plan.waypoints.filter((w) => w.measure).slice(0, 3)).toMatchObject(
      [3, 9, 3].map((h) => ({ height_above_ground_m: h, turn: true, heading_deg: null })),
    );
    expect(plan.waypoints.filter((w) => w.measure).length + left_out).toBe(21);
    for (const w of plan.waypoints.filter((x) => x.measure)) {
      const [e, n] = to_m(w, ORIGIN);
      expect(e < -2 - 4 && n > 1 && n < 19).toBe(false);
      expect(e > -6 || n < 1 || n > 19).toBe(true);
    }
    expect(left_out).toBeGreaterThan(2);
  });
});

describe('the way between evenly spaced points', () => {
  const wedge: Point[] = [
      [0, 0],
      [40, 0],
      [0, 8],
    ],
    l: Point[] = [
      [0, 0],
      [30, 0],
      [30, 10],
      [10, 10],
      [10, 30],
      [0, 30],
    ];
  it.each([
    ['a hall', square, 5],
    ['a hall, few points', square, 12],
    ['an L', l, 6],
    ['a wedge', wedge, 5],
    ['a wedge, few points', wedge, 11],
  ] as const)('never comes nearer to a wall than the keep-out: %s', (_, ring, spacing) => {
    const made = with_even_spacing(
      { ...EMPTY, outline: ring.map(([e, n]) => at(e, n)) },
      ORIGIN,
      spacing,
      [4],
    ).plan.waypoints.map((w) => to_m(w, ORIGIN));
    made.slice(1).forEach((b, i) => {
      const a = made[i]!;
      for (let k = 0; k <= 50; k++) {
        const p: Point = [a[0] + ((b[0] - a[0]) * k) / 50, a[1] + ((b[1] - a[1]) * k) / 50];
        expect(inside(p, ring)).toBe(false);
        expect(distance_to_edge(p, ring)).toBeGreaterThan(3.995);
      }
    });
  });
});

describe('heights of even spacing', () => {
  it('are 2 m and above the roof of 8 m, within the band', () => {
    expect(usual_heights(hall)).toEqual([2, 9]);
    expect(usual_heights({ ...hall, settings: { min_height_m: 3, max_height_m: 6 } })).toEqual([3, 6]);
  });
  it('are those flown so far where there are several', () =>
    expect(
      usual_heights({
        ...hall,
        waypoints: [
          wp(0, 0, { height_above_ground_m: 7 }),
          wp(1, 0, { height_above_ground_m: 3 }),
          wp(2, 0, { height_above_ground_m: 7 }),
          wp(2, 0, { measure: false, height_above_ground_m: 20 }),
        ],
      }),
    ).toEqual([3, 7]));
  it('are typed as a list, with decimal commas too', () =>
    expect([
      typed_heights('2, 9'),
      typed_heights('2 9,5'),
      typed_heights('4'),
      typed_heights('4; 8'),
      typed_heights('2, x'),
      typed_heights('-2'),
    ]).toEqual([[2, 9], [2, 9.5], [4], [4, 8], null, null]));
});

describe('denser here', () => {
  const line = { ...hall, waypoints: [wp(0, 0), wp(10, 0, { height_above_ground_m: 8 }), wp(20, 0)] };
  it('sets one half-way to each neighbour, at the mean height', () => {
    const made = denser(line, 1, ORIGIN).waypoints;
    expect(made.map((w) => Math.round(to_m(w, ORIGIN)[0]))).toEqual([0, 5, 10, 15, 20]);
    expect(made.map((w) => w.height_above_ground_m)).toEqual([4, 6, 8, 6, 4]);
  });
  it('takes the last as neighbour of the first', () =>
    expect(denser(line, 0, ORIGIN).waypoints.map((w) => Math.round(to_m(w, ORIGIN)[0]))).toEqual([10, 0, 5, 10, 20]));
  it('adds one between two, and none where they nearly touch', () => {
    expect(denser({ ...hall, waypoints: [wp(0, 0), wp(10, 0)] }, 0, ORIGIN).waypoints).toHaveLength(3);
    expect(denser({ ...hall, waypoints: [wp(0, 0), wp(0.4, 0)] }, 0, ORIGIN).waypoints).toHaveLength(2);
  });
});

describe('height over time', () => {
  // 3 m across and 4 m up are 5 m: 2.5 s at 2 m/s; dwell 4 s where it measures.
  it('counts ways at the speed and dwell where it measures', () => {
    const p = profile(
      {
        ...hall,
        settings: {},
        waypoints: [
          wp(0, 0),
          wp(3, 0, { height_above_ground_m: 8, measure: false }),
          wp(3, 10, { height_above_ground_m: 8, dwell_s: 1 }),
        ],
      },
      ORIGIN,
    );
    expect(p.map((m) => [m.waypoint, m.height_m, Number(m.t_s.toFixed(3))])).toEqual([
      [0, 4, 0],
      [0, 4, 4],
      [1, 8, 6.5],
      [2, 8, 11.5],
      [2, 8, 12.5],
    ]);
  });
});

describe('a tap that snaps', () => {
  it('goes to half metres where there is no wall yet', () =>
    expect(snapped([3.2, -1.3], [], 8)).toEqual({ at: [3, -1.5], how: 'half metres' }));
  it('goes to the right angle of the last wall, in half metres along it', () =>
    expect(
      snapped(
        [10.4, 6.2],
        [
          [0, 0],
          [10, 0],
        ],
        10,
      ),
    ).toEqual({ at: [10, 6], how: 'right angle' }));
  it('does so for a wall that runs askew', () => {
    const u = Math.SQRT1_2,
      s = snapped(
        [10 * u - 5.1 * u, 10 * u + 5.1 * u],
        [
          [0, 0],
          [10 * u, 10 * u],
        ],
        10,
      );
    expect(s.at[0]).toBeCloseTo(10 * u - 5 * u, 9);
    expect(s.at[1]).toBeCloseTo(10 * u + 5 * u, 9);
  });
  it('closes a rectangle in line with its first corner', () =>
    expect(
      snapped(
        [0.3, 6.1],
        [
          [0.2, 0],
          [10, 0],
          [10, 6],
        ],
        10,
      ),
    ).toEqual({ at: [expect.closeTo(0.2, 9), 6], how: 'in line with the first corner' }));
  it('lets a wall run askew that is far from both', () =>
    expect(
      snapped(
        [14, 7],
        [
          [0, 0],
          [10, 0],
        ],
        20,
      ).how,
    ).toBe('half metres'));
});

describe('the predicted map', () => {
  const a = (up: number, gdop: number | null, sigma_m: number) => ({ e: 0, n: 0, up, gdop, sigma_m }),
    all = [a(5.5, 2, 0.3), a(2.5, 1.2, 0.04), a(2.5, null, 30), a(2.5, 3, 0.06)];
  it('has six steps, the gate of 2.5 the end of the fourth', () =>
    expect([0.9, 1, 2.5, 2.51, 9].map((v) => step_of(v, 'gdop'))).toEqual([0, 0, 3, 4, 5]));
  it('has no step for what is not seen', () => expect(step_of(null, 'gdop')).toBeNull());
  it('tells each height its middle and worst', () => {
    expect(floors(all)).toEqual([2.5, 5.5]);
    expect(summary(all, 2.5)).toEqual({ up: 2.5, n: 3, unseen: 1, gdop: [1.2, 3], sigma_m: [0.06, 30] });
  });
});

describe('two versions of a plan', () => {
  const base = { ...hall, waypoints: [wp(0, -4), wp(24, 0)] };
  it('differ in nothing when they are the same', () => expect(differences(base, { ...base, revision: 9 })).toEqual([]));
  it('say what differs, each side as it has it', () => {
    const theirs = {
      ...base,
      name: 'Hall B',
      settings: { ...base.settings, speed_mps: 3 },
      waypoints: [wp(0, -4.5, { height_above_ground_m: 6 }), wp(24, 0), wp(1, 1)],
    };
    expect(differences(base, theirs)).toEqual([
      { name: 'Name', mine: 'Hall', theirs: 'Hall B' },
      { name: 'Speed, m/s', mine: '2', theirs: '3' },
      { name: 'Waypoints', mine: '2', theirs: '3' },
      { name: 'Waypoint 1', mine: '0.50 m further north; 4.0 m high', theirs: '0.50 m further south; 6.0 m high' },
      { name: 'Waypoint 3', mine: 'not there', theirs: 'only here' },
    ]);
  });
  it('stop after fifteen lines and say how many are left', () => {
    const many = { ...base, waypoints: Array.from({ length: 40 }, (_, i) => wp(i, -4)) },
      other = { ...many, waypoints: many.waypoints.map((w) => ({ ...w, dwell_s: 9 })) };
    expect(differences(many, other).at(-1)!.name).toBe('And 26 more');
  });
});

describe('a typed radio address', () => {
  it('is read with or without 0x', () => {
    expect(typed_address(' 6A2F')).toBe('0x6a2f');
    expect(typed_address('0x6a2f')).toBe('0x6a2f');
  });
  it('is none where it cannot be one', () =>
    expect(['', '6a2', 'anchor', '0x6a2f6a2f6'].map(typed_address)).toEqual([null, null, null, null]));
});

describe('the origin of a plan', () => {
  it('is the middle of the outline, as the server has it, whatever else is drawn', () =>
    expect(to_m(plan_origin({ ...hall, fence: [at(-50, -50)] })!, ORIGIN).map((v) => Number(v.toFixed(3)))).toEqual([
      10, 10,
    ]));
  it('is its own where it has one, and none where nothing is drawn', () => {
    expect(plan_origin({ ...hall, rest: { origin: { lon: 3, lat: 51, h_m: 9 } } })).toEqual({
      lon: 3,
      lat: 51,
      h_m: 0,
    });
    expect(plan_origin(EMPTY)).toBeNull();
  });
});
