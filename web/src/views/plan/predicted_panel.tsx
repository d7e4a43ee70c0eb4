/// The predicted map: which quantity of which height lies over the drawing, and the same in a table.
import type { Check, Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { fixed } from '../../ui/format';
import { from_m, plan_origin, to_m } from './draft';
import { CUTS, floors, step_of, summary, type Quantity } from './predicted';

export interface Shown {
  readonly of: Quantity | 'none';
  readonly up: number | null;
}
export interface Cell {
  readonly e: number;
  readonly n: number;
  readonly step: number | null;
  readonly words: string;
}
const value_words = (v: number | null, of: Quantity): string =>
  v === null ? 'not seen' : of === 'gdop' ? fixed(v, 2) : `${fixed(v * 100, v < 0.1 ? 1 : 0)} cm`;

/// What the map draws, about its own origin: the anchors assumed at the chosen height, or at the lowest.
export function cells(check: Check | null, shown: Shown, plan: Plan, map_origin: Geodetic | null): Cell[] {
  const of = shown.of,
    own = plan_origin(plan);
  if (!check || of === 'none' || !own || !map_origin) return [];
  const at = (e: number, n: number): readonly [number, number] => to_m(from_m(e, n, own), map_origin);
  const heights = floors(check.assumed),
    up = shown.up !== null && heights.includes(shown.up) ? shown.up : heights[0];
  return check.assumed
    .filter((a) => a.up === up)
    .map((a) => ({ e: at(a.e, a.n)[0], n: at(a.e, a.n)[1], step: step_of(a[of], of), words: value_words(a[of], of) }));
}

export const SIDES_PX = [15, 13, 11, 9.5, 8, 7]; ///< best is largest and strongest, as on the map of the flight
export function PredictedPanel({ check, shown, set }: { check: Check | null; shown: Shown; set: (s: Shown) => void }) {
  if (!check?.assumed.length) return null;
  const heights = floors(check.assumed),
    up = shown.up !== null && heights.includes(shown.up) ? shown.up : heights[0]!,
    of = shown.of,
    lows = of === 'none' ? [] : CUTS[of];
  return (
    <section class="sec-p" data-testid="predicted">
      <div class="hd">
        <h2>Expected of anchors inside</h2>
      </div>
      <div class="choices">
        <label>
          <span class="lab">On the map</span>
          <select
            data-testid="predicted-of"
            value={of}
            onChange={(e) => set({ ...shown, of: e.currentTarget.value as Shown['of'] })}
          >
            <option value="gdop">GDOP</option>
            <option value="sigma_m">error expected, 1σ</option>
            <option value="none">nothing</option>
          </select>
        </label>
        {heights.length > 1 && (
          <label>
            <span class="lab">Anchors at</span>
            <select
              data-testid="predicted-up"
              value={up}
              onChange={(e) => set({ ...shown, up: Number(e.currentTarget.value) })}
            >
              {heights.map((h) => (
                <option key={h} value={h}>
                  {fixed(h, 1)} m
                </option>
              ))}
            </select>
          </label>
        )}
      </div>
      {of !== 'none' && (
        <p class="legend grades">
          {[...lows, null].map((cut, i) => (
            <span key={i}>
              <svg viewBox="0 0 16 16" width="16" height="16" aria-hidden="true">
                <rect
                  class={`cand c${i}`}
                  x={8 - SIDES_PX[i]! / 2}
                  y={8 - SIDES_PX[i]! / 2}
                  width={SIDES_PX[i]}
                  height={SIDES_PX[i]}
                />
              </svg>
              {cut === null ? 'more' : `≤ ${of === 'gdop' ? fixed(cut, 1) : `${fixed(cut * 100, 0)} cm`}`}
            </span>
          ))}
          <span>
            <svg viewBox="0 0 16 16" width="16" height="16" aria-hidden="true">
              <path class="unseen" d="M3 3l10 10M13 3L3 13" />
            </svg>
            not seen
          </span>
        </p>
      )}
      <div class="scrollx" tabIndex={0} role="region" aria-label="Expected by height">
        <table class="tbl">
          <caption class="sr">
            Expected of anchors assumed 5 m apart inside the outline, by their height: median and worst
          </caption>
          <thead>
            <tr>
              <th scope="col">Height</th>
              <th scope="col" class="num">
                Anchors
              </th>
              <th scope="col" class="num">
                GDOP, worst
              </th>
              <th scope="col" class="num">
                1σ, worst
              </th>
            </tr>
          </thead>
          <tbody>
            {heights.map((h) => {
              const s = summary(check.assumed, h);
              return (
                <tr key={h}>
                  <th scope="row">{fixed(h, 1)} m</th>
                  <td class="num">
                    {s.n}
                    {s.unseen > 0 ? `, ${s.unseen} not seen` : ''}
                  </td>
                  <td class="num">{s.gdop ? `${fixed(s.gdop[0], 2)}, ${fixed(s.gdop[1], 2)}` : '–'}</td>
                  <td class="num">
                    {value_words(s.sigma_m[0], 'sigma_m')}, {value_words(s.sigma_m[1], 'sigma_m')}
                  </td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      <p class="sub" title="Eq 8.5 of the dissertation is the trace without the root: the square of this">
        Median and worst of anchors assumed 5 m apart. GDOP is √trace, of the measuring points within 60 m.
      </p>
    </section>
  );
}
