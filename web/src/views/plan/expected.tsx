/// Anchors that the flight should meet: the flight's progress and its report count against them. Those whose place is known are on the map. Each may have
/// a target of its own, also one that is not expected.
import { useState } from 'preact/hooks';
import type { AnchorRow } from '../../api/anchors';
import { setting, SETTINGS, type Plan } from '../../api/plans';
import { enu_from_geodetic, type Geodetic } from '../../map/enu';
import { fixed } from '../../ui/format';
import { to_m } from './draft';
import { Cell } from './points';

const REACH_M = 60; ///< within which the server's planner counts on ranges
export interface Placed {
  readonly id: string;
  readonly e: number;
  readonly n: number;
}

/// Expected anchors whose place is known, about the plan's origin.
export function placed(plan: Plan, known: ReadonlyMap<string, AnchorRow>, origin: Geodetic): Placed[] {
  return plan.expected.flatMap((id) => {
    const row = known.get(id);
    if (!row || row.lon == null || row.lat == null) return [];
    const [e, n] = enu_from_geodetic({ lon: row.lon, lat: row.lat, h_m: origin.h_m }, origin);
    return [{ id, e, n }];
  });
}
/// `0x6A2F ` as the server writes it; null where it is no radio address.
export const typed_address = (text: string): string | null => {
  const t = text.trim().toLowerCase(),
    hex = t.startsWith('0x') ? t : `0x${t}`;
  return /^0x[0-9a-f]{4,8}$/.test(hex) ? hex : null;
};

export function Expected({
  plan,
  known,
  origin,
  change,
}: {
  plan: Plan;
  known: ReadonlyMap<string, AnchorRow>;
  origin: Geodetic | null;
  change: (p: Plan) => void;
}) {
  const [text, set_text] = useState(''),
    address = typed_address(text),
    places = new Map(origin ? placed(plan, known, origin).map((p) => [p.id, p]) : []),
    offered = [...known.keys()].filter((id) => !plan.expected.includes(id)).sort();
  const points = origin ? plan.waypoints.filter((w) => w.measure).map((w) => to_m(w, origin)) : [];
  const reach = (id: string): string => {
    const at = places.get(id);
    return at
      ? `${points.filter(([e, n]) => Math.hypot(e - at.e, n - at.n) <= REACH_M).length} of ${points.length}`
      : '–';
  };
  const rows = [...plan.expected, ...Object.keys(plan.targets).filter((id) => !plan.expected.includes(id))];
  const { minimum, maximum } = SETTINGS.target_sigma_m;
  const aim = (id: string, sigma_m: number | null): void => {
    const { [id]: _old, ...others } = plan.targets;
    change({ ...plan, targets: sigma_m === null ? others : { ...others, [id]: sigma_m } });
  };
  const forget = (id: string): void => {
    const { [id]: _old, ...targets } = plan.targets;
    change({ ...plan, expected: plan.expected.filter((x) => x !== id), targets });
  };
  const add = (): void => {
    if (address && !plan.expected.includes(address)) change({ ...plan, expected: [...plan.expected, address] });
    set_text('');
  };
  return (
    <section class="sec-p" data-testid="expected">
      <div class="hd">
        <h2>Expected anchors</h2>
        <span class="meta">{plan.expected.length}</span>
      </div>
      {plan.expected.length === 0 && <p class="why">None is listed: the flight measures every anchor in range.</p>}
      {rows.length > 0 && (
        <table class="tbl">
          <caption class="sr">Anchors that the flight should meet</caption>
          <thead>
            <tr>
              <th scope="col">Anchor</th>
              <th scope="col">Known place</th>
              <th scope="col" class="num">
                Points within {fixed(REACH_M, 0)} m
              </th>
              <th scope="col">Target σ, m</th>
              <th scope="col">
                <span class="sr">Change</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map((id) => (
              <tr key={id}>
                <th scope="row">
                  {known.get(id)?.name || id}
                  {known.get(id)?.name ? <span class="mut"> {id}</span> : ''}
                </th>
                <td>
                  {!plan.expected.includes(id) ? (
                    <span class="mut">not expected</span>
                  ) : places.has(id) ? (
                    'published'
                  ) : (
                    <span class="mut">not yet</span>
                  )}
                </td>
                <td class="num">{reach(id)}</td>
                <td>
                  <Cell
                    label={`Target sigma of ${id}, metres`}
                    value={plan.targets[id] ?? null}
                    decimals={3}
                    min={minimum}
                    max={maximum}
                    empty={fixed(setting(plan, 'target_sigma_m'), 3)}
                    set={(v) => aim(id, v)}
                  />
                </td>
                <td class="acts">
                  <button class="btn small" aria-label={`Do not expect ${id}`} onClick={() => forget(id)}>
                    ×
                  </button>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      <form
        class="addform"
        onSubmit={(e) => {
          e.preventDefault();
          add();
        }}
      >
        <input
          aria-label="Radio address of an anchor"
          placeholder="0x6a2f"
          list="known-anchors"
          value={text}
          data-testid="expect-address"
          onInput={(e) => set_text(e.currentTarget.value)}
        />
        <datalist id="known-anchors">
          {offered.map((id) => (
            <option key={id} value={id}>
              {known.get(id)?.name}
            </option>
          ))}
        </datalist>
        <button class="btn" disabled={!address} data-testid="expect">
          Expect
        </button>
        {offered.length > 0 && (
          <button
            type="button"
            class="btn"
            onClick={() => change({ ...plan, expected: [...plan.expected, ...offered] })}
          >
            All {offered.length} known
          </button>
        )}
      </form>
    </section>
  );
}
