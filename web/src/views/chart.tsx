/// The few drawings of the Models and Measurements views: an SVG of the box's own size, so that text keeps its size.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';

export interface Frame {
  readonly w: number;
  readonly h: number;
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
}
export type Scale = (v: number) => number;

/// `draw` gets the size; `label` is what a reader without eyes hears.
export function Drawing({
  label,
  draw,
  cls = '',
}: {
  label: string;
  draw: (w: number, h: number) => ComponentChildren;
  cls?: string;
}) {
  const box = useRef<HTMLDivElement>(null),
    [size, set_size] = useState<[number, number] | null>(null);
  useEffect(() => {
    const look = (): void => {
      if (box.current) set_size([box.current.clientWidth, box.current.clientHeight]);
    };
    look();
    const watch = new ResizeObserver(look);
    if (box.current) watch.observe(box.current);
    return () => watch.disconnect();
  }, []);
  return (
    <div class={`drawing ${cls}`} ref={box}>
      {size && size[0] > 0 && (
        <svg width={size[0]} height={size[1]} role="img" aria-label={label}>
          {draw(size[0], size[1])}
        </svg>
      )}
    </div>
  );
}

/// Room for text, given for type of the usual 16 px: large type and the sun theme need more of it.
export const room = (px: number): number =>
  (px * (parseFloat(getComputedStyle(document.documentElement).fontSize) || 16)) / 16;
const k_char_px = 7; ///< of tick text, on the wide side

export const scale =
  (from: readonly [number, number], to: readonly [number, number]): Scale =>
  (v) =>
    to[0] + ((v - from[0]) / (from[1] - from[0] || 1)) * (to[1] - to[0]);
export const line = (points: readonly (readonly [number, number])[]): string =>
  points.map(([x, y], i) => `${i ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`).join('');

/// Decimals at which ticks differ: none where they are whole.
export const decimals = (ts: readonly number[]): number =>
  ts.length < 2 ? 0 : Math.min(3, Math.max(0, -Math.floor(Math.log10(Math.abs(ts[1]! - ts[0]!)) + 1e-9)));
/// Three to six round numbers between two ends.
export function ticks(min: number, max: number, about = 5): number[] {
  const raw = (max - min) / about,
    power = 10 ** Math.floor(Math.log10(raw || 1)),
    step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw) ?? raw;
  const out: number[] = [];
  for (let v = Math.ceil(min / step - 1e-9) * step; v <= max + step * 1e-6; v += step)
    out.push(Math.abs(v) < step * 1e-9 ? 0 : v);
  return out;
}
export function Axes({
  f,
  x,
  y,
  xs,
  ys,
  xw,
  yw,
}: {
  f: Frame;
  x: Scale;
  y: Scale;
  xs: readonly number[];
  ys: readonly number[];
  xw: (v: number) => string;
  yw: (v: number) => string;
}) {
  // A label that would run into the one before it is left out.
  let end = -Infinity;
  const labels = xs.flatMap((v) => {
    const text = xw(v),
      wide = room(text.length * k_char_px),
      at_edge = x(v) > f.w - f.right - wide / 2,
      from = x(v) - (at_edge ? wide : wide / 2);
    if (from < end) return [];
    end = from + wide;
    return [{ v, text, anchor: at_edge ? 'end' : 'middle' } as const];
  });
  return (
    <g>
      {ys.map((v) => (
        <g key={`y${v}`}>
          <path class="gridl" d={`M${f.left} ${y(v)}H${f.w - f.right}`} />
          <text class="ticktext" x={f.left - 6} y={y(v) + 4} text-anchor="end">
            {yw(v)}
          </text>
        </g>
      ))}
      {labels.map(({ v, text, anchor }) => (
        <text key={`x${v}`} class="ticktext" x={x(v)} y={f.h - f.bottom + room(16)} text-anchor={anchor}>
          {text}
        </text>
      ))}
    </g>
  );
}
