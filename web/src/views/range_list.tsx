import { Component } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import type { RangeMsg } from '../live/messages';
import { chosen_anchor, replayed, watched_mission, watched_scene, now_ms, tick, watched_lost } from '../state/store';
import { range_class, rate_hz, type RangeRow } from '../state/scene';
import { not_loaded_words } from '../ui/empty';
import { age, fixed, percent, range_m } from '../ui/format';
import { CLASS_LOOK, Mark, Q } from '../ui/marks';
import { refused_words } from '../ui/words';

const STALE_MS = 2000,
  UNSEEN_EVERY_MS = 2000;

/// Ids of the rows that are in sight, or nearly so. Drawing the others four times a second as well is most of what a long list costs.
function useInSight(rows: number): ReadonlySet<string> {
  const body = useRef(new Set<string>()).current;
  useEffect(() => {
    const table = document.querySelector('.rg tbody');
    if (!table) return;
    const watch = new IntersectionObserver(
      (list) => {
        for (const e of list) {
          const id = (e.target as HTMLElement).dataset.id ?? '';
          if (e.isIntersecting) body.add(id);
          else body.delete(id);
        }
        if (list.some((e) => e.isIntersecting)) tick.value++;
      },
      { rootMargin: '200px' },
    );
    for (const row of table.children) watch.observe(row);
    return () => watch.disconnect();
  }, [rows, body]);
  return body;
}

const is_corrected = (r: RangeMsg): boolean => Math.abs(r.corrected_m - r.distance_m) > 5e-4;

/// One row per anchor, in the order of their ids: a list that re-sorts under the finger cannot be tapped.
export function RangeList({ selected }: { selected: string | null }) {
  tick.value;
  const scene = watched_scene(),
    now = now_ms(),
    lost = watched_lost(),
    running = watched_mission.value?.state === 'recording';
  const rows = scene ? [...scene.ranges.entries()].sort(([a], [b]) => (a < b ? -1 : 1)) : [],
    in_sight = useInSight(rows.length);
  const in_range = rows.filter(([, r]) => now - r.at_ms < STALE_MS).length;
  const total_hz = rows.reduce((s, [, r]) => s + (now - r.at_ms < STALE_MS ? (rate_hz(r) ?? 0) : 0), 0);
  const modelled = rows.some(([, r]) => r.last.p_los !== null),
    // Of a stored flight without models there is no class and no correction: "unclear" and "corrected" would claim one.
    raw = replayed.value !== null && !modelled && !rows.some(([, r]) => is_corrected(r.last));
  return (
    <section class="sec-p ranges" data-testid="range-list">
      <div class="hd">
        <h2>Ranges</h2>
        <span class={lost ? 'meta now' : 'meta'}>
          {!rows.length
            ? ''
            : lost
              ? `nothing for ${age(now - (scene?.range_at_ms ?? now))}`
              : running
                ? `${in_range} of ${rows.length} in range, ${fixed(total_hz, 0)} Hz`
                : `${rows.length} anchors, flight ended`}
        </span>
      </div>
      {rows.length === 0 ? (
        <p class="why">
          {replayed.value
            ? 'No range until this moment.'
            : lost
              ? not_loaded_words('lost')
              : running
                ? watched_mission.value?.n_ranges
                  ? 'No range for a while. Is the tag still powered, and is an anchor in range?'
                  : 'No range yet. Is the tag powered, and is an anchor in range?'
                : 'The last 20 s of ranges are shown while a flight is recorded.'}
        </p>
      ) : (
        <table class="rg">
          <caption class="sr">
            {replayed.value ? 'Ranges' : 'Live ranges'} by anchor
            {modelled ? '' : `. No line-of-sight model is active, so ${raw ? 'none has a class' : 'all are unclear'}.`}
          </caption>
          <thead>
            <tr>
              <th scope="col">Anchor</th>
              <th scope="col">{raw ? 'Raw' : 'Corrected'}</th>
              <th scope="col" class="pl">
                {modelled ? 'P(LOS)' : 'RSS'}
              </th>
              <th scope="col" class="sp">
                Last 20 s
              </th>
              <th scope="col" class="r">
                Hz
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(([id, r]) => {
              const stale = lost || !running || now - r.at_ms > STALE_MS;
              return (
                <Row
                  key={id}
                  id={id}
                  row={r}
                  t_us={r.last.t_us}
                  stale={stale}
                  old={stale ? age(now - r.at_ms) : ''}
                  now_ms={now}
                  in_sight={in_sight.has(id)}
                  running={running}
                  selected={id === selected}
                  modelled={modelled}
                  raw={raw}
                />
              );
            })}
          </tbody>
        </table>
      )}
    </section>
  );
}

interface RowProps {
  readonly id: string;
  readonly row: RangeRow;
  readonly t_us: number; ///< of its last range: the row itself is written on
  readonly stale: boolean;
  readonly old: string;
  readonly now_ms: number;
  readonly in_sight: boolean;
  readonly running: boolean;
  readonly selected: boolean;
  readonly modelled: boolean;
  readonly raw: boolean;
}
const LOOKS = ['row', 'stale', 'running', 'selected', 'modelled', 'raw'] as const; ///< what may not wait, in sight or not

/// A row that would say the same again is left as it was drawn. No element is kept for that: one holds the whole picture that it was first a part of.
class Row extends Component<RowProps> {
  private drawn: RowProps | null = null;
  override shouldComponentUpdate(next: RowProps): boolean {
    const { drawn } = this;
    if (!drawn || LOOKS.some((k) => drawn[k] !== next[k])) return true;
    if (drawn.t_us === next.t_us && drawn.old === next.old) return false;
    return next.in_sight || next.now_ms - drawn.now_ms >= UNSEEN_EVERY_MS;
  }
  override render(props: RowProps) {
    this.drawn = props;
    return <Cells {...props} />;
  }
}

function Cells({ id, row, stale, old, running, selected, modelled, raw }: RowProps) {
  const cls = range_class(row.last.p_los),
    [shape, tone, word] = CLASS_LOOK[cls];
  const r = row.last,
    corrected = is_corrected(r);
  return (
    <tr
      class={`${stale ? 'stale' : ''}${selected ? ' sel' : ''}`}
      onClick={() => (chosen_anchor.value = id)}
      data-testid={`range-${id}`}
      data-id={id}
    >
      <th scope="row">
        <button class="id" aria-pressed={selected} onClick={() => (chosen_anchor.value = id)}>
          {id}
        </button>
        {(!raw || stale) && (
          <span class={`cl ${stale ? 'off' : r.refused ? 'caution' : tone}`}>
            <Mark shape={stale ? 'off' : r.refused ? 'caution' : shape} />
            {stale ? running ? `${old} old` : 'ended' : r.refused ? refused_words(r.refused) : <b>{word}</b>}
          </span>
        )}
      </th>
      <td>
        <span class="d">
          <Q v={range_m(r.corrected_m)} u="m" />
        </span>
        <span class="rw">
          {corrected && `raw ${range_m(r.distance_m)} m`}
          {r.sigma_m !== null && (
            <span class="sigma">
              {corrected && ', '}σ {fixed(r.sigma_m, 2)} m
            </span>
          )}
        </span>
      </td>
      <td class={`pl ${stale ? '' : tone}`}>
        {modelled ? (
          <>
            <span class="pv">{stale || r.p_los === null ? '–' : `${percent(r.p_los)} %`}</span>
            <span class="prob">
              <i style={{ width: stale || r.p_los === null ? '0' : `${r.p_los * 100}%` }} />
            </span>
          </>
        ) : (
          <span class="sec">
            <Q v={fixed(r.rss_dbm, 0)} u="dBm" />
          </span>
        )}
      </td>
      <td class={`sp ${stale ? 'mut' : tone}`}>
        <Spark row={row} />
      </td>
      <td class="hz r">{fixed(stale ? 0 : rate_hz(row), 1)}</td>
    </tr>
  );
}

/// Corrected distance over the last 20 s; a pause of more than 2 s stays a gap.
function Spark({ row }: { row: RangeRow }) {
  const [w, h] = [72, 22],
    pts = row.recent,
    end = pts[pts.length - 1];
  if (!end) return null;
  let [lo, hi] = [Infinity, -Infinity];
  for (const p of pts) {
    lo = Math.min(lo, p.d);
    hi = Math.max(hi, p.d);
  }
  const span = Math.max(hi - lo, 0.3),
    mid = (hi + lo) / 2;
  const step = Math.max(1, Math.floor(pts.length / 48));
  let path = '',
    last_us = -Infinity,
    y = 0;
  for (let i = (pts.length - 1) % step; i < pts.length; i += step) {
    const p = pts[i]!;
    y = h / 2 - ((p.d - mid) / span) * (h - 4);
    path += `${p.t_us - last_us > 2_000_000 ? 'M' : 'L'}${(w * (1 - (end.t_us - p.t_us) / 2e7)).toFixed(1)} ${y.toFixed(1)}`;
    last_us = p.t_us;
  }
  return (
    <svg class="spark" width={w + 4} height={h + 4} viewBox={`-1 -1 ${w + 4} ${h + 4}`} aria-hidden="true">
      <path class="base" d={`M0 ${h + 2}H${w}`} />
      <path class="ln" d={path} />
      <circle class="pt" cx={w} cy={y} r="2.4" />
    </svg>
  );
}
