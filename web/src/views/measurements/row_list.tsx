/// The list of measurements: drawn are the rows in sight, kept are the pages about them.
import { useEffect, useRef, useState } from 'preact/hooks';
import type { Sample, Source } from '../../api/measurements';
import { fixed, percent } from '../../ui/format';
import { CLASS_LOOK } from '../../ui/marks';
import { at_end, known, row, type Rows } from './window';

const ROW_PX = 40,
  AROUND = 8; ///< height set in desk.css; rows drawn beyond either edge, so that a turn of the wheel meets no gap

interface Props {
  source: Source;
  rows: Rows<Sample>;
  selected: number | null;
  at: number;
  oldest_first: boolean;
  select: (s: Sample) => void;
  look: (first: number, last: number) => void;
  turn: () => void;
}
export function RowList({ source, rows, selected, at, oldest_first, select, look, turn }: Props) {
  const box = useRef<HTMLDivElement>(null),
    [top, set_top] = useState(0),
    [height, set_height] = useState(560);
  const n = known(rows),
    first = Math.max(0, Math.floor(top / ROW_PX) - AROUND),
    last = Math.min(n - 1, Math.ceil((top + height) / ROW_PX) + AROUND);
  useEffect(() => {
    const watch = new ResizeObserver(() => {
      if (box.current) set_height(box.current.clientHeight);
    });
    watch.observe(box.current!);
    return () => watch.disconnect();
  }, []);
  useEffect(() => look(first, Math.max(last, first + 2 * AROUND)), [first, last, rows, look]);
  // Stepped to by keys, the chosen row stays in sight.
  useEffect(() => {
    const b = box.current;
    if (!b || at < 0) return;
    const head = b.querySelector('thead')?.clientHeight ?? 0,
      y = at * ROW_PX;
    if (y < b.scrollTop) b.scrollTop = y;
    else if (y + ROW_PX + head > b.scrollTop + b.clientHeight) b.scrollTop = y + ROW_PX + head - b.clientHeight;
  }, [at]);
  const time = (t: number | null): string => (t === null ? '–' : new Date(t / 1000).toISOString().slice(11, 23)),
    flight = source.kind === 'mission';
  const drawn = Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => first + k),
    under = n - 1 - last;
  return (
    <section class="cell-p wide">
      <div
        class="rowsbox"
        ref={box}
        tabIndex={0}
        role="region"
        aria-label="List of measurements"
        data-testid="rows-box"
        onScroll={(e) => set_top(e.currentTarget.scrollTop)}
      >
        <table class="tbl" data-testid="rows" aria-rowcount={at_end(rows) ? n + 1 : -1}>
          <caption class="sr">Measurements that pass the filter</caption>
          <thead>
            <tr>
              <th scope="col">{flight ? 'Anchor' : 'Place'}</th>
              <th scope="col" aria-sort={flight ? (oldest_first ? 'ascending' : 'descending') : undefined}>
                {flight ? (
                  <button data-testid="turn" onClick={turn}>
                    Time, UTC, {oldest_first ? 'oldest first ↑' : 'newest first ↓'}
                  </button>
                ) : (
                  'Time, UTC'
                )}
              </th>
              <th scope="col">Label</th>
              <th scope="col">Predicted, P(LOS)</th>
              <th scope="col" class="num">
                Distance, m
              </th>
              <th scope="col" class="num">
                True, m
              </th>
              <th scope="col" class="num">
                Bias, mm
              </th>
              <th scope="col" class="num">
                RSS, dBm
              </th>
              <th scope="col">Response</th>
            </tr>
          </thead>
          <tbody>
            {first > 0 && (
              <tr class="space" aria-hidden="true">
                <td colSpan={9} style={{ height: `${first * ROW_PX}px` }} />
              </tr>
            )}
            {drawn.map((i) => {
              const s = row(rows, i);
              return s ? (
                <Line key={i} s={s} i={i} on={s.id === selected} time={time(s.t_us)} select={select} />
              ) : (
                <tr key={i} aria-rowindex={i + 2}>
                  <td colSpan={9} class="mut">
                    loading
                  </td>
                </tr>
              );
            })}
            {under > 0 && (
              <tr class="space" aria-hidden="true">
                <td colSpan={9} style={{ height: `${under * ROW_PX}px` }} />
              </tr>
            )}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Line({
  s,
  i,
  on,
  time,
  select,
}: {
  s: Sample;
  i: number;
  on: boolean;
  time: string;
  select: (s: Sample) => void;
}) {
  return (
    <tr class={on ? 'sel' : ''} aria-rowindex={i + 2} onClick={() => select(s)}>
      <th scope="row">
        <button
          class="id"
          aria-pressed={on}
          onClick={(e) => {
            e.stopPropagation();
            select(s);
          }}
        >
          {s.who}
        </button>
      </th>
      <td>{time}</td>
      <td>{s.los === null ? <span class="mut">none</span> : s.los ? 'LOS' : 'NLOS'}</td>
      <td>
        {s.predicted?.p_los == null ? (
          <span class="mut">–</span>
        ) : (
          `${CLASS_LOOK[s.predicted.cls][2]} ${percent(s.predicted.p_los)} %`
        )}
      </td>
      <td class="num">{fixed(s.distance_m, 3)}</td>
      <td class="num">{fixed(s.truth_m, 3)}</td>
      <td class="num">{s.truth_m === null ? '–' : fixed((s.distance_m - s.truth_m) * 1000, 0)}</td>
      <td class="num">{fixed(s.rx_dbm, 1)}</td>
      <td>{s.has_cir ? 'kept' : <span class="mut">none</span>}</td>
    </tr>
  );
}
