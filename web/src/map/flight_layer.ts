/// What is to be flown, under everything else: outline, fence, no-fly areas, waypoints, the planner's candidates and its choice.
import { to_px, type Camera } from './camera';
import type { Palette } from './palette';
import { reticle, type Box, type Ctx } from './symbols';

export type Point = readonly [number, number];
export interface FlightPicture {
  readonly outline: readonly Point[];
  readonly fence: readonly Point[];
  readonly no_fly: readonly (readonly Point[])[];
  readonly waypoints: readonly Point[];
  readonly reached: number; ///< waypoints done
  readonly candidates: readonly { readonly at: Point; readonly rank: number | null }[]; ///< 0 best to 5; null: refused
  readonly visited: readonly Point[];
  readonly target: Point | null;
  readonly heights: Heights | null;
}
/// The same upwards, in metres of the flight's origin; null where a plan says nothing of it.
export interface Heights {
  readonly ground_m: number | null; ///< null: not known yet
  readonly roof_m: number; ///< these above the ground
  readonly low_m: number;
  readonly high_m: number;
  readonly waypoints: readonly number[];
  readonly target: number | null;
}

/// `over_plan`: the plan of the floor shows through the outline.
export function draw_flight(c: Ctx, p: Palette, cam: Camera, f: FlightPicture, over_plan = false): void {
  c.save();
  const trace = (points: readonly Point[], close: boolean): void => {
    c.beginPath();
    for (const q of points) c.lineTo(...to_px(cam, q));
    if (close) c.closePath();
  };
  if (f.outline.length > 2) {
    trace(f.outline, true);
    c.fillStyle = p.panel;
    if (!over_plan) c.fill();
    c.strokeStyle = p.ink;
    c.lineWidth = 2.5;
    c.stroke();
  }
  if (f.fence.length > 2) {
    trace(f.fence, true);
    c.strokeStyle = p.ink2;
    c.lineWidth = 1.2;
    c.setLineDash([12, 4, 2, 4]);
    c.stroke();
  }
  for (const area of f.no_fly) no_fly(c, p, cam, area, trace);
  squares(c, p, cam, f);
  if (f.waypoints.length > 1) {
    trace(f.waypoints, false);
    c.strokeStyle = p.ink2;
    c.lineWidth = 1.5;
    c.setLineDash([2, 4]);
    c.stroke();
  }
  c.setLineDash([]);
  const shown = new Set(numbered(cam, p, f).map((w) => w.index));
  c.fillStyle = p.ink2;
  f.waypoints.forEach((w, i) => {
    if (shown.has(i)) return;
    const [x, y] = to_px(cam, w);
    c.fillRect(x - 2, y - 2, 4, 4);
  });
  for (const i of shown)
    waypoint(c, p, ...to_px(cam, f.waypoints[i]!), i, i < f.reached ? 'done' : i === f.reached ? 'next' : 'later');
  c.strokeStyle = p.ink2;
  c.lineWidth = 1.6;
  c.beginPath();
  for (const v of f.visited) {
    const [x, y] = to_px(cam, v);
    c.moveTo(x - 4, y - 4);
    c.lineTo(x + 4, y + 4);
    c.moveTo(x + 4, y - 4);
    c.lineTo(x - 4, y + 4);
  }
  c.stroke();
  if (f.target) reticle(c, p, ...to_px(cam, f.target), p.rem * 0.8);
  c.restore();
}

function no_fly(
  c: Ctx,
  p: Palette,
  cam: Camera,
  area: readonly Point[],
  trace: (points: readonly Point[], close: boolean) => void,
): void {
  if (area.length < 3) return;
  c.save();
  trace(area, true);
  c.strokeStyle = p.bad;
  c.lineWidth = 2;
  c.stroke();
  c.clip();
  const px = area.map((q) => to_px(cam, q)),
    [x0, x1] = [Math.min(...px.map(([x]) => x)), Math.max(...px.map(([x]) => x))],
    [y0, y1] = [Math.min(...px.map(([, y]) => y)), Math.max(...px.map(([, y]) => y))];
  c.lineWidth = 1;
  c.globalAlpha = 0.7;
  c.beginPath();
  for (let x = Math.max(x0, 0) - (y1 - y0); x < Math.min(x1, cam.w); x += 8) {
    c.moveTo(x, y1);
    c.lineTo(x + (y1 - y0), y0);
  }
  c.stroke();
  c.restore();
}

/// Best is strongest against the ground and largest; what is refused is a faint hollow square.
function squares(c: Ctx, p: Palette, cam: Camera, f: FlightPicture): void {
  const SIDE = [13, 11, 9.5, 8, 7, 6],
    ALPHA = [1, 0.85, 0.7, 0.55, 0.45, 0.35];
  c.setLineDash([]);
  for (const { at, rank } of f.candidates) {
    const [x, y] = to_px(cam, at);
    if (rank === null) {
      c.globalAlpha = 0.4;
      c.strokeStyle = p.ink3;
      c.lineWidth = 1;
      c.strokeRect(x - 3, y - 3, 6, 6);
      continue;
    }
    const s = SIDE[rank]!;
    c.globalAlpha = ALPHA[rank]!;
    c.fillStyle = p.info;
    c.fillRect(x - s / 2, y - s / 2, s, s);
  }
  c.globalAlpha = 1;
}

/// Waypoints whose number has room; the next one always has. The others are dots.
export function numbered(
  cam: Camera,
  p: Pick<Palette, 'rem'>,
  f: Pick<FlightPicture, 'waypoints' | 'reached'>,
): { readonly index: number; readonly box: Box }[] {
  const r = p.rem * 0.55,
    out: { index: number; box: Box }[] = [],
    order = [f.reached, ...f.waypoints.keys()].filter((i, k, all) => f.waypoints[i] && all.indexOf(i) === k);
  for (const index of order) {
    const [x, y] = to_px(cam, f.waypoints[index]!),
      box = { x: x - r, y: y - r, w: 2 * r, h: 2 * r };
    if (!out.some((o) => Math.abs(o.box.x - box.x) < 2 * r + 1 && Math.abs(o.box.y - box.y) < 2 * r + 1))
      out.push({ index, box });
  }
  return out;
}

function waypoint(c: Ctx, p: Palette, x: number, y: number, index: number, state: 'done' | 'next' | 'later'): void {
  const r = p.rem * 0.55;
  c.fillStyle = state === 'next' ? p.ink : p.panel;
  c.strokeStyle = p.ink2;
  c.lineWidth = 1.5;
  c.fillRect(x - r, y - r, 2 * r, 2 * r);
  c.strokeRect(x - r, y - r, 2 * r, 2 * r);
  c.fillStyle = c.strokeStyle = state === 'next' ? p.panel : p.ink;
  if (state === 'done') {
    c.beginPath();
    c.moveTo(x - r * 0.5, y);
    c.lineTo(x - r * 0.1, y + r * 0.4);
    c.lineTo(x + r * 0.55, y - r * 0.4);
    c.stroke();
    return;
  }
  c.font = `600 ${p.rem * 0.72}px ${p.font}`;
  c.textAlign = 'center';
  c.textBaseline = 'middle';
  c.fillText(String(index + 1), x, y + 0.5);
}
