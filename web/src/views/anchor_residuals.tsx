/// What each range says against the answer: residuals over distance and over bearing, where the weight comes from, and which ranges to doubt.
import { useEffect, useState } from 'preact/hooks';
import type { AnchorRow } from '../api/anchors';
import { error_text } from '../api/client';
import { by_suspicion, residuals, SECTORS, solves, weight_by_sector, type Residual } from '../api/residuals';
import { link, when_back } from '../state/store';
import { NotLoaded } from '../ui/empty';
import { bearing, clock, fixed, millimetres, range_m } from '../ui/format';
import { Axes, Drawing, scale, ticks, type Frame, room } from './chart';
import { useStable } from '../ui/use_stable';

interface Loaded {
  readonly of: string;
  readonly rows: readonly Residual[];
  readonly none: string;
  readonly failed: boolean;
}

export function AnchorResiduals({ row, mission }: { row: AnchorRow; mission: string | null }) {
  const [got, set_got] = useState<Loaded | null>(null),
    key = `${row.anchor} ${row.calibration ?? mission}`;
  const read = useStable(async (): Promise<readonly [readonly Residual[], string]> => {
    const solve = row.calibration ?? (await solves()).find((s) => mission !== null && s.missions.includes(mission))?.id;
    if (!solve)
      return [
        [],
        'Running estimates have no residuals: Review and publish solves the whole flight; its residuals are then shown here.',
      ];
    const rows = await residuals(solve, row);
    return [rows, rows.length ? '' : 'The calibration has stored no residuals of this anchor.'];
  });
  const [attempt, set_attempt] = useState(0),
    failed = got?.of === key && got.failed;
  useEffect(() => (failed ? when_back(() => set_attempt((n) => n + 1)) : undefined), [failed]);
  useEffect(() => {
    let gone = false;
    const tell = (rows: readonly Residual[], none: string, failed = false): void => {
      if (!gone) set_got({ of: key, rows, none, failed });
    };
    read().then(
      ([rows, none]) => tell(rows, none),
      (e: unknown) => tell([], error_text(e), true),
    );
    return () => {
      gone = true;
    };
  }, [key, read, attempt]);
  if (got?.of !== key) return null;
  const used = got.rows.filter((r) => r.weight > 0).length;
  return (
    <section class="sec-p" data-testid="residuals">
      <div class="hd">
        <h3>Residuals</h3>
        {got.rows.length > 0 && (
          <span class="meta">
            {used} ranges with weight, {got.rows.length - used} rejected
          </span>
        )}
      </div>
      {got.failed && link.value === 'lost' ? (
        <NotLoaded failed />
      ) : got.none ? (
        <p class="why">{got.none}</p>
      ) : (
        <>
          <div class="duo">
            <Scatter rows={got.rows} x={(r) => r.distance_m} label="distance" unit="m" />
            <Scatter rows={got.rows} x={(r) => r.bearing_deg} label="bearing" unit="°" span={[0, 360]} />
          </div>
          <p class="sub">
            Measured minus computed, mm. Full dots: used, the larger the more weight; crosses: rejected, at the edge
            where they are beyond it. A slope over distance is a scale or bias; one side of the compass high is a wall
            there.
          </p>
          <Weights rows={got.rows} />
          <Doubtful
            name={row.calibration ? `${row.anchor}, calibration ${row.calibration.slice(-8)}` : row.anchor}
            rows={got.rows}
          />
        </>
      )}
    </section>
  );
}

function Scatter({
  rows,
  x: of,
  label,
  unit,
  span,
}: {
  rows: readonly Residual[];
  x: (r: Residual) => number | null;
  label: string;
  unit: string;
  span?: readonly [number, number];
}) {
  const seen = rows.filter((r) => of(r) !== null),
    xs = seen.map((r) => of(r)!);
  if (!seen.length) return <p class="why">No track of this flight, so no {label}.</p>;
  const ends = span ?? ([Math.min(...xs), Math.max(...xs)] as const);
  // Wild ranges must not flatten the others: the axis is three times as wide as what is used, what is beyond sits on its edge.
  const sizes = (list: readonly Residual[]): number[] => list.map((r) => Math.abs(r.residual_m)).sort((a, b) => a - b),
    used = sizes(seen.filter((r) => r.weight > 0)),
    all = sizes(seen);
  const most =
    1000 * Math.max(0.02, Math.min(1.1 * all.at(-1)!, 3 * (used[Math.floor(0.98 * (used.length - 1))] ?? all.at(-1)!)));
  return (
    <Drawing
      cls="resid"
      label={`Residual over ${label} of ${seen.length} ranges; median ${millimetres(median(seen.map((r) => r.residual_m)))} mm`}
      draw={(w, h) => {
        const f: Frame = { w, h, left: room(44), right: 8, top: 8, bottom: room(34) },
          x = scale(ends, [f.left, w - f.right]),
          y = scale([-most, most], [h - f.bottom, f.top]),
          clamp = (v: number): number => Math.max(-most, Math.min(most, v));
        return (
          <>
            <Axes
              f={f}
              x={x}
              y={y}
              xs={span ? [0, 90, 180, 270, 360] : ticks(ends[0], ends[1], 4)}
              ys={ticks(-most, most, 4)}
              xw={(v) => (span ? bearing(v) : fixed(v, ends[1] - ends[0] < 4 ? 1 : 0))}
              yw={(v) => fixed(v, 0)}
            />
            <path class="zero" d={`M${f.left} ${y(0)}H${w - f.right}`} />
            {seen.map((r, i) => {
              const [cx, cy] = [x(of(r)!), y(clamp(r.residual_m * 1000))];
              return r.weight > 0 ? (
                <circle key={i} class="dot" cx={cx} cy={cy} r={1 + 1.6 * r.weight} />
              ) : (
                <path key={i} class="out" d={`M${cx - 3} ${cy - 3}l6 6M${cx + 3} ${cy - 3}l-6 6`} />
              );
            })}
            <text class="ticktext" x={w - f.right} y={h - 4} text-anchor="end">
              {label}, {unit}
            </text>
          </>
        );
      }}
    />
  );
}
function median(v: readonly number[]): number | null {
  const s = [...v].sort((a, b) => a - b);
  return s.length ? (s[(s.length - 1) >> 1]! + s[s.length >> 1]!) / 2 : null;
}

function Weights({ rows }: { rows: readonly Residual[] }) {
  const shares = weight_by_sector(rows),
    most = Math.max(...shares);
  if (most === 0) return null;
  return (
    <table class="sectors" data-testid="sectors">
      <caption>
        Directions that determine it <span class="mut">share of the weight by direction from the anchor</span>
      </caption>
      <tbody>
        {SECTORS.map((s, i) => (
          <tr key={s}>
            <th scope="row">{s}</th>
            <td>
              <svg width="100%" height="10" aria-hidden="true">
                <rect class="bar" x="0" y="1" height="8" width={`${(100 * shares[i]!) / most}%`} />
              </svg>
            </td>
            <td class="num">{fixed(100 * shares[i]!, 0)} %</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
function Doubtful({ rows, name }: { rows: readonly Residual[]; name: string }) {
  const first = Math.min(...rows.map((r) => r.t_us)),
    worst = by_suspicion(rows).slice(0, 8);
  return (
    <div class="scrollx" tabIndex={0} role="region" aria-label={`Ranges to check of ${name}`}>
      <table class="reads doubt" data-testid="doubtful">
        <caption>Ranges to check first</caption>
        <thead>
          <tr>
            <th scope="col">At</th>
            <th scope="col" class="num">
              Distance, m
            </th>
            <th scope="col" class="num">
              Bearing
            </th>
            <th scope="col" class="num">
              Residual, mm
            </th>
            <th scope="col" class="num">
              In σ
            </th>
            <th scope="col" class="num">
              Weight
            </th>
          </tr>
        </thead>
        <tbody>
          {worst.map((r) => (
            <tr key={r.t_us}>
              <th scope="row">{clock((r.t_us - first) / 1e6, true)}</th>
              <td class="num">{range_m(r.distance_m)}</td>
              <td class="num">{r.bearing_deg === null ? '–' : `${bearing(r.bearing_deg)}°`}</td>
              <td class="num">{millimetres(r.residual_m)}</td>
              <td class="num">{fixed(r.standardised, 1)}</td>
              <td class="num">{r.weight === 0 ? 'rejected' : fixed(r.weight, 2)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
