import { describe, expect, it } from 'vitest';
import { estimate, type MissionMsg, type RangeMsg } from '../src/live/messages';
import {
  after,
  arrivals_of,
  marks_of,
  neighbour,
  Player,
  poses_of,
  range_of,
  shown_of,
  span_of,
  type Recording,
} from '../src/state/recording';

const mission: MissionMsg = {
  mission: 'm',
  name: 'flight',
  state: 'finished',
  t_us: 0,
  started_us: 0,
  frame: 'local',
  origin: null,
  n_ranges: 0,
  n_fixes: 0,
  anchors_found: 0,
  anchors_converged: 0,
  range_rate_hz: null,
  fixes_refused: {},
};
const fix = (t_s: number, e: number) => ({ t_us: t_s * 1e6, local_m: [e, 0, 5], fix: 'fixed' as const });
const range = (t_s: number): RangeMsg => ({
  t_us: t_s * 1e6,
  mission: 'm',
  tag: '0x1',
  anchor: '0x2',
  distance_m: t_s,
  corrected_m: t_s,
  sigma_m: null,
  rss_dbm: null,
  p_los: null,
  used: true,
  refused: null,
});
const seconds = Array.from({ length: 600 }, (_, i) => i);
const recording: Recording = {
  mission,
  from_us: 0,
  to_us: 599e6,
  poses: poses_of(
    seconds.map((t) => fix(t, t)),
    'm',
    null,
  ),
  ranges: seconds.map(range),
  marks: [],
  cut: false,
};

describe('the span of a recording', () => {
  const at = (...t_s: number[]) => t_s.map((t) => ({ t_us: t * 1e6 }));
  it('is that of positions and ranges together', () => {
    expect(span_of(at(1, 100), at(3, 120), false)).toEqual({ from_us: 1e6, to_us: 120e6 });
    expect(span_of([], at(3, 120), false)).toEqual({ from_us: 3e6, to_us: 120e6 });
  });
  it('ends, where not all was read, before one of the two falls silent', () => {
    expect(span_of(at(1, 100), at(3, 60), true)).toEqual({ from_us: 1e6, to_us: 60e6 });
  });
});

describe('the player of a recording', () => {
  it('shows what was known at a moment and nothing later', () => {
    const p = new Player(recording);
    p.to(10.4e6, 1000);
    expect(p.scene.pose!.value.t_us).toBe(10e6);
    expect(p.scene.ranges.get('0x2')!.last.distance_m).toBe(10);
  });
  it('goes back: what came later is gone', () => {
    const p = new Player(recording);
    p.to(300e6, 1000);
    p.to(200e6, 2000);
    expect(p.scene.pose!.value.t_us).toBe(200e6);
    expect(p.scene.trail.every((q) => q.t_us <= 200e6)).toBe(true);
  });
  it('a far jump shows the two minutes before it and no line across the hole', () => {
    const p = new Player(recording);
    p.to(500e6, 1000);
    expect(p.scene.trail[0]!.t_us).toBeGreaterThanOrEqual(380e6);
    expect(p.scene.trail[p.scene.trail.length - 1]!.t_us).toBe(500e6);
  });
  it('keeps what is fresh fresh while it stands, and what was old old', () => {
    const p = new Player(recording);
    p.to(10.5e6, 1000);
    p.to(10.5e6, 9000);
    const at_ms = [p.scene.pose!.at_ms, p.scene.rtk!.at_ms, p.scene.range_at_ms, p.scene.ranges.get('0x2')!.at_ms];
    for (const t of at_ms) expect(9000 - t).toBeCloseTo(500, 6);
  });
  it('reaches from the first moment over all that is flown', () => {
    const { reach_m } = new Player(recording);
    expect([...new Set(reach_m.map(([e]) => e))]).toEqual([0, 599]);
    expect([...new Set(reach_m.map(([, , u]) => u))]).toEqual([5]);
    expect(new Player({ ...recording, poses: [] }).reach_m).toEqual([]);
  });
  it('shows the estimates of the moment, with all that led to them, and none of later ones', () => {
    const p = new Player(recording),
      at = (t_s: number, h95_m: number) =>
        estimate({ mission: 'm', anchor: '0x6a21', t_us: t_s * 1e6, status: 'estimating', h95_m })!;
    p.to(100e6, 1000);
    expect(p.scene.anchors.size).toBe(0);
    p.learn([at(20, 5), at(90, 2), at(120, 1), at(400, 0.1)], 1000);
    const shown = () => p.scene.anchors.get('0x6a21')!.value.h95_m;
    expect(shown()).toBe(2);
    expect(p.scene.history.get('0x6a21')!.map((h) => h.h95_m)).toEqual([5, 2]);
    p.to(150e6, 2000);
    expect(shown()).toBe(1);
    p.to(500e6, 3000);
    expect(shown()).toBe(0.1);
    p.to(30e6, 4000);
    expect(shown()).toBe(5);
    p.to(10e6, 5000);
    expect(p.scene.anchors.size).toBe(0);
    // As old as it is at that moment, however long the page stands there.
    p.to(25e6, 6000);
    p.to(25e6, 60_000);
    expect(60_000 - p.scene.anchors.get('0x6a21')!.at_ms).toBeCloseTo(5000, 6);
  });
  it('does not leave the flight', () => {
    const p = new Player(recording);
    p.to(9e12, 0);
    expect(p.t_us).toBe(599e6);
    p.to(-5, 0);
    expect(p.t_us).toBe(0);
  });
});

describe('a fix of the recording', () => {
  it('gives the bearing of the body x-axis from its quaternion', () => {
    const half = Math.SQRT1_2; // a quarter turn about up takes x from east to north
    expect(poses_of([{ ...fix(0, 0), q: [0, 0, half, half] }], 'm', null)[0]!.heading_deg).toBeCloseTo(0, 9);
    expect(poses_of([{ ...fix(0, 0), q: [0, 0, 0, 1] }], 'm', null)[0]!.heading_deg).toBeCloseTo(90, 9);
  });
  it('finds the first row above a time', () =>
    expect([
      after([{ t_us: 1 }, { t_us: 3 }], 0),
      after([{ t_us: 1 }, { t_us: 3 }], 1),
      after([{ t_us: 1 }, { t_us: 3 }], 9),
    ]).toEqual([0, 1, 2]));
});

describe('events of a recording', () => {
  const at = (t_s: number) => ({ t_us: t_s * 1e6, level: 'info' as const, text: `at ${t_s}` }),
    marks = marks_of([at(300), at(200), null, at(200), at(100), at(9000)], 0, 599e6);
  it('are in the order of the flight, whatever the order of the answer', () =>
    expect(marks.map((m) => m.t_us / 1e6)).toEqual([100, 200, 200, 300]));
  it('are stepped through one moment after the other, both ways', () => {
    const way = (from_s: number, by: 1 | -1): number[] => {
      const out: number[] = [];
      for (let m = neighbour(marks, from_s * 1e6, by); m; m = neighbour(marks, m.t_us, by)) out.push(m.t_us / 1e6);
      return out;
    };
    expect(way(0, 1)).toEqual([100, 200, 300]);
    expect(way(599, -1)).toEqual([300, 200, 100]);
    expect(way(250, -1)).toEqual([200, 100]);
  });
});

describe('events of a flight that was played again', () => {
  // 600 s, played four times as fast an hour later.
  const rows = seconds.map((t) => ({ t_us: t * 1e6, received_us: 3600e6 + (t / 4) * 1e6 })),
    event = (wall_s: number) => ({
      t_us: wall_s * 1e6,
      level: 'info' as const,
      code: 'anchor.found',
      text: '',
      id: 'e',
    });
  it('stand where the rows of that moment are', () => {
    const marks = marks_of([event(3600), event(3650), event(3749)], 0, 599e6, arrivals_of(rows));
    expect(marks.map((m) => Math.round(m.t_us / 1e6))).toEqual([0, 200, 596]);
  });
  it('stay where they are in a flight that was followed as it was flown', () => {
    const live = arrivals_of(seconds.map((t) => ({ t_us: t * 1e6, received_us: t * 1e6 + 80_000 })));
    expect(marks_of([event(300.5)], 0, 599e6, live).map((m) => m.t_us)).toEqual([300.5e6]);
    expect(marks_of([event(300.5)], 0, 599e6, []).map((m) => m.t_us)).toEqual([300.5e6]);
  });
});

describe('a stored range', () => {
  const row = { t_us: 1, anchor: '0x2', tag: '0x1', distance_m: 5.3 };
  it('has the class and the correction of the models where the server gives them', () => {
    const r = range_of('m')({ ...row, predicted: { class: 'nlos', p_los: 0.1, bias_m: 0.3, models: {} } })!;
    expect(r.p_los).toBe(0.1);
    expect(r.corrected_m).toBeCloseTo(5);
  });
  it('is as measured where no model is promoted', () => {
    for (const predicted of [undefined, null, { class: 'unclear' as const, p_los: null, bias_m: null }]) {
      const r = range_of('m')({ ...row, predicted })!;
      expect([r.p_los, r.corrected_m]).toEqual([null, 5.3]);
    }
  });
});

describe('what the procedure showed', () => {
  const entry = (t_s: number, topic: string, data: object) => ({
    t_us: t_s * 1e6,
    topic,
    data: { mission: 'm', t_us: t_s * 1e6, ...data },
  });
  const log = [
    entry(9, 'plan', { plan: { waypoints: [{ lon: 1, lat: 2 }], settings: { max_height_m: 12 } } }),
    entry(10, 'procedure', { status: 'running', step: 'turn', in_step_s: 2 }),
    entry(12, 'mission.turn', { anchor: '0x2', running: true, samples: [[10, -80]], bearing_deg: null }),
    entry(17, 'mission.turn', { anchor: '0x2', running: false, samples: [[10, -80], [20, -81]], bearing_deg: 10 }), // prettier-ignore
    entry(30, 'procedure', { status: 'running', step: 'go_to_point', in_step_s: 0 }),
    entry(30, 'mission.grid', { rule: 'a_optimal', candidates: [{ lon: 1, lat: 2, value: 4 }], chosen: 0 }),
  ];
  const shown = log.flatMap((row) => shown_of(row as never) ?? []);

  it('is that of the moment, forwards and back', () => {
    const player = new Player(recording);
    player.learn_procedure(shown, 1000);
    expect(player.procedure_kept).toBe(true);
    expect(player.scene.procedure).toBeNull();
    player.to(14e6, 1000);
    expect(player.scene.procedure?.value.step).toBe('turn');
    expect(player.scene.flown).toMatchObject({ high_m: 12, plan: { waypoints: [{ lon: 1, lat: 2 }] } });
    expect(player.scene.turns.get('0x2')?.value).toMatchObject({ running: true, best: null });
    expect(player.scene.grid).toBeNull();
    player.to(40e6, 1000);
    expect(player.scene.procedure?.value.step).toBe('go_to_point');
    expect(player.scene.turns.get('0x2')?.value.best).toBe(10);
    expect(player.scene.grid?.value.candidates).toHaveLength(1);
    player.to(20e6, 1000);
    expect(player.scene.procedure?.value.step).toBe('turn');
    expect(player.scene.grid).toBeNull();
  });
  it('has the age that it had then, however long the moment is looked at', () => {
    const player = new Player(recording);
    player.learn_procedure(shown, 1000);
    player.to(14e6, 50_000);
    expect(50_000 - player.scene.procedure!.at_ms).toBeCloseTo(4000);
    player.to(14e6, 90_000);
    expect(90_000 - player.scene.procedure!.at_ms).toBeCloseTo(4000);
  });
  it('leaves out what is of no topic, and knows when nothing was kept', () => {
    expect(shown_of(entry(1, 'rtk', {}) as never)).toBeNull();
    expect(shown_of({ topic: 'procedure' } as never)).toBeNull();
    expect(new Player(recording).procedure_kept).toBe(false);
  });
});
