/// What was declared of a flight, corrected: name, site, kit, lever arms. Only what differs is sent.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { correct_flight, type Correction, type StoredFlight } from '../../api/missions';
import { sites as fetch_sites, type Site } from '../../api/site';
import { useLoad } from '../../ui/empty';
import { Problem } from '../../ui/problem';
import { point_words } from './levers';

const AXES = ['Forward', 'Left', 'Up'] as const;
interface Arm {
  readonly tag: string;
  readonly antenna: number;
  readonly arm_m: readonly string[]; ///< as typed
}
const arms_of = (f: StoredFlight): Arm[] =>
  f.tags.map((t) => ({ tag: t.tag, antenna: t.antenna ?? 0, arm_m: t.lever_arm_body_m.map(String) }));
const number_of = (typed: string): number => (typed.trim() === '' ? NaN : Number(typed.trim().replace(',', '.')));

/// Null where a number is none.
export function correction_of(
  f: StoredFlight,
  to: { name: string; site: string; kit: string; point: string; arms: readonly Arm[]; sigma_m: string },
): Correction | null {
  const tags = to.arms.map((a) => ({ tag: a.tag, antenna: a.antenna, lever_arm_body_m: a.arm_m.map(number_of) })),
    sigma_m = to.sigma_m.trim() === '' ? null : number_of(to.sigma_m);
  if (Number.isNaN(sigma_m) || tags.some((t) => t.lever_arm_body_m.some((v) => !Number.isFinite(v)))) return null;
  const was = f.tags.map((t) => ({ tag: t.tag, antenna: t.antenna ?? 0, lever_arm_body_m: t.lever_arm_body_m }));
  return {
    ...(to.name === f.name ? {} : { name: to.name }),
    ...(to.site === (f.site ?? '') ? {} : { site: to.site || null }),
    ...(to.kit === (f.kit ?? '') ? {} : { kit: to.kit }),
    ...(to.point === f.track_point ? {} : { track_point: to.point as StoredFlight['track_point'] }),
    ...(JSON.stringify(tags) === JSON.stringify(was) ? {} : { tags }),
    ...(sigma_m === (f.lever_arm_sigma_m ?? null) ? {} : { lever_arm_sigma_m: sigma_m }),
  };
}

export function FlightForm({ flight, close }: { flight: StoredFlight; close: (changed: boolean) => void }) {
  const [name, set_name] = useState(flight.name),
    [site, set_site] = useState(flight.site ?? ''),
    [kit, set_kit] = useState(flight.kit ?? ''),
    [point, set_point] = useState<string>(flight.track_point),
    [arms, set_arms] = useState<readonly Arm[]>(() => arms_of(flight)),
    [sigma_m, set_sigma] = useState(flight.lever_arm_sigma_m == null ? '' : String(flight.lever_arm_sigma_m)),
    [all_sites, set_sites] = useState<readonly Site[]>([]),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(false);
  useLoad(() => void fetch_sites().then(set_sites, () => undefined));
  const correction = correction_of(flight, { name: name.trim(), site, kit: kit.trim(), point, arms, sigma_m }),
    nothing = correction !== null && Object.keys(correction).length === 0;
  const change_arm = (i: number, axis: number, typed: string): void =>
    set_arms(arms.map((a, k) => (k === i ? { ...a, arm_m: a.arm_m.map((v, x) => (x === axis ? typed : v)) } : a)));
  const send = async (): Promise<void> => {
    if (!correction) return;
    set_busy(true);
    set_problem('');
    try {
      await correct_flight(flight.id, correction);
      close(true);
    } catch (e) {
      set_problem(error_text(e));
      set_busy(false);
    }
  };
  return (
    <form
      class="callout device-form"
      data-help="lever-arm"
      data-testid="flight-form"
      aria-label={`Correct ${flight.name}`}
      onSubmit={(e) => {
        e.preventDefault();
        void send();
      }}
    >
      <b>Correct {flight.name}</b>
      <p class="why">
        Its measurements stay as they are, and its estimates are computed anew. Calibrations made before keep what they
        were made with: calibrate again.
      </p>
      <div class="addform">
        <label>
          <span class="lab">Name</span>
          <input value={name} maxLength={200} required onInput={(e) => set_name(e.currentTarget.value)} />
        </label>
        <label>
          <span class="lab">Site</span>
          <select value={site} onChange={(e) => set_site(e.currentTarget.value)}>
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
          <input value={kit} maxLength={200} onInput={(e) => set_kit(e.currentTarget.value)} />
        </label>
        <label>
          <span class="lab">The track is of</span>
          <select value={point} onChange={(e) => set_point(e.currentTarget.value)}>
            {Object.entries(point_words).map(([id, words]) => (
              <option key={id} value={id}>
                {words}
              </option>
            ))}
          </select>
        </label>
      </div>
      {point !== 'tag_antenna' && (
        <div class="addform">
          {arms.map((a, i) =>
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
              value={sigma_m}
              placeholder="not stated"
              onInput={(e) => set_sigma(e.currentTarget.value)}
            />
          </label>
        </div>
      )}
      <Problem text={problem} />
      <div class="actions">
        {correction === null && <span class="mut">Lever arms are numbers in metres.</span>}
        <button type="button" class="btn" onClick={() => close(false)}>
          Not now
        </button>
        <button class="btn primary" data-testid="flight-correct" disabled={busy || !correction || nothing}>
          Correct
        </button>
      </div>
    </form>
  );
}
