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
import { free_place, type Box } from '../src/map/symbols';

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
