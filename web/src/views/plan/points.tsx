/// Every point of the plan as numbers: nothing on the map is only on the map.
import { useState } from 'preact/hooks';
import { SETTINGS, type NumberSetting, type Plan, type Waypoint } from '../../api/plans';
import { fixed } from '../../ui/format';
import { typed_number } from '../../ui/typed_number';
import { corners, moved, removed, type Picked, type Shape } from './draft';

interface Props {
  plan: Plan;
  picked: Picked | null;
  pick: (p: Picked | null) => void;
  change: (p: Plan) => void;
}

/// A number that is taken when it is one: half-typed text changes nothing.
export function Cell({
  label,
  value,
  set,
  decimals,
  min,
  max,
  empty,
}: {
  label: string;
  value: number | null;
  set: (v: number | null) => void;
  decimals: number;
  min?: number;
  max?: number;
  empty?: string;
}) {
  // What is being typed is the field's own until it is done: the page is drawn anew when a judgement of the plan comes.
  const text = value === null ? '' : value.toFixed(decimals),
    [typed, type] = useState<string | null>(null);
  const take = (t: string): void => {
    const v = typed_number(t);
    if (v === null) {
      if (empty !== undefined) set(null);
    } else if (Number.isFinite(v) && v >= (min ?? -Infinity) && v <= (max ?? Infinity)) set(v);
  };
  return (
    <input
      class="cell"
      inputMode="decimal"
      aria-label={label}
      value={typed ?? text}
      placeholder={empty}
      onInput={(e) => type(e.currentTarget.value)}
      onChange={(e) => {
        type(null);
        take(e.currentTarget.value);
        e.currentTarget.value = text;
      }}
    />
  );
}

export function Waypoints({ plan, picked, pick, change }: Props) {
  const set = (i: number, part: Partial<Waypoint>): void =>
    change({ ...plan, waypoints: plan.waypoints.map((w, k) => (k === i ? { ...w, ...part } : w)) });
  const swap = (i: number, by: number): void => {
    const list = [...plan.waypoints];
    [list[i], list[i + by]] = [list[i + by]!, list[i]!];
    change({ ...plan, waypoints: list });
    pick({ shape: 'waypoints', index: i + by });
  };
  if (!plan.waypoints.length)
    return (
      <p class="why">No waypoint yet: Generate proposes a whole flight from the outline, or tap them on the map.</p>
    );
  return (
    <div class="scrollx">
      <table class="tbl points" data-testid="waypoints">
        <caption class="sr">Waypoints in the order they are flown</caption>
        <thead>
          <tr>
            <th scope="col">No.</th>
            <th scope="col">Latitude, °</th>
            <th scope="col">Longitude, °</th>
            <th scope="col">Height, m</th>
            <th scope="col">Heading, °</th>
            <th scope="col">Dwell, s</th>
            <th scope="col">Turn</th>
            <th scope="col">Heights</th>
            <th scope="col">
              <span class="sr">Change</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {plan.waypoints.map((w, i) => (
            <tr key={i} class={picked?.shape === 'waypoints' && picked.index === i ? 'sel' : ''}>
              <th scope="row">
                <button class="id" onClick={() => pick({ shape: 'waypoints', index: i })}>
                  {i + 1}
                </button>
              </th>
              <td>
                <Cell
                  label={`Latitude of waypoint ${i + 1}`}
                  value={w.lat}
                  decimals={7}
                  min={-90}
                  max={90}
                  set={(v) => v !== null && set(i, { lat: v })}
                />
              </td>
              <td>
                <Cell
                  label={`Longitude of waypoint ${i + 1}`}
                  value={w.lon}
                  decimals={7}
                  min={-180}
                  max={180}
                  set={(v) => v !== null && set(i, { lon: v })}
                />
              </td>
              <td>
                <Cell
                  label={`Height of waypoint ${i + 1}`}
                  value={w.height_above_ground_m}
                  decimals={1}
                  min={0}
                  max={500}
                  set={(v) => v !== null && set(i, { height_above_ground_m: v })}
                />
              </td>
              <td>
                <Cell
                  label={`Heading of waypoint ${i + 1}`}
                  value={w.heading_deg}
                  decimals={0}
                  min={0}
                  max={360}
                  empty="building"
                  set={(v) => set(i, { heading_deg: v })}
                />
              </td>
              <td>
                <Cell
                  label={`Dwell of waypoint ${i + 1}`}
                  value={w.dwell_s}
                  decimals={1}
                  min={0}
                  max={600}
                  empty="default"
                  set={(v) => set(i, { dwell_s: v })}
                />
              </td>
              <td>
                <input
                  type="checkbox"
                  aria-label={`360 degree turn at waypoint ${i + 1}`}
                  checked={w.turn}
                  onChange={(e) => set(i, { turn: e.currentTarget.checked })}
                />
              </td>
              <td>
                <input
                  type="checkbox"
                  aria-label={`Height search at waypoint ${i + 1}`}
                  checked={w.height_search}
                  onChange={(e) => set(i, { height_search: e.currentTarget.checked })}
                />
              </td>
              <td class="acts">
                <button
                  class="btn small"
                  aria-label={`Waypoint ${i + 1} earlier`}
                  disabled={i === 0}
                  onClick={() => swap(i, -1)}
                >
                  ↑
                </button>
                <button
                  class="btn small"
                  aria-label={`Waypoint ${i + 1} later`}
                  disabled={i === plan.waypoints.length - 1}
                  onClick={() => swap(i, 1)}
                >
                  ↓
                </button>
                <button
                  class="btn small"
                  aria-label={`Remove waypoint ${i + 1}`}
                  onClick={() => {
                    change(removed(plan, { shape: 'waypoints', index: i }));
                    pick(null);
                  }}
                >
                  ×
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

export function Corners({ plan, shape, name, picked, pick, change }: Props & { shape: Shape; name: string }) {
  const list = corners(plan, shape);
  if (!list.length) return null;
  return (
    <details class="corners">
      <summary>
        {name}, {list.length} corners
      </summary>
      <table class="tbl points">
        <caption class="sr">Corners of {name}</caption>
        <thead>
          <tr>
            <th scope="col">No.</th>
            <th scope="col">Latitude, °</th>
            <th scope="col">Longitude, °</th>
            <th scope="col">
              <span class="sr">Change</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {list.map((c, i) => (
            <tr key={i} class={picked?.shape === shape && picked.index === i ? 'sel' : ''}>
              <th scope="row">
                <button class="id" onClick={() => pick({ shape, index: i })}>
                  {i + 1}
                </button>
              </th>
              <td>
                <Cell
                  label={`Latitude of corner ${i + 1} of ${name}`}
                  value={c.lat}
                  decimals={7}
                  min={-90}
                  max={90}
                  set={(v) => v !== null && change(moved(plan, { shape, index: i }, { lon: c.lon, lat: v }))}
                />
              </td>
              <td>
                <Cell
                  label={`Longitude of corner ${i + 1} of ${name}`}
                  value={c.lon}
                  decimals={7}
                  min={-180}
                  max={180}
                  set={(v) => v !== null && change(moved(plan, { shape, index: i }, { lon: v, lat: c.lat }))}
                />
              </td>
              <td class="acts">
                <button
                  class="btn small"
                  aria-label={`Remove corner ${i + 1} of ${name}`}
                  onClick={() => {
                    change(removed(plan, { shape, index: i }));
                    pick(null);
                  }}
                >
                  ×
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </details>
  );
}

const FIELDS: readonly (readonly [NumberSetting, string, number])[] = [
  ['keep_out_m', 'Clearance, m', 1],
  ['min_height_m', 'Lowest, m', 1],
  ['max_height_m', 'Highest, m', 1],
  ['speed_mps', 'Speed, m/s', 1],
  ['dwell_s', 'Dwell, s', 1],
  ['endurance_s', 'Endurance, s', 0],
  ['k', 'Steps k', 0],
  ['grid_step_m', 'Grid step, m', 1],
  ['target_sigma_m', 'Target σ, m', 3],
  ['max_iterations', 'Iterations, at most', 0],
];
const RULES = {
  d_optimal: 'most information (D)',
  a_optimal: 'least mean error (A)',
  dissertation: 'dissertation, GDOP',
} as const;
type Rule = keyof typeof RULES;
export function SettingFields({ plan, change }: { plan: Plan; change: (p: Plan) => void }) {
  const set = (key: NumberSetting, v: number | null): void => {
    const { [key]: _old, ...others } = plan.settings;
    change({ ...plan, settings: v === null ? others : { ...others, [key]: v } });
  };
  return (
    <div class="settings">
      <label>
        <span class="lab">Building height, m</span>
        <Cell
          label="Building height"
          value={plan.building_height_m}
          decimals={1}
          min={1}
          max={500}
          set={(v) => v !== null && change({ ...plan, building_height_m: v })}
        />
      </label>
      {FIELDS.map(([key, words, decimals]) => {
        const { default: usual, minimum, maximum } = SETTINGS[key];
        return (
          <label key={key}>
            <span class="lab">{words}</span>
            <Cell
              label={words}
              value={plan.settings[key] ?? null}
              decimals={decimals}
              min={minimum}
              max={maximum}
              empty={fixed(usual, decimals)}
              set={(v) => set(key, v)}
            />
          </label>
        );
      })}
      <label>
        <span class="lab">Planner</span>
        <select
          value={plan.settings.rule ?? SETTINGS.rule.default}
          onChange={(e) => change({ ...plan, settings: { ...plan.settings, rule: e.currentTarget.value as Rule } })}
        >
          {(Object.keys(RULES) as Rule[]).map((rule) => (
            <option key={rule} value={rule}>
              {RULES[rule]}
            </option>
          ))}
        </select>
      </label>
    </div>
  );
}
