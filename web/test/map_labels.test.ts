import { describe, expect, it, vi } from 'vitest';
vi.hoisted(() => {
  // The palette asks the theme of the page, which there is none of.
  Object.assign(globalThis, {
    matchMedia: () => ({ matches: false, addEventListener() {} }),
    location: { search: '' },
  });
});
vi.mock('../src/ui/theme', () => ({ css: () => '' }));
import { numbered } from '../src/map/flight_layer';
import { palette_of, type Palette } from '../src/map/palette';
import { mark_trail, trail_stands, type Content } from '../src/map/picture';
import { Scene } from '../src/state/scene';
import { by_priority } from '../src/map/label_order';
import { beyond, free_place, type Box } from '../src/map/symbols';
import { estimate, type AnchorStatus } from '../src/live/messages';

const overlap = (a: Box, b: Box): boolean => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

describe('labels of the map', () => {
  it('never cover each other: near, then further off with a line, then not at all', () => {
    const taken: Box[] = [];
    let far = 0,
      left_out = 0;
    for (let i = 0; i < 40; i++) {
      const found = free_place(100 + (i % 4), 100, 12, 50, 26, taken);
      if (!found) {
        left_out++;
        continue;
      }
      expect(taken.filter((t) => overlap(t, found.box))).toEqual([]);
      far += Number(found.far);
      taken.push(found.box);
    }
    expect(taken.length).toBeGreaterThan(4);
    expect(far).toBeGreaterThan(0);
    expect(left_out).toBeGreaterThan(0);
  });
  it('are never cut by an edge of the picture', () => {
    for (const [x, y] of [
      [2, 2],
      [798, 300],
      [400, 599],
      [799, 599],
    ] as const) {
      const { box } = free_place(x, y, 12, 90, 26, beyond(800, 600))!;
      expect([box.x >= 0, box.y >= 0, box.x + box.w <= 800, box.y + box.h <= 600]).toEqual([true, true, true, true]);
    }
    expect(free_place(40, 10, 12, 90, 26, beyond(80, 20))).toBeNull(); // nor squeezed in where there is no room
  });
});

describe('names in a crowd', () => {
  const at = (anchor: string, status: AnchorStatus, e: number) => ({
    ...estimate({ mission: 'm', anchor, t_us: 1, verdict: 'ok', enu_m: [e, 0, 0] })!,
    status,
  });
  const all = [
    at('0x01', 'accepted', 0),
    at('0x02', 'estimating', 30),
    at('0x03', 'converged', 1),
    at('0x04', 'ambiguous', 2),
    at('0x05', 'gave_up', 3),
    at('0x06', 'estimating', 9),
  ];
  const ids = (selected: string | null, target: [number, number] | null) =>
    by_priority(all, selected, target).map((a) => a.anchor);
  it('have their room in this order: selected, measured next, not done, done', () => {
    expect(ids('0x03', [10, 0])).toEqual(['0x03', '0x06', '0x04', '0x02', '0x01', '0x05']);
  });
  it('are in the order of their ids where nothing is flown, so that none moves with a reading', () => {
    expect(ids(null, null)).toEqual(['0x02', '0x04', '0x06', '0x01', '0x03', '0x05']);
  });
});

describe('numbers of waypoints', () => {
  const f = { waypoints: Array.from({ length: 40 }, (_, i): [number, number] => [i, 0]), reached: 7 },
    p = { rem: 16 },
    seen = (px_per_m: number) => numbered({ e: 0, n: 0, px_per_m, w: 800, h: 600 }, p, f);
  it('are all there where there is room', () => expect(seen(30)).toHaveLength(40));
  it('give way to each other where there is none, the next one last', () => {
    const few = seen(4);
    expect(few.length).toBeLessThan(14);
    expect(few.map((w) => w.index)).toContain(7);
    for (const a of few) for (const b of few) if (a !== b) expect(overlap(a.box, b.box)).toBe(false);
  });
});

describe('the trail below the drone', () => {
  const flown = (n: number): Scene => {
    const scene = new Scene('m');
    for (let i = 0; i < n; i++) scene.trail.push({ t_us: i, e: i, n: 0, u: 0, fix: 'fixed' });
    return scene;
  };
  const content = (scene: Scene | null, link_lost = false): Content => ({
    anchors: [],
    selected: null,
    scene,
    link_lost,
    running: true,
  });
  it('stands while the flight goes on, and is drawn anew when it does not show it any more', () => {
    const scene = flown(100),
      mark = mark_trail(content(scene))!;
    scene.trail.push({ t_us: 100, e: 100, n: 0, u: 0, fix: 'fixed' });
    expect(trail_stands(mark, content(scene))).toBe(true);
    expect(mark.points).toBe(100);
    expect(trail_stands(mark, content(scene, true))).toBe(false); // it fades with the link
    expect(trail_stands(mark, content(flown(100)))).toBe(false); // another flight
    expect(trail_stands(mark, content(null))).toBe(false);
    scene.trail.splice(0, 10); // its beginning was thinned out
    expect(trail_stands(mark, content(scene))).toBe(false);
    const longer = flown(100),
      of_longer = mark_trail(content(longer));
    longer.trail.push(...flown(60).trail);
    expect(trail_stands(of_longer, content(longer))).toBe(false); // too much would be drawn with every frame
    expect(trail_stands(null, content(null))).toBe(true);
  });
});

describe('the map with the link lost', () => {
  it('has no colour of a state', () => {
    const live = { ink3: 'grey', ok: 'green', caution: 'amber', bad: 'red', info: 'blue', off: 'black', old: false };
    expect(palette_of(live as Palette, false)).toBe(live);
    const lost = palette_of(live as Palette, true);
    expect([lost.ok, lost.caution, lost.bad, lost.info, lost.off]).toEqual(Array(5).fill('grey'));
    expect(lost.old).toBe(true);
  });
});
