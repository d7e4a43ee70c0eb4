/// What was declared of a flight, corrected: name, site, kit, lever arms. Only what differs is sent.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { correct_flight, type Correction, type StoredFlight } from '../../api/missions';
import { Problem } from '../../ui/problem';
import { arms_of, FlightFields, numbers_of, type Declared } from './flight_fields';

/// Null where a number is none.
export function correction_of(f: StoredFlight, to: Declared): Correction | null {
  const numbers = numbers_of(to);
  if (!numbers) return null;
  const { tags, sigma_m } = numbers,
    was = f.tags.map((t) => ({ tag: t.tag, antenna: t.antenna ?? 0, lever_arm_body_m: t.lever_arm_body_m })),
    name = to.name.trim(),
    kit = to.kit.trim();
  return {
    ...(name === f.name ? {} : { name }),
    ...(to.site === (f.site ?? '') ? {} : { site: to.site || null }),
    ...(kit === (f.kit ?? '') ? {} : { kit }),
    ...(to.point === f.track_point ? {} : { track_point: to.point as StoredFlight['track_point'] }),
    ...(JSON.stringify(tags) === JSON.stringify(was) ? {} : { tags }),
    ...(sigma_m === (f.lever_arm_sigma_m ?? null) ? {} : { lever_arm_sigma_m: sigma_m }),
  };
}

export function FlightForm({ flight, close }: { flight: StoredFlight; close: (changed: boolean) => void }) {
  const [declared, set_declared] = useState<Declared>(() => ({
      name: flight.name,
      site: flight.site ?? '',
      kit: flight.kit ?? '',
      point: flight.track_point,
      arms: arms_of(flight.tags),
      sigma_m: flight.lever_arm_sigma_m == null ? '' : String(flight.lever_arm_sigma_m),
    })),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(false);
  const correction = correction_of(flight, declared),
    nothing = correction !== null && Object.keys(correction).length === 0;
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
      <FlightFields value={declared} change={(part) => set_declared({ ...declared, ...part })} />
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
