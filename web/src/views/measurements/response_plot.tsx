/// The drawing of one impulse response, others laid under it to compare, and its taps as a table.
import { useState } from 'preact/hooks';
import type { Impulse, Sample } from '../../api/measurements';
import { fixed } from '../../ui/format';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';
import { marks_of, ns_of, shown_taps, summary } from './response';

export interface Kept {
  readonly name: string;
  readonly sample: Sample;
  readonly response: Impulse;
}
export const KEPT_MAX = 3; ///< under the selected one: four curves are what an eye can part

export function ResponsePlot({
  response: r,
  sample,
  kept,
}: {
  response: Impulse;
  sample: Sample;
  kept: readonly Kept[];
}) {
  const [whole, set_whole] = useState(false),
    [table, set_table] = useState(false);
  const m = marks_of(r, sample.features),
    [from, to] = shown_taps(r, m, whole),
    taps = r.magnitude.slice(from, to),
    ns = (tap: number): number => ns_of(r, m, tap);
  // Receivers amplify as they need: curves of several are comparable by shape, each against its own strongest tap.
  const relative = kept.length > 0,
    unit = relative ? Math.max(...r.magnitude) || 1 : 1,
    top = relative ? 1.05 : Math.max(...taps) * 1.05 || 1,
    value = (v: number): string => fixed(v, relative ? 2 : 0);
  const x0 = ns(from),
    x1 = ns(to - 1);
  return (
    <figure class="response">
      <Drawing
        cls="cir"
        label={summary(r, m, sample.features)}
        draw={(w, h) => {
          const f = { w, h, left: room(48), right: 10, top: 38, bottom: room(24) },
            x = scale([x0, x1], [f.left, w - f.right]),
            y = scale([0, top], [h - f.bottom, f.top]),
            inside = (v: number): boolean => v >= x0 && v <= x1;
          const low = m.mean_ns === null || m.spread_ns === null ? null : Math.max(x0, m.mean_ns - m.spread_ns),
            high = low === null ? 0 : Math.min(x1, m.mean_ns! + m.spread_ns!);
          return (
            <>
              <Axes
                f={f}
                x={x}
                y={y}
                xs={ticks(x0, x1, w < 480 ? 4 : 7)}
                ys={ticks(0, top, 4)}
                xw={(v) => `${fixed(v, 0)} ns`}
                yw={value}
              />
              {m.noise !== null && !relative && (
                <g data-mark="noise">
                  <path class="s noise" d={`M${f.left} ${y(m.noise)}H${w - f.right}`} />
                  <text class="ticktext halo" x={w - f.right} y={y(m.noise) - 6} text-anchor="end">
                    noise floor
                  </text>
                </g>
              )}
              {kept.map((k, i) => (
                <path key={k.sample.id} class={`s kept k${i}`} data-mark="kept" d={kept_line(k, x0, x1, x, y)} />
              ))}
              <path class="s main" d={line(taps.map((v, i) => [x(ns(from + i)), y(v / unit)]))} />
              <g data-mark="first">
                <path class="s first" d={`M${x(0)} ${f.top - 20}V${h - f.bottom}`} />
                <text
                  class="ticktext halo"
                  x={x(0) - 5}
                  y={f.top - 10}
                  text-anchor={x(0) < 90 ? 'start' : 'end'}
                  dx={x(0) < 90 ? 10 : 0}
                  dy={x(0) < 90 ? -14 : 0}
                >
                  first path
                </text>
              </g>
              {low !== null && inside(m.mean_ns!) && (
                <g data-mark="delay">
                  <path class="s mean" d={`M${x(m.mean_ns!)} ${f.top - 8}V${h - f.bottom}`} />
                  <path class="s spread" d={`M${x(low)} ${f.top - 12}v8m0 -4H${x(high)}m0 -4v8`} />
                  <text class="ticktext halo" x={x(high) + 6} y={f.top - 4} text-anchor="start">
                    mean delay ± spread
                  </text>
                </g>
              )}
              {inside(ns(m.peak)) && (
                <circle class="dot" data-mark="peak" cx={x(ns(m.peak))} cy={y(r.magnitude[m.peak]! / unit)} r="5" />
              )}
            </>
          );
        }}
      />
      {relative && (
        <p class="legend">
          <span>
            <svg class="key" viewBox="0 0 24 8" aria-hidden="true">
              <path class="s main" d="M0 4H24" />
            </svg>
            selected
          </span>
          {kept.map((k, i) => (
            <span key={k.sample.id}>
              <svg class="key" viewBox="0 0 24 8" aria-hidden="true">
                <path class={`s kept k${i}`} d="M0 4H24" />
              </svg>
              {k.name}
            </span>
          ))}
          <span class="mut">each against its own strongest tap</span>
        </p>
      )}
      <div class="plotfoot">
        <button class="btn small" aria-pressed={whole} data-testid="whole" onClick={() => set_whole(!whole)}>
          {whole ? 'Around the first path' : 'Whole record'}
        </button>
        <button class="btn small" aria-expanded={table} data-testid="taps-toggle" onClick={() => set_table(!table)}>
          {table ? 'Hide the taps' : 'Taps as a table'}
        </button>
      </div>
      {table && (
        <div class="tapsbox" tabIndex={0} role="region" aria-label="Taps of the impulse response">
          <table class="tbl" data-testid="taps">
            <caption class="sr">Magnitude of each tap, by its time after the first path</caption>
            <thead>
              <tr>
                <th scope="col">Tap</th>
                <th scope="col" class="num">
                  After the first path, ns
                </th>
                <th scope="col" class="num">
                  Magnitude
                </th>
              </tr>
            </thead>
            <tbody>
              {taps.map((v, i) => (
                <tr key={from + i}>
                  <th scope="row">
                    {from + i}
                    {from + i === m.peak ? ', strongest' : ''}
                  </th>
                  <td class="num">{fixed(ns(from + i), 1)}</td>
                  <td class="num">{fixed(v, 0)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </figure>
  );
}

/// Another response on the same axis, first path on first path.
function kept_line(k: Kept, x0: number, x1: number, x: (v: number) => number, y: (v: number) => number): string {
  const m = marks_of(k.response, k.sample.features),
    strongest = Math.max(...k.response.magnitude) || 1;
  return line(
    k.response.magnitude
      .map((v, i): [number, number] => [ns_of(k.response, m, i), v / strongest])
      .filter(([t]) => t >= x0 && t <= x1)
      .map(([t, v]): [number, number] => [x(t), y(v)]),
  );
}
