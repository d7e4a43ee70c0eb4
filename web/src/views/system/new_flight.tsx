/// A new flight: declared as the last one was, then it records what the devices of this server measure.
import { useEffect, useRef, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { devices as fetch_devices, type Device } from '../../api/devices';
import { begin_flight, stored_flights, type StoredFlight } from '../../api/missions';
import { load_missions } from '../../state/archive';
import { chosen_mission, link, server_now_us } from '../../state/store';
import { useLoad } from '../../ui/empty';
import { Problem } from '../../ui/problem';
import { arms_of, FlightFields, numbers_of, type Declared } from './flight_fields';
import { of_ranges } from './standing';

/// As the newest flight was declared that these tags flew, with a name of its own. A tag of which no arm is known has none: it is to be
/// measured, and nothing is what a wrong guess would look like.
export function declared_for(tags: readonly string[], flights: readonly StoredFlight[], now_us: number): Declared {
  const last = flights.find((f) => f.kit !== 'simulated' && (!tags.length || f.tags.some((t) => tags.includes(t.tag)))),
    known = arms_of(last?.tags ?? []).filter((a) => !tags.length || tags.includes(a.tag));
  return {
    name: `Flight ${new Date(now_us / 1000).toISOString().slice(0, 16).replace('T', ' ')}`,
    site: last?.site ?? '',
    kit: last?.kit ?? '',
    point: last?.track_point ?? 'gnss_antenna',
    arms: [
      ...known,
      ...tags
        .filter((tag) => !known.some((a) => a.tag === tag))
        .map((tag) => ({ tag, antenna: 0, arm_m: ['', '', ''] })),
    ],
    sigma_m: last?.lever_arm_sigma_m == null ? '' : String(last.lever_arm_sigma_m),
  };
}

export function NewFlight({ close }: { close: () => void }) {
  const [declared, set_declared] = useState<Declared | null>(null),
    [driven, set_driven] = useState<readonly Device[]>([]),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(false),
    form = useRef<HTMLFormElement>(null),
    there = declared !== null;
  // It may be far down the page.
  useEffect(() => form.current?.querySelector('input')?.focus(), [there]);
  useLoad(() => {
    Promise.all([fetch_devices(), stored_flights()]).then(
      ([all, flights]) => {
        const ours = all.filter((d) => d.id !== null && d.enabled),
          tags = ours.filter(of_ranges).flatMap((d) => d.network_id ?? []);
        set_driven(ours);
        set_declared((typed) => typed ?? declared_for([...new Set(tags)], flights, server_now_us()));
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  const numbers = declared && (declared.point === 'tag_antenna' ? { tags: [], sigma_m: null } : numbers_of(declared));
  const begin = async (): Promise<void> => {
    if (!declared || !numbers) return;
    set_busy(true);
    set_problem('');
    try {
      chosen_mission.value = await begin_flight({
        name: declared.name.trim(),
        ...(declared.site ? { site: declared.site } : {}),
        ...(declared.kit.trim() ? { kit: declared.kit.trim() } : {}),
        frame: 'wgs84',
        track_point: declared.point as StoredFlight['track_point'],
        ...(numbers.tags.length ? { tags: numbers.tags } : {}),
        ...(numbers.sigma_m === null ? {} : { lever_arm_sigma_m: numbers.sigma_m }),
      });
      await load_missions();
      location.hash = '#/live';
    } catch (e) {
      set_problem(error_text(e));
      set_busy(false);
    }
  };
  return (
    <form
      ref={form}
      class="callout device-form"
      data-help="lever-arm"
      data-testid="new-flight"
      aria-label="New flight"
      onSubmit={(e) => {
        e.preventDefault();
        void begin();
      }}
    >
      <b>New flight</b>
      <p class="why">
        {driven.length
          ? `It records what ${driven.map((d) => d.name || d.kind).join(', ')} measure, from now until it is finished. Live shows it.`
          : 'This server drives no devices: the flight records what is sent to it over REST.'}{' '}
        Lever arms lead from the point that the track is of to the antenna of the tag; one that is wrong by 5 cm moves
        every anchor by up to 5 cm.
      </p>
      {declared && <FlightFields value={declared} change={(part) => set_declared({ ...declared, ...part })} />}
      <Problem text={problem} />
      <div class="actions">
        {declared && !numbers && <span class="mut">Lever arms are numbers in metres, forward, left and up.</span>}
        <button type="button" class="btn" onClick={close}>
          Not now
        </button>
        <button
          class="btn primary"
          data-testid="begin-flight"
          disabled={busy || !numbers || !declared?.name.trim() || link.value === 'lost'}
        >
          Start recording
        </button>
      </div>
    </form>
  );
}
