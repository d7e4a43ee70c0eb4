import { describe, expect, it } from 'vitest';
import { cells_in_sight, level_for } from '../src/map/tiles';
import type { Floor } from '../src/state/floors';

/// 100 x 60 m: tiles of 1.6, 0.8 ... 0.0125 m a pixel over a backdrop of 2.5 cm, drawn about another origin, 10 m further east.
const levels = [...Array(8).keys()].map((level) => {
  const m_per_px = 1.6 / 2 ** level;
  return { level, m_per_px, columns: Math.ceil(100 / (256 * m_per_px)), rows: Math.ceil(60 / (256 * m_per_px)) };
});
const floor = {
  id: 'f',
  backdrop: { extent_m: [0, 0, 100, 60], width_px: 4000, height_px: 2400 },
  tiles: { tile_px: 256, levels, sha256: 's' },
} as unknown as Floor;
const placed = { low: [-10, 0], high: [90, 60] } as const;

describe('tiles of a floor plan', () => {
  it('are of the level whose pixels are nearest to those of the screen', () => {
    expect(level_for(floor, 80)?.m_per_px).toBe(0.0125);
    expect(level_for(floor, 500)?.m_per_px).toBe(0.0125); // there is no finer one
  });
  it('are not asked for where the backdrop is as sharp as the screen, or as the plan', () => {
    expect(level_for(floor, 40)).toBeNull();
    expect(level_for(floor, 5)).toBeNull();
    const sharp = { ...floor, backdrop: { ...floor.backdrop!, width_px: 7990 } };
    expect(level_for(sharp, 500)).toBeNull();
    expect(level_for({ ...floor, tiles: null }, 500)).toBeNull();
  });
  it('are those in sight, at their places, without a gap between them', () => {
    // 200 x 100 pixels about (20, 30), 80 a metre: 2.5 m x 1.25 m. From the north-west corner that is 28.75 to 31.25 m east and 29.375 to 30.625 m south;
    // a tile is 3.2 m.
    const level = levels[7]!,
      cam = { e: 20, n: 30, px_per_m: 80, w: 200, h: 100 },
      cells = cells_in_sight(floor, placed, level, cam, 1.5);
    expect(cells.map((c) => [c.column, c.row])).toEqual([
      [8, 9],
      [9, 9],
    ]);
    // Column 9 begins 28.8 m east: 0.05 m, 4 pixels from the left edge. Row 9 begins 28.8 m south: 46 pixels above the upper edge.
    expect(cells[1]!.left).toBeCloseTo(4, 9);
    expect(cells[0]!.right).toBe(cells[1]!.left);
    expect(cells[1]!.top).toBeCloseTo(-46, 9);
    expect(cells[1]!.bottom - cells[1]!.top).toBeCloseTo(256, 9);
    const zoomed = cells_in_sight(floor, placed, level, { ...cam, px_per_m: 77.3 }, 1.5);
    for (const c of zoomed) expect(Math.abs((c.left * 1.5) % 1)).toBe(0);
  });
  it('are none beside the plan, and no column that it does not have', () => {
    const level = levels[7]!;
    expect(cells_in_sight(floor, placed, level, { e: 200, n: 30, px_per_m: 80, w: 200, h: 100 }, 1)).toEqual([]);
    const edge = cells_in_sight(floor, placed, level, { e: 90, n: 0, px_per_m: 80, w: 2000, h: 1000 }, 1);
    expect(Math.max(...edge.map((c) => c.column))).toBe(level.columns - 1);
    expect(Math.max(...edge.map((c) => c.row))).toBe(level.rows - 1);
  });
});
