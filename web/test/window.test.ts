import { describe, expect, it } from 'vitest';
import {
  arrived,
  at_end,
  index_of,
  known,
  lacking,
  nothing,
  PAGE_ROWS,
  PAGES_KEPT,
  row,
  type Rows,
} from '../src/views/measurements/window';

/// Rows 0, 1, 2 ... of a list of `n`, brought page by page to page `upto`.
function brought(n: number, upto: number): Rows<number> {
  let r = nothing<number>();
  for (let page = 0; page <= upto; page++) r = bring(r, n, page);
  return r;
}
function bring(r: Rows<number>, n: number, page: number): Rows<number> {
  const from = page * PAGE_ROWS,
    to = Math.min(n, from + PAGE_ROWS);
  return arrived(
    r,
    page,
    Array.from({ length: to - from }, (_, i) => from + i),
    to < n ? `after ${to}` : null,
  );
}

describe('a list of a million rows', () => {
  it('asks for its first page at first', () => expect(lacking(nothing(), 0, 20)).toBe(0));
  it('asks for no more than is looked at', () => {
    const r = brought(1_000_000, 0);
    expect(lacking(r, 0, 20)).toBeNull();
    expect(lacking(r, PAGE_ROWS - 30, PAGE_ROWS - 1)).toBe(1);
  });
  it('keeps a few pages however far it was gone through, each row in its place', () => {
    const r = brought(1_000_000, 400);
    expect(r.kept.size).toBe(PAGES_KEPT);
    expect(known(r)).toBe(401 * PAGE_ROWS);
    expect(row(r, 400 * PAGE_ROWS + 7)).toBe(400 * PAGE_ROWS + 7);
    expect(row(r, 3)).toBeUndefined();
  });
  it('brings a page that went back by its cursor, and knows no more rows for it', () => {
    const far = brought(1_000_000, 400);
    expect(lacking(far, 3, 30)).toBe(0);
    expect(lacking(far, 100 * PAGE_ROWS - 5, 100 * PAGE_ROWS + 5)).toBe(99);
    expect(far.cursors[99]).toBe(`after ${99 * PAGE_ROWS}`);
    const back = bring(far, 1_000_000, 0);
    expect([row(back, 3), known(back), back.kept.size, back.cursors.length]).toEqual([
      3,
      known(far),
      PAGES_KEPT,
      far.cursors.length,
    ]);
  });
  it('ends', () => {
    const r = brought(PAGE_ROWS + 1, 1);
    expect([at_end(r), known(r), lacking(r, 0, PAGE_ROWS)]).toEqual([true, PAGE_ROWS + 1, null]);
  });
});

describe('pages of a class', () => {
  it('may be short or empty and yet go on', () => {
    let r = arrived(nothing<number>(), 0, [10, 11], 'a');
    r = arrived(r, 1, [], 'b');
    expect(lacking(r, 0, 1)).toBe(2);
    r = arrived(r, 2, [12], null);
    expect([row(r, 2), row(r, 3), index_of(r, (x) => x === 12), index_of(r, (x) => x === 9), at_end(r)]).toEqual([
      12,
      undefined,
      2,
      -1,
      true,
    ]);
  });
});
