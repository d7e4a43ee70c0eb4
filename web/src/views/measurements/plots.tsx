/// The plots of many measurements at once. LOS is a filled dot, NLOS a triangle, without a label a ring: colour never speaks alone.
import type { ComponentChildren } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Sample } from '../../api/measurements';
import { fixed, grouped } from '../../ui/format';
import { Axes, decimals, Drawing, scale, ticks, type Frame, type Scale, room } from '../chart';
import { feature_words } from '../models/words';
import { datasets, rss_line_of, type DatasetName } from '../../api/rules';
import { histogram, level_at, PRINTED_LINE, sides, type RssLine } from './choice';

const span = (v: readonly number[], pad: number): [number, number] => {
  const lo = Math.min(...v),
    hi = Math.max(...v),
    room = (hi - lo || 1) * pad;
  return [lo - room, hi + room];
};

type Words = (v: number, decimals: number) => string;
interface Cloud {
  readonly samples: readonly Sample[];
  readonly x: (s: Sample) => number | null;
  readonly y: (s: Sample) => number | null;
  readonly xw: Words;
  readonly yw: Words;
  readonly label: string;
  readonly selected: number | null;
  readonly select: (s: Sample) => void;
  readonly over?: undefined | ((x: Scale, y: Scale, f: Frame, span_x: readonly [number, number]) => ComponentChildren);
}
function Scatter({ samples, x, y, xw, yw, label, selected, select, over }: Cloud) {
  const drawn = samples.flatMap((s) => {
    const a = x(s),
      b = y(s);
    return a === null || b === null ? [] : [{ s, a, b }];
  });
  if (!drawn.length) return <p class="why">Nothing to draw: these measurements lack one of the two quantities.</p>;
  const [x0, x1] = span(
      drawn.map((p) => p.a),
      0.03,
    ),
    [y0, y1] = span(
      drawn.map((p) => p.b),
      0.06,
    );
  const shape = (los: boolean | null, px: number, py: number, r: number): string =>
    los === false
      ? `M${px} ${py - r}l${r} ${1.7 * r}h${-2 * r}z`
      : `M${px - r} ${py}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`;
  return (
    <>
      <Drawing
        cls="scatter"
        label={`${label}, ${drawn.length} measurements`}
        draw={(w, h) => {
          const f = { w, h, left: room(76), right: 10, top: 8, bottom: room(24) },
            xs = ticks(x0, x1),
            ys = ticks(y0, y1, 4),
            sx = scale([x0, x1], [f.left, w - f.right]),
            sy = scale([y0, y1], [h - f.bottom, f.top]);
          return (
            <>
              <Axes
                f={f}
                x={sx}
                y={sy}
                xs={xs}
                ys={ys}
                xw={(v) => xw(v, decimals(xs))}
                yw={(v) => yw(v, decimals(ys))}
              />
              {drawn.map(({ s, a, b }) => (
                <path
                  key={s.id}
                  class={`pt ${s.los === null ? 'none' : s.los ? 'los' : 'nlos'}${s.id === selected ? ' sel' : ''}`}
                  d={shape(s.los, sx(a), sy(b), s.id === selected ? 7 : 3)}
                  onClick={() => select(s)}
                />
              ))}
              {over?.(sx, sy, f, [x0, x1])}
            </>
          );
        }}
      />
    </>
  );
}

const metre_words: Words = (v, d) => `${fixed(v, d)} m`;
export function LevelPanel({
  samples,
  selected,
  select,
}: {
  samples: readonly Sample[];
  selected: number | null;
  select: (s: Sample) => void;
}) {
  const [sets, set_sets] = useState<readonly DatasetName[]>([]),
    [of, set_of] = useState('printed'),
    [fitted, set_fitted] = useState<{ of: string; line: RssLine | null } | null>(null);
  useEffect(() => {
    datasets().then(set_sets, () => undefined);
  }, []);
  useEffect(() => {
    let gone = false;
    if (of !== 'printed' && of !== 'none')
      rss_line_of(of).then(
        (line) => {
          if (!gone) set_fitted({ of, line });
        },
        () => {
          if (!gone) set_fitted({ of, line: null });
        },
      );
    return () => {
      gone = true;
    };
  }, [of]);
  const line = of === 'printed' ? PRINTED_LINE : fitted?.of === of ? fitted.line : null,
    hit = line && sides(samples, line),
    share = (v: number): string => `${fixed(v * 100, 1)}\u00a0%`;
  return (
    <section class="cell-p" data-testid="plot-level">
      <div class="hd">
        <h2>RSS over distance</h2>
        <select
          class="input"
          aria-label="Threshold line"
          data-testid="line"
          value={of}
          onChange={(e) => set_of(e.currentTarget.value)}
        >
          <option value="printed">line of the dissertation</option>
          {sets.map((s) => (
            <option key={s.id} value={s.id}>
              line of {s.name}
            </option>
          ))}
          <option value="none">no line</option>
        </select>
      </div>
      <p class="sub" data-testid="line-words">
        {line
          ? `LOS above ${fixed(line.at_zero_dbm, 1)} dBm ${line.slope_dbm_per_m < 0 ? '−' : '+'} ${fixed(Math.abs(line.slope_dbm_per_m), 2)} dB/m`
          : of === 'none'
            ? 'RSS against measured distance'
            : fitted?.of === of
              ? 'that data set has too few LOS measurements with an RSS for a line'
              : 'fitting the line'}
        {hit?.los != null && `; ${share(hit.los)} of LOS above`}
        {hit?.nlos != null && `; ${share(hit.nlos)} of NLOS below`}
      </p>
      <Scatter
        samples={samples}
        x={(s) => s.distance_m}
        y={(s) => s.rx_dbm}
        xw={metre_words}
        yw={(v, d) => `${fixed(v, d)} dBm`}
        label={
          'RSS against ' +
          `distance${line ? `, line of sight above ${fixed(line.at_zero_dbm, 1)} dBm and ${fixed(line.slope_dbm_per_m, 2)} dB a metre` : ''}`
        }
        selected={selected}
        select={select}
        over={
          line
            ? (x, y, f, [x0, x1]) => (
                <g data-mark="line">
                  <clipPath id="in-plot">
                    <rect x={f.left} y={f.top} width={f.w - f.left - f.right} height={f.h - f.top - f.bottom} />
                  </clipPath>
                  <path
                    class="s goalline"
                    clip-path="url(#in-plot)"
                    d={`M${x(x0)} ${y(level_at(line, x0))}L${x(x1)} ${y(level_at(line, x1))}`}
                  />
                </g>
              )
            : undefined
        }
      />
    </section>
  );
}
const AGAINST: readonly (readonly [string, string, Words])[] = [
  ['truth', 'true distance', metre_words],
  ['heading_deg', 'heading', (v, d) => `${fixed(v, d)}°`],
  ['height_difference_m', 'height difference', metre_words],
];
export function TruthPanel({
  samples,
  selected,
  select,
}: {
  samples: readonly Sample[];
  selected: number | null;
  select: (s: Sample) => void;
}) {
  const [wanted, set_wanted] = useState('truth'),
    value = (s: Sample, of: string): number | null => (of === 'truth' ? s.truth_m : (s.features[of] ?? null));
  const true_ones = samples.filter((s) => s.truth_m !== null),
    offered = AGAINST.filter(([of]) => true_ones.some((s) => value(s, of) !== null)),
    [against, words, xw] = offered.find(([of]) => of === wanted) ?? AGAINST[0]!;
  if (!true_ones.length) return null;
  return (
    <section class="cell-p" data-testid="plot-bias">
      <div class="hd">
        <h2>Bias</h2>
        {offered.length > 1 && (
          <select
            class="input"
            aria-label="Bias against"
            value={against}
            onChange={(e) => set_wanted(e.currentTarget.value)}
          >
            {offered.map(([of, name]) => (
              <option key={of} value={of}>
                against {name}
              </option>
            ))}
          </select>
        )}
      </div>
      <p class="sub">
        measured minus true distance, if the truth is known{offered.length > 1 ? '' : `, against ${words}`}
      </p>
      <Scatter
        samples={true_ones}
        x={(s) => value(s, against)}
        y={(s) => s.distance_m - s.truth_m!}
        xw={xw}
        yw={(v) => `${fixed(v * 1000, 0)} mm`}
        label={`Bias against ${words}`}
        selected={selected}
        select={select}
      />
    </section>
  );
}

export function HistogramPanel({ samples }: { samples: readonly Sample[] }) {
  const names = [...new Set(samples.flatMap((s) => Object.keys(s.features)))],
    [wanted, set_wanted] = useState('');
  const name = names.includes(wanted) ? wanted : names.includes('rx_minus_fp_db') ? 'rx_minus_fp_db' : (names[0] ?? ''),
    bars = name ? histogram(samples, name) : null;
  return (
    <section class="cell-p" data-testid="plot-histogram">
      <div class="hd">
        <h2>Feature</h2>
        {names.length > 0 && (
          <select
            class="input"
            value={name}
            aria-label="Feature of the histogram"
            onChange={(e) => set_wanted(e.currentTarget.value)}
          >
            {names.map((n) => (
              <option key={n} value={n}>
                {feature_words(n)}
              </option>
            ))}
          </select>
        )}
      </div>
      {!bars && (
        <p class="why">
          {names.length
            ? 'Every measurement shown has the same value.'
            : 'The radio reported no diagnostics with these measurements.'}
        </p>
      )}
      {bars && (
        <Drawing
          cls="scatter"
          label={`Histogram of ${feature_words(name)} by label`}
          draw={(w, h) => {
            const totals = bars.los.map((v, i) => v + bars.nlos[i]! + bars.unlabelled[i]!),
              top = Math.max(...totals),
              edges = bars.edges;
            const f = { w, h, left: room(44), right: 10, top: 8, bottom: room(24) },
              x = scale([edges[0]!, edges[edges.length - 1]!], [f.left, w - f.right]),
              y = scale([0, top], [h - f.bottom, f.top]);
            const part = (cls: string, counts: readonly number[], under: (i: number) => number) =>
              counts.map(
                (n, i) =>
                  n > 0 && (
                    <rect
                      key={`${cls}${i}`}
                      class={`hb ${cls}`}
                      x={x(edges[i]!) + 0.5}
                      width={Math.max(1, x(edges[i + 1]!) - x(edges[i]!) - 1)}
                      y={y(under(i) + n)}
                      height={y(under(i)) - y(under(i) + n)}
                    />
                  ),
              );
            return (
              <>
                <Axes
                  f={f}
                  x={x}
                  y={y}
                  xs={ticks(edges[0]!, edges[edges.length - 1]!)}
                  ys={ticks(0, top, 3)}
                  xw={(v) => fixed(v, Math.abs(edges[edges.length - 1]! - edges[0]!) < 4 ? 1 : 0)}
                  yw={(v) => grouped(v)}
                />
                {part('los', bars.los, () => 0)}
                {part('nlos', bars.nlos, (i) => bars.los[i]!)}
                {part('none', bars.unlabelled, (i) => bars.los[i]! + bars.nlos[i]!)}
              </>
            );
          }}
        />
      )}
      {bars && (
        <p class="legend">
          <span>
            <i class="sw los" />
            LOS
          </span>
          <span>
            <i class="sw nlos" />
            NLOS
          </span>
          <span>
            <i class="sw none" />
            no label
          </span>
        </p>
      )}
    </section>
  );
}
