/// The plan drawn to scale in metres. A tap adds to what is being drawn; a tapped point is picked, arrows move it, Delete takes it away.
import { useEffect, useRef, useState } from 'preact/hooks';
import type { Plan } from '../../api/plans';
import { length_words, round_length, type Geodetic } from '../../map/enu';
import { LevelChoice } from '../../map/level_choice';
import { draw_backdrop } from '../../map/picture';
import { backdrop_version, backdrops } from '../../state/floors';
import { Icon } from '../../ui/marks';
import { fixed } from '../../ui/format';
import { added, corners, from_m, moved, removed, to_m, type Picked, type Shape } from './draft';
import type { Placed } from './expected';
import { OnGround } from './on_ground';
import { SIDES_PX, type Cell } from './predicted_panel';
import { snapped } from './snap';
import type { Point } from './tools';

interface Props {
  plan: Plan;
  origin: Geodetic;
  drawing: Shape;
  picked: Picked | null;
  snap: boolean;
  cells: readonly Cell[];
  anchors: readonly Placed[];
  base: Point | null;
  rover: Point | null; ///< what a fitted map must also show
  walk: number | null;
  sided: boolean;
  set_sided: (on: boolean) => void;
  pick: (p: Picked | null) => void;
  change: (p: Plan) => void;
}
interface View {
  readonly e: number;
  readonly n: number;
  readonly px_per_m: number;
}
const HIT_PX = 18,
  STEP_M = 0.5,
  FINE_M = 0.1,
  BESIDE_M = 2,
  WITH_PLAN_M = 80; ///< of something drawn: an aircraft further off does not shrink the plan

export function PlanMap({
  plan,
  origin,
  drawing,
  picked,
  snap,
  cells,
  anchors,
  base,
  rover,
  walk,
  sided,
  set_sided,
  pick,
  change,
}: Props) {
  const [over, set_over] = useState<[number, number] | null>(null),
    box = useRef<HTMLDivElement>(null),
    [size, set_size] = useState<[number, number]>([0, 0]),
    [view, set_view] = useState<View | null>(null),
    drag = useRef<{ x: number; y: number; view: View; far: boolean } | null>(null);
  useEffect(() => {
    const look = (): void => {
      if (box.current) set_size([box.current.clientWidth, box.current.clientHeight]);
    };
    look();
    const watch = new ResizeObserver(look);
    watch.observe(box.current!);
    return () => watch.disconnect();
  }, []);
  const shapes: Shape[] = ['outline', 'fence', ...plan.no_fly.map((_, i) => `no_fly/${i}` as Shape), 'waypoints'];
  const metres = (shape: Shape): [number, number][] => corners(plan, shape).map((c) => to_m(c, origin));
  const fitted = (): View => {
    const drawn = shapes.flatMap(metres),
      close = (m: Point): boolean => drawn.some(([e, n]) => Math.hypot(e - m[0], n - m[1]) < WITH_PLAN_M),
      all: Point[] = [...drawn, ...[rover, base].filter((m): m is Point => m !== null && close(m))],
      es = all.map(([e]) => e),
      ns = all.map(([, n]) => n),
      [w, h] = size;
    if (!all.length || !w) return { e: 0, n: 0, px_per_m: 8 };
    const [e0, e1, n0, n1] = [Math.min(...es), Math.max(...es), Math.min(...ns), Math.max(...ns)];
    return { e: (e0 + e1) / 2, n: (n0 + n1) / 2, px_per_m: Math.min(w / (e1 - e0 + 16), h / (n1 - n0 + 16), 40) };
  };
  const v = view ?? fitted(),
    [w, h] = size;
  const px = ([e, n]: Point): [number, number] => [w / 2 + (e - v.e) * v.px_per_m, h / 2 - (n - v.n) * v.px_per_m];
  const zoom = (factor: number): void =>
    set_view({ ...v, px_per_m: Math.max(0.2, Math.min(400, v.px_per_m * factor)) });
  const at = (x: number, y: number): Picked | null => {
    let best: Picked | null = null,
      near = HIT_PX;
    for (const shape of shapes)
      metres(shape).forEach((m, index) => {
        const [a, b] = px(m),
          d = Math.hypot(a - x, b - y);
        if (d < near) {
          near = d;
          best = { shape, index };
        }
      });
    return best;
  };
  /// Where a point goes that is set at these pixels.
  const target = (x: number, y: number): { readonly at: readonly [number, number]; readonly how: string } => {
    const there: [number, number] = [v.e + (x - w / 2) / v.px_per_m, v.n - (y - h / 2) / v.px_per_m];
    return snap ? snapped(there, drawing === 'waypoints' ? [] : metres(drawing), v.px_per_m) : { at: there, how: '' };
  };
  const tap = (x: number, y: number): void => {
    const hit = at(x, y);
    if (hit) {
      pick(hit);
      return;
    }
    // The view stays while points are added: a map that jumps under the finger cannot be drawn on.
    set_view(v);
    change(added(plan, drawing, from_m(...target(x, y).at, origin)));
    pick({ shape: drawing, index: corners(plan, drawing).length });
  };
  const key = (e: KeyboardEvent): void => {
    const by = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[e.key],
      step = e.shiftKey ? FINE_M : STEP_M;
    // By keys alone: a point in the middle of what is seen, or beside the picked one, which the arrows then move.
    if (e.key === 'Enter' && e.target === box.current) {
      const from = picked && corners(plan, picked.shape)[picked.index],
        [pe, pn] = from ? to_m(from, origin) : [v.e, v.n];
      set_view(v);
      change(added(plan, drawing, from_m(from ? pe + BESIDE_M : pe, pn, origin)));
      pick({ shape: drawing, index: corners(plan, drawing).length });
      e.preventDefault();
      return;
    }
    if (!picked) return;
    const here = corners(plan, picked.shape)[picked.index];
    if (!here) return;
    if (e.key === 'Delete' || e.key === 'Backspace') {
      change(removed(plan, picked));
      pick(null);
    } else if (by) {
      const [de, dn] = to_m(here, origin);
      change(moved(plan, picked, from_m(de + by[0]! * step, dn + by[1]! * step, origin)));
    } else return;
    e.preventDefault();
  };
  const local = (e: PointerEvent): [number, number] => {
    const r = box.current!.getBoundingClientRect();
    return [e.clientX - r.left, e.clientY - r.top];
  };
  const path = (shape: Shape): string =>
    metres(shape)
      .map((m, i) => {
        const [x, y] = px(m);
        return `${i ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
      })
      .join('') + (shape !== 'waypoints' && corners(plan, shape).length > 2 ? 'Z' : '');
  /// What a tap here would set, with the length it makes.
  const Ghost = ({ over: [x, y] }: { over: [number, number] }) => {
    const to = target(x, y),
      last = metres(drawing).at(-1),
      [gx, gy] = px(to.at),
      from = last && px(last);
    return (
      <g class="ghost" data-testid="ghost">
        {from && <path d={`M${from[0]} ${from[1]}L${gx} ${gy}`} />}
        <circle cx={gx} cy={gy} r="6" />
        {last && (
          <text class="halo" x={gx + 12} y={gy - 10}>
            {fixed(Math.hypot(to.at[0] - last[0], to.at[1] - last[1]), 2)} m
            {to.how && to.how !== 'half metres' ? `, ${to.how}` : ''}
          </text>
        )}
      </g>
    );
  };
  const bar_m = round_length(130 / v.px_per_m);
  return (
    <div
      class="planmap"
      ref={box}
      role="application"
      tabIndex={0}
      aria-label="Plan map: a tap or Enter adds a point, arrows move the picked one, Delete takes it away"
      data-testid="plan-map"
      onKeyDown={key}
      onWheel={(e) => {
        e.preventDefault();
        zoom(e.deltaY < 0 ? 1.2 : 1 / 1.2);
      }}
      onPointerDown={(e) => {
        if (e.target instanceof Element && e.target.closest('button, select')) return;
        const [x, y] = local(e);
        drag.current = { x, y, view: v, far: false };
      }}
      onPointerMove={(e) => {
        const d = drag.current,
          [x, y] = local(e);
        if (e.pointerType === 'mouse')
          set_over(e.target instanceof Element && e.target.closest('button') ? null : [x, y]);
        if (!d) return;
        d.far ||= Math.hypot(x - d.x, y - d.y) > 6;
        if (d.far) set_view({ ...d.view, e: d.view.e - (x - d.x) / v.px_per_m, n: d.view.n + (y - d.y) / v.px_per_m });
      }}
      onPointerUp={(e) => {
        const d = drag.current;
        drag.current = null;
        if (d && !d.far) {
          const [x, y] = local(e);
          tap(x, y);
        }
      }}
      onPointerLeave={() => set_over(null)}
      onPointerCancel={() => (drag.current = null)}
    >
      {w > 0 && <Under origin={origin} v={v} w={w} h={h} />}
      {w > 0 && (
        <svg width={w} height={h} aria-hidden="true">
          <Grid v={v} w={w} h={h} />
          {plan.fence.length > 0 && <path class="fence" d={path('fence')} />}
          {plan.no_fly.map((_, i) => (
            <path key={i} class="nofly" d={path(`no_fly/${i}`)} />
          ))}
          <path class="outline" d={path('outline')} />
          {cells.map((c, i) => {
            const [x, y] = px([c.e, c.n]),
              s = c.step === null ? 0 : SIDES_PX[c.step]!;
            return c.step === null ? (
              <path key={i} class="unseen" d={`M${x - 5} ${y - 5}l10 10m0 -10l-10 10`} />
            ) : (
              <g key={i}>
                <rect class={`cand c${c.step}`} x={x - s / 2} y={y - s / 2} width={s} height={s} />
                {v.px_per_m > 9 && (
                  <text class="candtext halo" x={x} y={y + 20} text-anchor="middle">
                    {c.words}
                  </text>
                )}
              </g>
            );
          })}
          {anchors.map((a) => {
            const [x, y] = px([a.e, a.n]);
            return (
              <g key={a.id} class="expectedat">
                <circle cx={x} cy={y} r="8" />
                <path d={`M${x - 4} ${y}h8M${x} ${y - 4}v8`} />
                <text class="halo" x={x} y={y - 13} text-anchor="middle">
                  {a.id}
                </text>
              </g>
            );
          })}
          <OnGround origin={origin} base={base} walk={walk} px={px} />
          <path class="way" d={path('waypoints')} />
          {shapes.map((shape) =>
            metres(shape).map((m, index) => {
              const [x, y] = px(m),
                on = picked?.shape === shape && picked.index === index,
                way = shape === 'waypoints';
              return (
                <g key={`${shape}${index}`} class={`${way ? 'wp' : 'corner'}${on ? ' on' : ''}`}>
                  <circle cx={x} cy={y} r={on ? 11 : way ? 10 : 5} />
                  {way && (
                    <text x={x} y={y + 4} text-anchor="middle">
                      {index + 1}
                    </text>
                  )}
                </g>
              );
            }),
          )}
          {over && !at(...over) && !drag.current?.far && <Ghost over={over} />}
        </svg>
      )}
      <div class="mapui">
        <div class="mgrp">
          <button class="mb" aria-label="Zoom in" onClick={() => zoom(1.5)}>
            <Icon name="plus" />
          </button>
          <button class="mb" aria-label="Zoom out" onClick={() => zoom(1 / 1.5)}>
            <Icon name="minus" />
          </button>
        </div>
        <button class="mb" aria-label="Fit plan" data-testid="fit-plan" onClick={() => set_view(null)}>
          <Icon name="fit" />
        </button>
        <button
          class={sided ? 'mb on' : 'mb'}
          aria-label="Side elevation"
          aria-pressed={sided}
          data-testid="show-elevation"
          onClick={() => set_sided(!sided)}
        >
          <Icon name="side" />
        </button>
      </div>
      <LevelChoice />
      <div class="scalebar">
        <span class="sb">
          <i style={{ width: `${bar_m * v.px_per_m}px` }} />
          {length_words(bar_m)}
        </span>
      </div>
    </div>
  );
}

/// Plans of floors under the drawing.
function Under({ origin, v, w, h }: { origin: Geodetic; v: View; w: number; h: number }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const version = backdrop_version.value;
  useEffect(() => {
    const c = canvas.current?.getContext('2d');
    if (!c) return;
    c.clearRect(0, 0, w, h);
    for (const b of backdrops(origin)) draw_backdrop(c, { ...v, w, h }, b);
  }, [origin, v, w, h, version]);
  return <canvas class="underplan" ref={canvas} width={w} height={h} aria-hidden="true" data-testid="under-plan" />;
}

function Grid({ v, w, h }: { v: View; w: number; h: number }) {
  const step = round_length(110 / v.px_per_m),
    from = (mid: number, half: number): number => Math.ceil((mid - half) / step) * step,
    count = (half: number): number => Math.floor((2 * half) / step) + 1;
  const he = w / 2 / v.px_per_m,
    hn = h / 2 / v.px_per_m,
    xs = Array.from({ length: count(he) }, (_, i) => from(v.e, he) + i * step),
    ys = Array.from({ length: count(hn) }, (_, i) => from(v.n, hn) + i * step);
  return (
    <g class="plangrid">
      {xs.map((e) => (
        <path key={`e${e}`} d={`M${w / 2 + (e - v.e) * v.px_per_m} 0V${h}`} />
      ))}
      {ys.map((n) => (
        <path key={`n${n}`} d={`M0 ${h / 2 - (n - v.n) * v.px_per_m}H${w}`} />
      ))}
    </g>
  );
}
