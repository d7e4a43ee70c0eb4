/// What is declared of a flight: its name, its building, its kit, and where the antennas are. Before it begins (New flight), or corrected after.
import { useState } from 'preact/hooks';
import type { Wire } from '../../api/contract';
import { sites as fetch_sites, type Site } from '../../api/site';
import { useLoad } from '../../ui/empty';
import { typed_number } from '../../ui/typed_number';
import { point_words } from './levers';

const AXES = ['Forward', 'Left', 'Up'] as const;
interface Arm {
  readonly tag: string;
  readonly antenna: number;
  readonly arm_m: readonly string[];
}
/// As typed.
export interface Declared {
  readonly name: string;
  readonly site: string;
  readonly kit: string;
  readonly point: string;
  readonly arms: readonly Arm[];
  readonly sigma_m: string;
}
type Tags = readonly Wire<'TagAntenna'>[];
export const arms_of = (tags: Tags): Arm[] =>
  tags.map((t) => ({ tag: t.tag, antenna: t.antenna ?? 0, arm_m: t.lever_arm_body_m.map(String) }));
const number_of = (typed: string): number => typed_number(typed) ?? NaN;

/// In metres; null where a number is none.
export function numbers_of(
  d: Declared,
): { readonly tags: Wire<'TagAntenna'>[]; readonly sigma_m: number | null } | null {
  const tags = d.arms.map((a) => ({ tag: a.tag, antenna: a.antenna, lever_arm_body_m: a.arm_m.map(number_of) })),
    sigma_m = d.sigma_m.trim() === '' ? null : number_of(d.sigma_m);
  return Number.isNaN(sigma_m) || tags.some((t) => t.lever_arm_body_m.some((v) => !Number.isFinite(v)))
    ? null
    : { tags, sigma_m };
}

export function FlightFields({ value, change }: { value: Declared; change: (part: Partial<Declared>) => void }) {
  const [all_sites, set_sites] = useState<readonly Site[]>([]);
  useLoad(() => void fetch_sites().then(set_sites, () => undefined));
  const change_arm = (i: number, axis: number, typed: string): void =>
    change({
      arms: value.arms.map((a, k) => (k === i ? { ...a, arm_m: a.arm_m.map((v, x) => (x === axis ? typed : v)) } : a)),
    });
  return (
    <>
      <div class="addform">
        <label>
          <span class="lab">Name</span>
          <input value={value.name} maxLength={200} required onInput={(e) => change({ name: e.currentTarget.value })} />
        </label>
        <label>
          <span class="lab">Site</span>
          <select value={value.site} onChange={(e) => change({ site: e.currentTarget.value })}>
            <option value="">none</option>
            {all_sites.map((s) => (
              <option key={s.id} value={s.id}>
                {s.name}
              </option>
            ))}
          </select>
        </label>
        <label>
          <span class="lab">Kit</span>
          <input value={value.kit} maxLength={200} onInput={(e) => change({ kit: e.currentTarget.value })} />
        </label>
        <label>
          <span class="lab">The track is of</span>
          <select value={value.point} onChange={(e) => change({ point: e.currentTarget.value })}>
            {Object.entries(point_words).map(([id, words]) => (
              <option key={id} value={id}>
                {words}
              </option>
            ))}
          </select>
        </label>
      </div>
      {value.point !== 'tag_antenna' && (
        <div class="addform">
          {value.arms.map((a, i) =>
            AXES.map((axis, x) => (
              <label key={`${a.tag} ${a.antenna} ${axis}`}>
                <span class="lab">
                  {a.tag} {axis}, m
                </span>
                <input
                  inputMode="decimal"
                  value={a.arm_m[x]}
                  aria-invalid={!Number.isFinite(number_of(a.arm_m[x]!))}
                  onInput={(e) => change_arm(i, x, e.currentTarget.value)}
                />
              </label>
            )),
          )}
          <label>
            <span class="lab">Measured to, one sigma, m</span>
            <input
              inputMode="decimal"
              value={value.sigma_m}
              placeholder="not stated"
              onInput={(e) => change({ sigma_m: e.currentTarget.value })}
            />
          </label>
        </div>
      )}
    </>
  );
}
