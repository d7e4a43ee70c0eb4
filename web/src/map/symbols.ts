/// The symbols of the map on a canvas; the same shapes as ui/marks.tsx draws in SVG for chips and tables.
import type { AnchorStatus, Ellipse95 } from '../live/messages';
import type { Palette } from './palette';
import { status_colour } from './palette';

export type Ctx = CanvasRenderingContext2D;
const TURN = Math.PI * 2;

/// Dots between an anchor and its mirror solution.
export function mirror_dots(c: Ctx, p: Palette, x: number, y: number, mx: number, my: number): void {
  c.save();
  c.strokeStyle = p.caution;
  c.lineWidth = 1;
  c.setLineDash([2, 4]);
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(mx, my);
  c.stroke();
  c.restore();
}

function tick(c: Ctx, x: number, y: number, r: number): void {
  c.beginPath();
  c.moveTo(x - r * 0.48, y + r * 0.05);
  c.lineTo(x - r * 0.12, y + r * 0.42);
  c.lineTo(x + r * 0.5, y - r * 0.36);
  c.stroke();
}
/// An anchor at (x, y) px with radius r px. Hollow where it is stale.
export function anchor_symbol(c: Ctx, p: Palette, status: AnchorStatus, x: number, y: number, r: number): void {
  const colour = status_colour(p, status);
  c.save();
  c.lineCap = c.lineJoin = 'round';
  c.fillStyle = p.halo;
  c.beginPath();
  c.arc(x, y, r + 2.5, 0, TURN);
  c.fill();
  c.strokeStyle = c.fillStyle = colour;
  c.lineWidth = Math.max(1.8, r * 0.27);
  const ring = (dash: number[] = []): void => {
    c.setLineDash(dash);
    c.beginPath();
    c.arc(x, y, r * 0.86, 0, TURN);
    c.stroke();
    c.setLineDash([]);
  };
  switch (status) {
    case 'found':
      ring([r * 0.36, r * 0.42]);
      c.beginPath();
      c.arc(x, y, r * 0.28, 0, TURN);
      c.fill();
      break;
    case 'estimating':
      ring();
      c.beginPath();
      c.arc(x, y, r * 0.38, 0, TURN);
      c.fill();
      break;
    case 'converged':
    case 'passes':
    case 'within_goal':
    case 'over_goal':
      ring();
      tick(c, x, y, r * 0.82);
      break;
    case 'accepted':
      c.beginPath();
      c.arc(x, y, r, 0, TURN);
      c.fill();
      c.strokeStyle = p.halo;
      tick(c, x, y, r);
      break;
    case 'gave_up':
    case 'withheld':
      ring();
      c.beginPath();
      c.moveTo(x - r * 0.42, y);
      c.lineTo(x + r * 0.42, y);
      c.stroke();
      break;
    case 'ambiguous':
      ring();
      c.beginPath();
      c.arc(x, y, r * 0.86, -Math.PI / 2, Math.PI / 2);
      c.fill();
      break;
    case 'moved': {
      c.beginPath();
      for (let i = 0; i < 8; i++)
        c.lineTo(x + r * 1.05 * Math.cos(((i + 0.5) * TURN) / 8), y + r * 1.05 * Math.sin(((i + 0.5) * TURN) / 8));
      c.closePath();
      c.fill();
      c.strokeStyle = p.halo;
      c.beginPath();
      c.moveTo(x - r * 0.4, y - r * 0.4);
      c.lineTo(x + r * 0.4, y + r * 0.4);
      c.moveTo(x + r * 0.4, y - r * 0.4);
      c.lineTo(x - r * 0.4, y + r * 0.4);
      c.stroke();
      break;
    }
  }
  c.restore();
}
/// Reticle of the selected anchor.
export function reticle(c: Ctx, p: Palette, x: number, y: number, r: number): void {
  c.save();
  for (const [colour, width] of [
    [p.halo, p.data + 3],
    [p.ink, p.data],
  ] as const) {
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.beginPath();
    c.arc(x, y, r, 0, TURN);
    c.stroke();
    c.beginPath();
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ] as const) {
      c.moveTo(x + dx * (r - 4), y + dy * (r - 4));
      c.lineTo(x + dx * (r + 5), y + dy * (r + 5));
    }
    c.stroke();
  }
  c.restore();
}
/// A 95 % ellipse about (x, y): axes in px, azimuth clockwise from north. `ghost` is the mirror solution.
export function ellipse_at(
  c: Ctx,
  p: Palette,
  e: Ellipse95,
  x: number,
  y: number,
  px_per_m: number,
  colour: string,
  ghost: boolean,
): void {
  c.save();
  c.beginPath();
  c.ellipse(x, y, e.major_m * px_per_m, e.minor_m * px_per_m, ((e.azimuth_deg - 90) * Math.PI) / 180, 0, TURN);
  c.fillStyle = colour;
  c.globalAlpha = ghost ? 0.05 : 0.13;
  c.fill();
  c.globalAlpha = 1;
  c.strokeStyle = colour;
  c.lineWidth = p.data;
  c.setLineDash(ghost ? [4, 4] : []);
  c.stroke();
  c.restore();
}
/// Arrowhead towards heading (degrees clockwise from north), or a diamond where the heading is unknown. Hollow = stale.
export function drone(c: Ctx, p: Palette, x: number, y: number, heading_deg: number | null, hollow: boolean): void {
  const s = p.rem / 16;
  c.save();
  c.translate(x, y);
  if (heading_deg !== null) c.rotate((heading_deg * Math.PI) / 180);
  c.scale(s, s);
  c.beginPath();
  if (heading_deg === null) {
    c.moveTo(0, -12);
    c.lineTo(12, 0);
    c.lineTo(0, 12);
    c.lineTo(-12, 0);
  } else {
    c.moveTo(0, -16);
    c.lineTo(12, 14);
    c.lineTo(0, 7);
    c.lineTo(-12, 14);
  }
  c.closePath();
  c.lineJoin = 'round';
  c.strokeStyle = p.halo;
  c.lineWidth = 5;
  c.stroke();
  c.fillStyle = hollow ? p.panel : p.ink;
  c.fill();
  if (hollow) {
    c.strokeStyle = p.ink2;
    c.lineWidth = 2;
    c.stroke();
  }
  c.restore();
}
export interface Box {
  readonly x: number;
  readonly y: number;
  readonly w: number;
  readonly h: number;
}
const overlap = (a: Box, b: Box): boolean => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

/// What lies beyond the edges of a picture of w x h: nothing is written where it would be cut.
export const beyond = (w: number, h: number): Box[] => [
  { x: -FAR, y: -FAR, w: 2 * FAR + w, h: FAR },
  { x: -FAR, y: h, w: 2 * FAR + w, h: FAR },
  { x: -FAR, y: -FAR, w: FAR, h: 2 * FAR + h },
  { x: w, y: -FAR, w: FAR, h: 2 * FAR + h },
];
const FAR = 1e5;

/// Labels are drawn again with every picture and seldom say something new: measuring them was half of what they cost.
const widths = new Map<string, number>();
function width_of(c: Ctx, font: string, text: string): number {
  const key = `${font} ${text}`,
    known = widths.get(key);
  if (known !== undefined) return known;
  if (widths.size >= MOST_WIDTHS) widths.clear(); // readings make ever new words
  c.font = font;
  const width = c.measureText(text).width;
  widths.set(key, width);
  return width;
}
const MOST_WIDTHS = 2000;

/// A free box of w x h about (x, y), first near it, then a little further with a line to it; null where all sixteen are taken.
export function free_place(
  x: number,
  y: number,
  gap: number,
  w: number,
  h: number,
  taken: readonly Box[],
): { readonly box: Box; readonly far: boolean } | null {
  for (const [far, d] of [
    [false, gap],
    [true, gap + h * 1.4],
  ] as const) {
    const at = (dx: number, dy: number): Box => ({
      x: dx > 0 ? x + d : dx < 0 ? x - d - w : x - w / 2,
      y: dy > 0 ? y + d : dy < 0 ? y - d - h : y - h / 2,
      w,
      h,
    });
    const places = [at(1, 0), at(-1, 0), at(0, -1), at(0, 1), at(1, -1), at(1, 1), at(-1, -1), at(-1, 1)];
    const box = places.find((b) => !taken.some((t) => overlap(b, t)));
    if (box) return { box, far };
  }
  return null;
}
const APART_PX = 2;
/// A label where it has room: of (x, y), in this box; `far`: with a line to it.
export interface Label {
  readonly x: number;
  readonly y: number;
  readonly head: string;
  readonly sub: string;
  readonly box: Box;
  readonly far: boolean;
}
const fonts = (p: Palette) => {
  const [h1, h2] = [p.rem * 0.8125, p.rem * 0.75];
  return { h1, h2, heads: `600 ${h1}px ${p.font}`, subs: `500 ${h2}px ${p.font}` };
};
/// Two-line label beside (x, y) where there is room, else its first line alone, else none: a name over a name says neither. `always`: it is drawn
/// whatever it covers. Adds itself to `taken`.
export function place_label(
  c: Ctx,
  p: Palette,
  x: number,
  y: number,
  gap: number,
  head: string,
  sub: string,
  taken: Box[],
  always: boolean,
): Label[] {
  const { h1, h2, heads, subs } = fonts(p);
  const w1 = width_of(c, heads, head),
    w2 = Math.max(w1, width_of(c, subs, sub)),
    whole = free_place(x, y, gap, w2, h1 + (sub ? h2 + 3 : 0), taken),
    found = whole ?? (sub ? free_place(x, y, gap, w1, h1, taken) : null);
  if (!found && !always) return [];
  const box = found?.box ?? { x: x + gap, y: y - h1, w: w2, h: h1 + (sub ? h2 + 3 : 0) };
  taken.push({ x: box.x - APART_PX, y: box.y - APART_PX, w: box.w + 2 * APART_PX, h: box.h + 2 * APART_PX });
  return [{ x, y, head, sub: whole || !found ? sub : '', box, far: found?.far ?? false }];
}
/// All lines first: none of them strikes out a name.
export function draw_labels(c: Ctx, p: Palette, labels: readonly Label[]): void {
  c.save();
  c.strokeStyle = p.ink3;
  c.lineWidth = p.fine;
  for (const { x, y, box, far } of labels) {
    if (!far) continue;
    c.beginPath();
    c.moveTo(x, y);
    c.lineTo(Math.max(box.x, Math.min(x, box.x + box.w)), Math.max(box.y, Math.min(y, box.y + box.h)));
    c.stroke();
  }
  c.restore();
  for (const l of labels) draw_text(c, p, l);
}
function draw_text(c: Ctx, p: Palette, { x, head, sub, box }: Label): void {
  const { h1, h2, heads, subs } = fonts(p),
    w = box.w;
  c.save();
  c.textBaseline = 'top';
  c.lineJoin = 'round';
  c.strokeStyle = p.halo;
  c.lineWidth = 4;
  c.textAlign = box.x + w / 2 < x - 1 ? 'right' : box.x + w / 2 > x + 1 ? 'left' : 'center';
  const tx = c.textAlign === 'right' ? box.x + w : c.textAlign === 'left' ? box.x : box.x + w / 2;
  c.font = heads;
  c.strokeText(head, tx, box.y);
  c.fillStyle = p.ink;
  c.fillText(head, tx, box.y);
  if (sub) {
    c.font = subs;
    c.strokeText(sub, tx, box.y + h1 + 3);
    c.fillStyle = p.old ? p.ink3 : p.ink2;
    c.fillText(sub, tx, box.y + h1 + 3);
    if (p.old) {
      const long = width_of(c, subs, sub),
        from = c.textAlign === 'right' ? tx - long : c.textAlign === 'left' ? tx : tx - long / 2;
      c.fillRect(from, box.y + h1 + 3 + h2 / 2, long, 1.5);
    }
  }
  c.restore();
}
