/// What is drawn, given a camera, from below: the slow picture (grid, ellipses, trail), the fast one (ranges, drone), the top (symbols, labels).
import type { EstimateMsg, FixClass, Vec3 } from '../live/messages';
import { interpolated, range_class, type Scene, type TrailPoint } from '../state/scene';
import type { Backdrop } from '../state/floors';
import { accuracy, age, percent } from '../ui/format';
import { to_px, type Camera } from './camera';
import { round_length } from './enu';
import { by_priority } from './label_order';
import { draw_flight, numbered, type FlightPicture } from './flight_layer';
import { palette_of, range_colour, status_colour, trail_style, type Palette } from './palette';
import {
  anchor_symbol,
  beyond,
  draw_labels,
  drone,
  ellipse_at,
  mirror_dots,
  place_label,
  reticle,
  type Box,
  type Ctx,
} from './symbols';
import { draw_tiles } from './tiles';

export interface Content {
  readonly anchors: readonly EstimateMsg[];
  readonly selected: string | null;
  readonly scene: Scene | null;
  readonly link_lost: boolean;
  readonly running: boolean; ///< the flight is being recorded
  readonly flight?: FlightPicture | null; ///< what is to be flown, where something is
  readonly backdrops?: readonly Backdrop[]; ///< plans of floors, under everything
  readonly reach_m?: readonly Vec3[]; ///< of a stored flight: corners of all that was flown, whatever the moment
}

const RANGE_STALE_MS = 2000,
  POSE_STALE_MS = 1000,
  TRAIL_US = 120_000_000;
const symbol_r = (p: Palette): number => p.rem * 0.47;

/// Grid, ellipses and what was flown, below everything that moves.
export function draw_slow(c: Ctx, palette: Palette, cam: Camera, content: Content, magnified: number): void {
  const p = palette_of(palette, content.link_lost);
  c.fillStyle = p.map;
  c.fillRect(0, 0, cam.w, cam.h);
  grid(c, p, cam);
  const backdrops = content.backdrops ?? [];
  for (const b of backdrops) draw_backdrop(c, cam, b);
  if (content.flight) draw_flight(c, p, cam, content.flight, backdrops.length > 0);
  const r = symbol_r(p);
  for (const a of content.anchors) {
    if (!a.enu_m) continue;
    const [x, y] = to_px(cam, a.enu_m),
      colour = status_colour(p, a.status);
    const scale = cam.px_per_m * magnified;
    if (a.mirror?.enu_m) {
      const [mx, my] = to_px(cam, a.mirror.enu_m);
      mirror_link(c, p, x, y, mx, my);
      if (a.ellipse95) ellipse_at(c, p, mirrored(a), mx, my, scale, colour, true);
      c.save();
      c.strokeStyle = colour;
      c.lineWidth = 1.6;
      c.setLineDash([3, 3]);
      c.beginPath();
      c.arc(mx, my, r * 0.8, 0, Math.PI * 2);
      c.stroke();
      c.restore();
    }
    // An ellipse smaller than its symbol would only blur it.
    if (a.ellipse95 && a.ellipse95.major_m * scale > r) ellipse_at(c, p, a.ellipse95, x, y, scale, colour, false);
  }
  if (content.scene) trail(c, p, cam, content.scene, faded(content), 0, content.scene.trail.length - 1);
}
/// Half as strong as it is drawn: a plan is there to find one's way by, not to be read.
export function draw_backdrop(c: Ctx, cam: Camera, b: Backdrop): void {
  const [left, bottom] = to_px(cam, b.low),
    [right, top] = to_px(cam, b.high);
  c.save();
  c.globalAlpha = 0.5;
  if (!draw_tiles(c, cam, b)) c.drawImage(b.image, left, top, right - left, bottom - top);
  c.restore();
}
/// Symbols and labels, above the ranges: a line must never strike out a name. `covered`: by buttons and scales over the map.
export function draw_top(c: Ctx, palette: Palette, cam: Camera, content: Content, covered: readonly Box[] = []): void {
  const p = palette_of(palette, content.link_lost);
  c.clearRect(0, 0, cam.w, cam.h);
  const r = symbol_r(p),
    placed = content.anchors.filter((a) => a.enu_m),
    taken: Box[] = [...beyond(cam.w, cam.h), ...covered];
  const block = (m: Vec3): void => {
    const [x, y] = to_px(cam, m);
    taken.push({ x: x - r - 2, y: y - r - 2, w: 2 * r + 4, h: 2 * r + 4 });
  };
  if (content.flight) for (const w of numbered(cam, p, content.flight)) taken.push(w.box);
  for (const a of placed) {
    block(a.enu_m!);
    if (a.mirror?.enu_m) block(a.mirror.enu_m);
  }
  for (const a of placed) anchor_symbol(c, p, a.status, ...to_px(cam, a.enu_m!), r);
  const ordered = by_priority(placed, content.selected, content.flight?.target ?? null);
  for (const a of ordered.slice(0, 1))
    if (a.anchor === content.selected) reticle(c, p, ...to_px(cam, a.enu_m!), r * 2.2);
  // The names of all before the mirror of any: what has no room waits for the selection or a closer look.
  const names = ordered.flatMap((a) => {
    const [x, y] = to_px(cam, a.enu_m!),
      gap = a.anchor === content.selected ? r * 2.2 + 8 : r + 6,
      how = a.mirror && a.probability !== null ? `${percent(a.probability)} % here` : accuracy(a.h95_m);
    return place_label(c, p, x, y, gap, a.anchor, how, taken, a.anchor === content.selected);
  });
  const mirrors = ordered.flatMap((a) => {
    if (!a.mirror?.enu_m) return [];
    const odds = a.mirror.probability === null ? a.anchor : `${percent(a.mirror.probability)} %`;
    return place_label(c, p, ...to_px(cam, a.mirror.enu_m), r + 6, 'mirror', odds, taken, false);
  });
  draw_labels(c, p, [...names, ...mirrors]);
}
/// The mirror's ellipse is the same one, reflected in the line between the two.
function mirrored(a: EstimateMsg): NonNullable<EstimateMsg['ellipse95']> {
  const [e, n] = [a.mirror!.enu_m![0] - a.enu_m![0], a.mirror!.enu_m![1] - a.enu_m![1]];
  const axis_deg = (Math.atan2(e, n) * 180) / Math.PI + 90;
  return { ...a.ellipse95!, azimuth_deg: 2 * axis_deg - a.ellipse95!.azimuth_deg };
}
function mirror_link(c: Ctx, p: Palette, x: number, y: number, mx: number, my: number): void {
  mirror_dots(c, p, x, y, mx, my);
  c.save();
  c.strokeStyle = p.caution;
  c.lineWidth = 1;
  // The line both candidates mirror in, a little longer than the picture needs
  const [cx, cy, l] = [(x + mx) / 2, (y + my) / 2, Math.hypot(mx - x, my - y) || 1];
  const [ux, uy] = [-(my - y) / l, (mx - x) / l];
  c.setLineDash([12, 4, 2, 4]);
  c.globalAlpha = 0.8;
  c.beginPath();
  c.moveTo(cx - ux * l, cy - uy * l);
  c.lineTo(cx + ux * l, cy + uy * l);
  c.stroke();
  c.restore();
}
function grid(c: Ctx, p: Palette, cam: Camera): void {
  const step = round_length(110 / cam.px_per_m);
  const [left, top] = [cam.e - cam.w / 2 / cam.px_per_m, cam.n + cam.h / 2 / cam.px_per_m];
  c.strokeStyle = p.grid;
  c.lineWidth = 1;
  c.beginPath();
  for (let e = Math.ceil(left / step) * step; ; e += step) {
    const x = Math.round((e - left) * cam.px_per_m) + 0.5;
    if (x > cam.w) break;
    c.moveTo(x, 0);
    c.lineTo(x, cam.h);
  }
  for (let n = Math.floor(top / step) * step; ; n -= step) {
    const y = Math.round((top - n) * cam.px_per_m) + 0.5;
    if (y > cam.h) break;
    c.moveTo(0, y);
    c.lineTo(cam.w, y);
  }
  c.stroke();
}

/// How much of a scene's trail the slow picture shows: drawn twice a second there, not sixty times with the drone.
export interface TrailMark {
  readonly scene: Scene;
  readonly points: number;
  readonly last: TrailPoint | undefined;
  readonly faded: boolean;
}
const faded = (content: Content): boolean => content.link_lost || !content.running;
export const mark_trail = (content: Content): TrailMark | null =>
  content.scene && {
    scene: content.scene,
    points: content.scene.trail.length,
    last: content.scene.trail.at(-1),
    faded: faded(content),
  };
/// Whether the mark is still of this trail: neither another flight, nor cut, nor jumped back in, nor far behind.
export function trail_stands(mark: TrailMark | null, content: Content): boolean {
  const scene = content.scene;
  if (!scene || !mark) return !scene && !mark;
  return (
    mark.scene === scene &&
    mark.faded === faded(content) &&
    scene.trail[mark.points - 1] === mark.last &&
    scene.trail.length - mark.points < TRAIL_AHEAD
  );
}
const TRAIL_AHEAD = 50; // 5 s of positions

/// Drone and ranges, and the trail from where the slow picture ends.
export function draw_fast(c: Ctx, palette: Palette, cam: Camera, content: Content, now_ms: number, from: number): void {
  const p = palette_of(palette, content.link_lost);
  c.clearRect(0, 0, cam.w, cam.h);
  const scene = content.scene;
  if (!scene) return;
  trail(c, p, cam, scene, faded(content), Math.max(0, from - 1), scene.trail.length - 1);
  const at = interpolated(scene, now_ms);
  if (!at) return;
  const stale = faded(content) || now_ms - scene.pose!.at_ms > POSE_STALE_MS;
  const antenna = to_px(cam, at.antenna),
    body = to_px(cam, at.body);
  const lines: RangeLine[] = [];
  for (const a of content.anchors) {
    const row = scene.ranges.get(a.anchor);
    if (!row || !a.enu_m) continue;
    const old = stale || now_ms - row.at_ms > RANGE_STALE_MS;
    const end = short_of(antenna, to_px(cam, a.enu_m), symbol_r(p) + 4);
    if (end) lines.push({ end, look: old ? 'old' : range_class(row.last.p_los) });
  }
  range_lines(c, p, antenna, lines);
  drone(c, p, ...body, at.heading_deg, stale);
  c.fillStyle = stale ? p.ink2 : p.panel;
  c.beginPath();
  c.arc(...antenna, (3 * p.rem) / 16, 0, Math.PI * 2);
  c.fill();
  if (stale && content.running)
    draw_labels(c, p, place_label(c, p, ...body, 18, `last known, ${age(now_ms - scene.pose!.at_ms)}`, '', [], true));
}
type Point = readonly [number, number];
interface RangeLine {
  readonly end: Point;
  readonly look: 'los' | 'nlos' | 'unclear' | 'old';
}
/// `to`, but so far before it; null where there is nothing between.
function short_of(from: Point, to: Point, px: number): Point | null {
  const l = Math.hypot(to[0] - from[0], to[1] - from[1]);
  return l < px + 4 ? null : [to[0] - ((to[0] - from[0]) / l) * px, to[1] - ((to[1] - from[1]) / l) * px];
}
/// Up to so many lines have a casing; of more it would only strike out the neighbours.
const CASED_LINES = 24;
/// One style after the other, and square ends: round dots cost three times as much to draw, of fifty lines half a frame.
function range_lines(c: Ctx, p: Palette, from: Point, lines: readonly RangeLine[]): void {
  const stroke = (some: readonly RangeLine[], colour: string, width: number, dash: number[], alpha: number): void => {
    if (!some.length) return;
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.globalAlpha = alpha;
    c.setLineDash(dash);
    for (const { end } of some) {
      c.beginPath();
      c.moveTo(from[0], from[1]);
      c.lineTo(end[0], end[1]);
      c.stroke();
    }
  };
  const of = (look: RangeLine['look']): RangeLine[] => lines.filter((l) => l.look === look),
    fresh = lines.filter((l) => l.look !== 'old');
  c.save();
  c.lineCap = 'butt';
  stroke(of('old'), p.ink3, 1, [2, 7], 0.6);
  if (fresh.length <= CASED_LINES) stroke(fresh, p.halo, p.casing + 1, [], 0.75);
  stroke(of('unclear'), range_colour(p, 'unclear'), p.data, [p.data, 3 * p.data], 1);
  stroke(of('nlos'), range_colour(p, 'nlos'), p.data, [9, 6], 1);
  stroke(of('los'), range_colour(p, 'los'), p.strong, [], 1);
  c.restore();
}
function trail(c: Ctx, p: Palette, cam: Camera, scene: Scene, faded: boolean, first: number, last: number): void {
  const points = scene.trail,
    newest = points[points.length - 1];
  if (!newest || last <= first) return;
  c.save();
  c.lineCap = c.lineJoin = 'round';
  c.globalAlpha = faded ? 0.5 : 1;
  const run = (from: number, to: number, colour: string, width: number, dash: number[]): void => {
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.beginPath();
    for (let i = from; i <= to; i++) {
      const q = points[i]!;
      c.lineTo(...to_px(cam, [q.e, q.n]));
    }
    c.stroke();
  };
  // Runs of one look: grey when older than 120 s, else by fix. A hole in time is a hole in the line.
  const look = (i: number): FixClass | 'old' => (newest.t_us - points[i]!.t_us > TRAIL_US ? 'old' : points[i]!.fix);
  let from = first;
  for (let i = first + 1; i <= last + 1; i++) {
    const hole = i <= last && points[i]!.t_us - points[i - 1]!.t_us > 5_000_000;
    if (i <= last && !hole && look(i) === look(from)) continue;
    const what = look(from),
      to = i <= last && !hole ? i : i - 1;
    if (what === 'old') run(from, to, p.ink3, p.fine, []);
    else {
      const s = trail_style(p, what);
      run(from, to, s.colour, s.width, s.dash);
    }
    from = i;
  }
  c.restore();
}
