/// Distribution of |bias|, raw and corrected, with what 50, 90 and 95 % of the ranges stay below.
import type { Curve, Run } from '../../api/learning';
import { fixed } from '../../ui/format';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';
import { curve_mae, is_raw } from './mae';
import { method_words } from './words';

const mm = (m: number | null): string => fixed(m === null ? null : m * 1000, 0);

export function BiasPanel({ curves, run }: { curves: readonly Curve[]; run: Run }) {
  if (!curves.length) return null;
  const sorted = [...curves].sort((a, b) => Number(is_raw(b)) - Number(is_raw(a)) || (b.p90_m ?? 0) - (a.p90_m ?? 0));
  const top = Math.max(...curves.map((c) => c.p95_m ?? 0), 0.01) * 1.25,
    best = sorted[sorted.length - 1];
  const look = (c: Curve): string => (is_raw(c) ? 's raw' : c === best ? 's main' : 's alt');
  return (
    <section class="cell-p wide" data-testid="cdf">
      <div class="hd">
        <h2>Range bias, raw and corrected</h2>
        <span class="meta">share of ranges with |bias| below x</span>
      </div>
      <div class="cdfbox">
        <Drawing
          cls="cdf"
          label={sorted.map((c) => `${method_words(c.method)}: 90 % below ${mm(c.p90_m)} mm`).join('; ')}
          draw={(w, h) => {
            const f = { w, h, left: room(44), right: 12, top: 8, bottom: room(24) },
              x = scale([0, top], [f.left, w - f.right]),
              y = scale([0, 1], [h - f.bottom, f.top]);
            return (
              <>
                <Axes
                  f={f}
                  x={x}
                  y={y}
                  xs={ticks(0, top)}
                  ys={[0, 0.5, 0.9, 1]}
                  xw={(v) => `${fixed(v * 1000, 0)} mm`}
                  yw={(v) => `${fixed(v * 100, 0)} %`}
                />
                {sorted.map((c) => (
                  <path
                    key={c.method}
                    class={look(c)}
                    d={line(c.points.filter((p) => p.value_m <= top).map((p) => [x(p.value_m), y(p.share)]))}
                  />
                ))}
              </>
            );
          }}
        />
        <table class="tbl reads">
          <caption>mm, |bias| at 50, 90 and 95 % of ranges</caption>
          <thead>
            <tr>
              <th scope="col">Method</th>
              <th scope="col" class="num">
                50 %
              </th>
              <th scope="col" class="num">
                90 %
              </th>
              <th scope="col" class="num">
                95 %
              </th>
              <th scope="col" class="num">
                MAE
              </th>
            </tr>
          </thead>
          <tbody>
            {sorted.map((c) => (
              <tr key={c.method} class={c === best ? 'best' : ''}>
                <th scope="row">
                  <svg class="key" viewBox="0 0 24 8" aria-hidden="true">
                    <path class={look(c)} d="M0 4h24" />
                  </svg>
                  {method_words(c.method)}
                </th>
                <td class="num">{mm(c.p50_m)}</td>
                <td class="num">{mm(c.p90_m)}</td>
                <td class="num">{mm(c.p95_m)}</td>
                <td class="num">{mm(curve_mae(c, run))}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}
