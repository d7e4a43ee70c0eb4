/// The side elevation beside a map: track, aircraft, anchors with their 95 % intervals, mirror solutions, roof and height band, seen along the
/// ground in a direction that the reader chooses. The same in every view that has a map; a chunk of its own.
import { signal } from '@preact/signals';
import { useEffect, useRef, useState } from 'preact/hooks';
import './elevation.css';
import { interpolated } from '../state/scene';
import { now_ms, tick } from '../state/store';
import { not_loaded_words } from '../ui/empty';
import { accuracy, bearing as bearing_words, fixed } from '../ui/format';
import { Icon } from '../ui/marks';
import { ground } from '../ui/theme';
import { useStable } from '../ui/use_stable';
import { along, building_bearing, extent, fit, intervals95, wind, type Fit } from './elevation';
import { magnification, round_length } from './enu';
import type { ElevationProps } from './elevation_props';
import { elevation_shown } from './elevation_shown';
import { by_priority } from './label_order';
import { palette_of, read_palette, status_colour, trail_style, type Palette } from './palette';
import type { Content } from './picture';
import {
  anchor_symbol,
  beyond,
  draw_labels,
  drone,
  mirror_dots,
  place_label,
  reticle,
  type Box,
  type Ctx,
} from './symbols';

/// Chosen by hand; null looks along the building.
const turned = signal<number | null>(null);
const STEP_DEG = 15;
const HOLE_US = 5_000_000;
const NOTE_PX = 20; // the line at the foot: above what heights are, and the scale

interface Picture {
  readonly fit: Fit;
  readonly x: (s: number) => number;
  readonly y: (u: number) => number;
  readonly ground_m: number | null;
  readonly magnified: number; ///< one for all intervals, as for the ellipses of a map
}

export default function ElevationView({
  content,
  onSelect,
  version,
  zero = 'the origin of the flight',
}: ElevationProps) {
  const canvas = useRef<HTMLCanvasElement>(null),
    [size, set_size] = useState<readonly [number, number]>([0, 0]),
    placed = useRef<readonly { readonly id: string; readonly x: number; readonly y: number }[]>([]);
  const now = tick.value,
    theme = ground.value;
  useEffect(() => {
    const box = canvas.current!.parentElement!,
      look = (): void => set_size([box.clientWidth, box.clientHeight]);
    look();
    const watch = new ResizeObserver(look);
    watch.observe(box);
    return () => watch.disconnect();
  }, []);
  const shown = content(),
    outline = shown.flight?.outline ?? [],
    along_building = building_bearing(outline),
    bearing_deg = turned.value ?? along_building,
    [w, h] = size;
  const draw = useStable((): void => {
    const c = canvas.current?.getContext('2d');
    if (!c || w < 40 || h < 40) return;
    const ratio = Math.min(2, devicePixelRatio || 1);
    canvas.current!.width = Math.round(w * ratio);
    canvas.current!.height = Math.round(h * ratio);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    placed.current = draw_elevation(c, w, h, content(), bearing_deg, zero);
  });
  useEffect(draw, [now, theme, version, w, h, bearing_deg, draw]);
  const picture = arranged(shown, bearing_deg, w, h),
    turn = (by: number): void => {
      turned.value = (Math.round((bearing_deg + by) / STEP_DEG) * STEP_DEG + 360) % 360;
    };
  return (
    <section class="elevation" data-testid="elevation" aria-label="Side elevation">
      <div class="elevbar">
        <h2>Side</h2>
        <select
          aria-label="Direction of the side elevation"
          data-testid="elevation-direction"
          value={
            turned.value === null
              ? 'building'
              : turned.value === (along_building + 90) % 180
                ? 'across'
                : String(turned.value)
          }
          onChange={(e) => {
            const v = e.currentTarget.value;
            turned.value = v === 'building' ? null : v === 'across' ? (along_building + 90) % 180 : Number(v);
          }}
        >
          <option value="building">{outline.length > 2 ? 'along the building' : 'west to east'}</option>
          <option value="across">{outline.length > 2 ? 'across the building' : 'south to north'}</option>
          {outline.length > 2 && <option value="90">west to east</option>}
          {outline.length > 2 && <option value="0">south to north</option>}
          {turned.value !== null && ![0, 90, (along_building + 90) % 180].includes(turned.value) && (
            <option value={String(turned.value)}>turned</option>
          )}
        </select>
        <button class="eb" aria-label="Turn left by 15 degrees" onClick={() => turn(-STEP_DEG)}>
          −15°
        </button>
        <button class="eb" aria-label="Turn right by 15 degrees" onClick={() => turn(STEP_DEG)}>
          +15°
        </button>
        <span
          class="n mut"
          data-testid="elevation-bearing"
          title="Seen from the side: what is at the left and at the right, and the bearing to the right"
        >
          {wind(bearing_deg + 180)} to {wind(bearing_deg)}, {bearing_words(bearing_deg)}°
        </span>
        <span class="grow" />
        <button class="eb" aria-label="Close the side elevation" onClick={() => (elevation_shown.value = false)}>
          <Icon name="close" />
        </button>
      </div>
      <div class="elevbox">
        <canvas
          ref={canvas}
          role="img"
          aria-label={words(shown, picture, zero)}
          onClick={(e) => {
            const near = placed.current
              .map((a) => ({ id: a.id, d: Math.hypot(a.x - e.offsetX, a.y - e.offsetY) }))
              .sort((a, b) => a.d - b.d)[0];
            if (near && near.d < 28) onSelect(near.id);
          }}
        />
      </div>
    </section>
  );
}

/// What the picture says, for who cannot see it; all of it is also in the tables.
function words(content: Content, picture: Picture | null, above: string): string {
  const zero = picture?.ground_m ?? 0,
    at = content.scene?.pose?.value.enu_m,
    ups = content.anchors.flatMap((a) => (a.enu_m ? [a.enu_m[2] - zero] : []));
  return [
    'Side elevation',
    ...(picture ? [note(picture, above)] : []),
    ...(content.link_lost ? ['values are the last known'] : []),
    ...(at ? [`aircraft at ${fixed(at[2] - zero, 1)} m`] : []),
    ...(content.flight?.heights ? [`roof at ${fixed(content.flight.heights.roof_m, 1)} m`] : []),
    ups.length
      ? `${ups.length} anchors between ${fixed(Math.min(...ups), 1)} and ${fixed(Math.max(...ups), 1)} m`
      : content.link_lost
        ? 'no anchor loaded'
        : 'no anchors yet',
  ].join(', ');
}

/// Where things go: null while there is nothing to show.
function arranged(content: Content, bearing_deg: number, w: number, h: number): Picture | null {
  if (w < 40 || h < 40) return null;
  const s = (m: readonly [number, number] | readonly [number, number, number]): number => along(bearing_deg, m),
    { flight, scene, reach_m = [] } = content,
    heights = flight?.heights ?? null,
    ground_m = heights?.ground_m ?? null,
    zero = ground_m ?? 0,
    flown: [number, number][] = (scene?.trail ?? []).map((q) => [s([q.e, q.n]), q.u]),
    pose = scene?.pose?.value.enu_m;
  if (pose) flown.push([s(pose), pose[2]]);
  for (const q of reach_m) flown.push([s(q), q[2]]);
  const planned: [number, number][] = heights
    ? [
        ...(flight?.outline ?? []).flatMap((q): [number, number][] => [
          [s(q), zero],
          [s(q), zero + heights.roof_m],
        ]),
        ...(flight?.waypoints ?? []).map((q, i): [number, number] => [s(q), zero + (heights.waypoints[i] ?? 0)]),
      ]
    : [];
  const base = extent([...flown, ...planned]),
    span = base ? Math.max(30, base.s1 - base.s0) : Infinity,
    rise = base ? Math.max(6, (base.u1 - base.u0) / 2) : Infinity;
  // An estimate that is still far off must not shrink the flight to a line.
  const near = (q: readonly [number, number]): boolean =>
    !base || (q[0] > base.s0 - span && q[0] < base.s1 + span && q[1] > base.u0 - rise && q[1] < base.u1 + rise);
  const estimated = content.anchors.flatMap((a): [number, number][] => {
    const i = intervals95(a, bearing_deg),
      reach = i && i.up_m < 3 ? i.up_m : 0;
    return [
      ...(a.enu_m
        ? ([
            [s(a.enu_m), a.enu_m[2] - reach],
            [s(a.enu_m), a.enu_m[2] + reach],
          ] as [number, number][])
        : []),
      ...(a.mirror?.enu_m ? [[s(a.mirror.enu_m), a.mirror.enu_m[2]] as [number, number]] : []),
    ];
  });
  const box = extent([...flown, ...planned, ...estimated.filter(near)]);
  if (!box) return null;
  const [left, right, top, bottom] = [44, 28, 22, 30],
    f = fit(box, w - left - right, h - top - bottom),
    [ms, mu] = [(box.s0 + box.s1) / 2, (box.u0 + box.u1) / 2],
    [mx, my] = [left + (w - left - right) / 2, top + (h - top - bottom) / 2];
  const reaches = content.anchors.flatMap((a) => intervals95(a, bearing_deg)?.up_m ?? []),
    magnified = magnification(reaches, f.up_px_per_m, Math.min(22, h / 8));
  return { fit: f, ground_m, magnified, x: (v) => mx + (v - ms) * f.px_per_m, y: (v) => my - (v - mu) * f.up_px_per_m };
}

function draw_elevation(
  c: Ctx,
  w: number,
  h: number,
  content: Content,
  bearing_deg: number,
  zero: string,
): { id: string; x: number; y: number }[] {
  const p = palette_of(read_palette(), content.link_lost);
  c.fillStyle = p.map;
  c.fillRect(0, 0, w, h);
  const picture = arranged(content, bearing_deg, w, h);
  if (!picture) {
    c.fillStyle = p.ink2;
    c.font = `400 ${p.rem * 0.8125}px ${p.font}`;
    c.textAlign = 'center';
    c.fillText(
      content.link_lost ? not_loaded_words('lost') : 'Nothing to show yet: no track, no plan, no anchor.',
      w / 2,
      h / 2,
    );
    return [];
  }
  const s = (m: readonly [number, number] | readonly [number, number, number]): number =>
      picture.x(along(bearing_deg, m)),
    taken: Box[] = [...beyond(w, h), { x: 0, y: h - NOTE_PX, w, h: NOTE_PX }];
  axes(c, p, w, h, picture, note(picture, zero));
  planned(c, p, w, content, picture, s, taken);
  flown(c, p, content, picture, s);
  const r = p.rem * 0.47,
    at = content.anchors.flatMap((a) => (a.enu_m ? [{ a, x: s(a.enu_m), y: picture.y(a.enu_m[2]) }] : []));
  for (const { x, y } of at) taken.push({ x: x - r - 2, y: y - r - 2, w: 2 * r + 4, h: 2 * r + 4 });
  for (const { a, x, y } of at) {
    const colour = status_colour(p, a.status);
    interval(c, p, x, y, intervals95(a, bearing_deg), picture, colour, false);
    if (!a.mirror?.enu_m) continue;
    const [mx, my] = [s(a.mirror.enu_m), picture.y(a.mirror.enu_m[2])];
    mirror_dots(c, p, x, y, mx, my);
    interval(c, p, mx, my, intervals95(a, bearing_deg), picture, colour, true);
    c.save();
    c.strokeStyle = colour;
    c.lineWidth = 1.6;
    c.setLineDash([3, 3]);
    c.beginPath();
    c.arc(mx, my, r * 0.8, 0, Math.PI * 2);
    c.stroke();
    c.restore();
    taken.push({ x: mx - r, y: my - r, w: 2 * r, h: 2 * r });
  }
  for (const { a, x, y } of at) anchor_symbol(c, p, a.status, x, y, r);
  aircraft(c, p, content, picture, s);
  const ordered = by_priority(
      at.map(({ a }) => a),
      content.selected,
      content.flight?.target ?? null,
    ),
    up = (u: number, v95_m: number | null = null): string =>
      `${fixed(u - (picture.ground_m ?? 0), 2)} m${v95_m === null ? '' : ` ${accuracy(v95_m)}`}`;
  const names = ordered.flatMap((a) => {
    const on = a.anchor === content.selected,
      [x, y] = [s(a.enu_m!), picture.y(a.enu_m![2])];
    if (on) reticle(c, p, x, y, r * 2.2);
    return place_label(c, p, x, y, on ? r * 2.2 + 8 : r + 6, a.anchor, up(a.enu_m![2], a.v95_m), taken, on);
  });
  const mirrors = ordered.flatMap((a) => {
    if (!a.mirror?.enu_m) return [];
    const [x, y] = [s(a.mirror.enu_m), picture.y(a.mirror.enu_m[2])];
    return place_label(c, p, x, y, r + 6, 'mirror', up(a.mirror.enu_m[2]), taken, false);
  });
  draw_labels(c, p, [...names, ...mirrors]);
  return at.map(({ a, x, y }) => ({ id: a.anchor, x, y }));
}

/// Above what heights are, and what is not drawn to scale.
const note = ({ ground_m, fit: f, magnified }: Picture, zero: string): string =>
  `m above ${ground_m === null ? zero : 'the ground'}${f.exaggeration > 1 ? `, heights ×${f.exaggeration}` : ''}${
    magnified > 1 ? `, 95 % intervals ×${magnified}` : ''
  }`;

function axes(c: Ctx, p: Palette, w: number, h: number, picture: Picture, words: string): void {
  const { fit: f, y, ground_m } = picture,
    zero = ground_m ?? 0,
    up = round_length(Math.max(0.5, 60 / f.up_px_per_m)),
    across = round_length(110 / f.px_per_m);
  c.save();
  c.strokeStyle = p.grid;
  c.lineWidth = 1;
  c.fillStyle = p.ink2;
  c.font = `400 ${p.rem * 0.75}px ${p.font}`;
  c.beginPath();
  const u_of = (py: number): number => zero + (y(zero) - py) / f.up_px_per_m;
  for (let u = Math.ceil((u_of(h) - zero) / up) * up; zero + u <= u_of(0); u += up) {
    const py = Math.round(y(zero + u)) + 0.5;
    c.moveTo(40, py);
    c.lineTo(w, py);
    c.textAlign = 'right';
    c.textBaseline = 'middle';
    if (py > 8 && py < h - 18) c.fillText(fixed(u, up < 1 ? 1 : 0), 34, py);
  }
  c.stroke();
  // The ground, or the height of the origin where it is not known: one line that everything stands on.
  if (ground_m !== null) {
    c.strokeStyle = p.ink2;
    c.lineWidth = p.fine + 0.5;
    c.beginPath();
    c.moveTo(0, y(zero));
    c.lineTo(w, y(zero));
    c.stroke();
  }
  const bar = across * f.px_per_m;
  c.strokeStyle = p.ink2;
  c.lineWidth = 1.5;
  c.beginPath();
  c.moveTo(w - 20 - bar, h - 5);
  c.lineTo(w - 20 - bar, h - 9);
  c.moveTo(w - 20 - bar, h - 5);
  c.lineTo(w - 20, h - 5);
  c.lineTo(w - 20, h - 9);
  c.stroke();
  c.textAlign = 'right';
  c.textBaseline = 'alphabetic';
  c.fillText(`${across} m`, w - 26 - bar, h - 4);
  c.textAlign = 'left';
  c.fillText(words, 12, h - 5);
  c.restore();
}

function planned(
  c: Ctx,
  p: Palette,
  w: number,
  content: Content,
  picture: Picture,
  s: (m: readonly [number, number]) => number,
  taken: Box[],
): void {
  const f = content.flight,
    k = f?.heights;
  if (!f || !k) return;
  const zero = k.ground_m ?? 0,
    up = (m: number): number => picture.y(zero + m);
  c.save();
  c.font = `400 ${p.rem * 0.75}px ${p.font}`;
  const name_at = (words: string, x: number, baseline: number): void => {
    const long = c.measureText(words).width;
    c.fillStyle = p.ink2;
    c.fillText(words, x, baseline);
    taken.push({ x: c.textAlign === 'right' ? x - long : x, y: baseline - p.rem * 0.75, w: long, h: p.rem });
  };
  for (const [m, name, above] of [
    [k.high_m, 'highest', true],
    [k.low_m, 'lowest', false],
  ] as const) {
    c.strokeStyle = p.ink3;
    c.lineWidth = 1;
    c.setLineDash([6, 5]);
    c.beginPath();
    c.moveTo(40, up(m));
    c.lineTo(w, up(m));
    c.stroke();
    c.textAlign = 'right';
    name_at(`${name} ${fixed(m, 1)} m`, w - 8, up(m) + (above ? -4 : 13));
  }
  c.setLineDash([]);
  if (f.outline.length > 2) {
    const xs = f.outline.map(s),
      [x0, x1] = [Math.min(...xs), Math.max(...xs)];
    c.fillStyle = p.panel;
    c.fillRect(x0, up(k.roof_m), x1 - x0, up(0) - up(k.roof_m));
    c.strokeStyle = p.ink;
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(x0, up(0));
    c.lineTo(x0, up(k.roof_m));
    c.lineTo(x1, up(k.roof_m));
    c.lineTo(x1, up(0));
    c.stroke();
    c.textAlign = 'left';
    name_at(`roof ${fixed(k.roof_m, 1)} m`, x0 + 6, up(k.roof_m) + 14);
  }
  if (f.waypoints.length) {
    c.strokeStyle = p.ink2;
    c.lineWidth = 1.5;
    c.setLineDash([2, 4]);
    c.beginPath();
    f.waypoints.forEach((q, i) => c.lineTo(s(q), up(k.waypoints[i] ?? 0)));
    c.stroke();
    c.setLineDash([]);
    c.fillStyle = p.ink2;
    f.waypoints.forEach((q, i) => c.fillRect(s(q) - 2.5, up(k.waypoints[i] ?? 0) - 2.5, 5, 5));
  }
  if (f.target && k.target !== null) reticle(c, p, s(f.target), up(k.target), p.rem * 0.7);
  c.restore();
}

function flown(
  c: Ctx,
  p: Palette,
  content: Content,
  picture: Picture,
  s: (m: readonly [number, number]) => number,
): void {
  const points = content.scene?.trail ?? [];
  c.save();
  c.lineCap = c.lineJoin = 'round';
  c.globalAlpha = content.link_lost || !content.running ? 0.6 : 1;
  let from = 0;
  for (let i = 1; i <= points.length; i++) {
    const a = points[i - 1]!,
      b = points[i];
    if (b && b.fix === a.fix && b.t_us - a.t_us < HOLE_US) continue;
    const look = trail_style(p, a.fix);
    c.strokeStyle = look.colour;
    c.lineWidth = Math.max(1.4, look.width * 0.6);
    c.setLineDash(look.dash);
    c.beginPath();
    for (let k = from; k < i; k++) c.lineTo(s([points[k]!.e, points[k]!.n]), picture.y(points[k]!.u));
    c.stroke();
    from = i;
  }
  c.restore();
}

function interval(
  c: Ctx,
  p: Palette,
  x: number,
  y: number,
  i: { readonly along_m: number; readonly up_m: number } | null,
  { fit: f, magnified }: Picture,
  colour: string,
  ghost: boolean,
): void {
  if (!i) return;
  const [dx, dy] = [i.along_m * f.px_per_m * magnified, i.up_m * f.up_px_per_m * magnified];
  c.save();
  c.strokeStyle = colour;
  c.lineWidth = p.data;
  c.setLineDash(ghost ? [3, 3] : []);
  c.beginPath();
  for (const [ax, ay, bx, by, tx, ty] of [
    [x, y - dy, x, y + dy, 4, 0],
    [x - dx, y, x + dx, y, 0, 4],
  ] as const) {
    c.moveTo(ax, ay);
    c.lineTo(bx, by);
    c.moveTo(ax - tx, ay - ty);
    c.lineTo(ax + tx, ay + ty);
    c.moveTo(bx - tx, by - ty);
    c.lineTo(bx + tx, by + ty);
  }
  c.stroke();
  c.restore();
}

function aircraft(
  c: Ctx,
  p: Palette,
  content: Content,
  picture: Picture,
  s: (m: readonly [number, number] | readonly [number, number, number]) => number,
): void {
  const at = content.scene && interpolated(content.scene, now_ms());
  if (!at) return;
  const stale = content.link_lost || !content.running || now_ms() - content.scene.pose!.at_ms > 1000,
    [x, y] = [s(at.body), picture.y(at.body[2])];
  // A plumb line: how high it is above what.
  c.save();
  c.strokeStyle = p.ink3;
  c.lineWidth = 1;
  c.setLineDash([2, 3]);
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x, picture.y(picture.ground_m ?? 0));
  c.stroke();
  c.restore();
  drone(c, p, x, y, null, stale);
  c.fillStyle = stale ? p.ink2 : p.panel;
  c.beginPath();
  c.arc(s(at.antenna), picture.y(at.antenna[2]), (3 * p.rem) / 16, 0, Math.PI * 2);
  c.fill();
}
