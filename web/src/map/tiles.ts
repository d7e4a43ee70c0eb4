/// The plan of a floor in squares, where the map is nearer than its backdrop is sharp: which are in sight, and their pictures, asked for as they are.
import { bytes } from '../api/contract';
import { backdrop_version, type Backdrop, type Floor } from '../state/floors';
import { to_px, type Camera } from './camera';

export type Level = NonNullable<Floor['tiles']>['levels'][number];
/// A tile in sight: edges in pixels of the map.
export interface Cell {
  readonly column: number;
  readonly row: number;
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/// The level whose pixels are nearest to those of the screen; null where the backdrop is as sharp, or as sharp as the screen.
export function level_for(floor: Floor, device_px_per_m: number): Level | null {
  const { tiles, backdrop } = floor;
  if (!tiles || !backdrop) return null;
  const backdrop_m_per_px = (backdrop.extent_m[2]! - backdrop.extent_m[0]!) / backdrop.width_px,
    wish = Math.SQRT2 / device_px_per_m,
    fit = tiles.levels.find((l) => l.m_per_px <= wish) ?? tiles.levels.at(-1)!;
  // Rounded to whole pixels, a backdrop in the plan's own is a little sharper or less than the last level.
  return backdrop_m_per_px <= wish || backdrop_m_per_px < 1.01 * fit.m_per_px ? null : fit;
}

/// Edges lie on device pixels: two half-covered ones beside each other would be a line that no plan has.
export function cells_in_sight(
  floor: Floor,
  b: Pick<Backdrop, 'low' | 'high'>,
  level: Level,
  cam: Camera,
  ratio: number,
): Cell[] {
  const [left, bottom] = to_px(cam, b.low),
    [right, top] = to_px(cam, b.high),
    [west, south, east, north] = floor.backdrop!.extent_m as [number, number, number, number],
    side_m = floor.tiles!.tile_px * level.m_per_px,
    w = ((right - left) * side_m) / (east - west),
    h = ((bottom - top) * side_m) / (north - south),
    round = (x: number): number => Math.round(x * ratio) / ratio,
    first = (from: number, side: number): number => Math.max(0, Math.floor(-from / side)),
    last = (from: number, side: number, size: number, n: number): number =>
      Math.min(n, Math.ceil((size - from) / side));
  const cells: Cell[] = [];
  for (let row = first(top, h); row < last(top, h, cam.h, level.rows); row++)
    for (let column = first(left, w); column < last(left, w, cam.w, level.columns); column++)
      cells.push({
        column,
        row,
        left: round(left + column * w),
        top: round(top + row * h),
        right: round(left + (column + 1) * w),
        bottom: round(top + (row + 1) * h),
      });
  return cells;
}

/// Where the server has a tile.
interface Place extends Pick<Cell, 'column' | 'row'> {
  readonly id: string;
  readonly level: number;
}
/// Null: nothing of the plan lies there.
type Picture = ImageBitmap | null;
const MOST_KEPT = 300, // 256 kB each
  AT_ONCE = 6,
  EVERY_MS = 40, // half of the requests a second that the server takes of one session
  AFTER_FAULT_MS = 2000,
  DRAWN_EVERY_MS = 100;
const kept = new Map<string, Picture>(), ///< the one used last is the last
  under_way = new Set<string>(),
  wanted = new Map<string, readonly (readonly [key: string, path: Place])[]>(); ///< of a floor, as it was drawn last
let timer = 0,
  drawing = 0;

const key_of = (floor: Floor, level: number, column: number, row: number): string =>
  `${floor.id} ${floor.tiles!.sha256} ${level} ${column} ${row}`;
function used(key: string): Picture | undefined {
  const picture = kept.get(key);
  if (picture !== undefined) {
    kept.delete(key);
    kept.set(key, picture);
  }
  return picture;
}
function keep(key: string, picture: Picture): void {
  kept.set(key, picture);
  for (const [oldest, old] of kept) {
    if (kept.size <= MOST_KEPT) break;
    kept.delete(oldest);
    old?.close();
  }
  draw_again(DRAWN_EVERY_MS);
}
function draw_again(after_ms: number): void {
  drawing ||= window.setTimeout(() => {
    drawing = 0;
    backdrop_version.value++;
  }, after_ms);
}
function ask(): void {
  const missing = [...wanted.values()].flat().filter(([key]) => !kept.has(key)),
    next = missing.find(([key]) => !under_way.has(key));
  if (next && under_way.size < AT_ONCE) {
    const [key, path] = next;
    under_way.add(key);
    bytes('/floors/{id}/plan/tiles/{level}/{column}/{row}', { path })
      .then(async (r) => {
        if (!r.ok) throw new Error(String(r.status));
        keep(key, r.status === 204 ? null : await createImageBitmap(await r.blob()));
      })
      // No link, signed out, or too many requests: asked for again by the next drawing, which is not at once.
      .catch(() => {
        wanted.clear();
        draw_again(AFTER_FAULT_MS);
      })
      .finally(() => under_way.delete(key));
  }
  if (!missing.length) {
    clearInterval(timer);
    timer = 0;
  }
}

/// Draws what is in sight of a floor in tiles, each from the nearest level that is there, else from the backdrop. False where the backdrop is enough.
export function draw_tiles(c: CanvasRenderingContext2D, cam: Camera, b: Backdrop): boolean {
  const { floor } = b,
    ratio = c.getTransform().a || 1,
    level = level_for(floor, cam.px_per_m * ratio);
  if (!level) {
    wanted.delete(floor.id);
    return false;
  }
  const cells = cells_in_sight(floor, b, level, cam, ratio),
    middle = (cell: Cell): number => Math.hypot(cell.left + cell.right - cam.w, cell.top + cell.bottom - cam.h);
  wanted.set(
    floor.id,
    cells
      .sort((x, y) => middle(x) - middle(y))
      .map(({ column, row }) => [
        key_of(floor, level.level, column, row),
        { id: floor.id, level: level.level, column, row },
      ]),
  );
  for (const cell of cells) draw_cell(c, b, level, cell);
  timer ||= window.setInterval(ask, EVERY_MS);
  return true;
}
function draw_cell(c: CanvasRenderingContext2D, b: Backdrop, level: Level, cell: Cell): void {
  const { floor, image } = b,
    to = [cell.left, cell.top, cell.right - cell.left, cell.bottom - cell.top] as const,
    side = floor.tiles!.tile_px;
  for (let up = 0; up <= level.level; up++) {
    const parts = 2 ** up,
      picture = used(key_of(floor, level.level - up, Math.floor(cell.column / parts), Math.floor(cell.row / parts)));
    if (picture === undefined) continue;
    if (picture)
      c.drawImage(
        picture,
        ((cell.column % parts) * side) / parts,
        ((cell.row % parts) * side) / parts,
        side / parts,
        side / parts,
        ...to,
      );
    return;
  }
  const [west, south, east, north] = floor.backdrop!.extent_m as [number, number, number, number],
    w = (side * level.m_per_px * image.naturalWidth) / (east - west),
    h = (side * level.m_per_px * image.naturalHeight) / (north - south);
  c.drawImage(image, cell.column * w, cell.row * h, w, h, ...to);
}
