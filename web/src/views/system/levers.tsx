/// Lever arms: where the antennas sit on the aircraft, and what the kit has learned of it.
import { useState } from 'preact/hooks';
import { flights as fetch_flights, kit_of, type Flight, type Kit } from '../../api/site';
import { NotLoaded, useLoad } from '../../ui/empty';
import { fixed } from '../../ui/format';
import { Q } from '../../ui/marks';

export const point_words: Readonly<Record<string, string>> = {
  gnss_antenna: 'the GNSS antenna',
  body: 'the middle of the aircraft',
  tag_antenna: 'the tag itself',
};
/// Where the UWB antennas sit from the point whose track is flown: of the newest flight, with what its kit has learned of it.
export function LeverPanel() {
  const [flight, set_flight] = useState<Flight | null | undefined>(undefined),
    [failed, set_failed] = useState(false),
    [kit, set_kit] = useState<Kit | null>(null);
  useLoad(() => {
    fetch_flights().then(
      (all) => {
        const newest = all.find((f) => f.tags.length > 0) ?? all[0] ?? null;
        set_flight(newest);
        set_failed(false);
        kit_of(all).then(set_kit, () => undefined);
      },
      () => set_failed(true),
    );
  });
  const arm = kit?.next_flight.lever_up_m;
  const none =
    flight &&
    flight.track_point !== 'tag_antenna' &&
    (flight.tags.length === 0 || flight.tags.every((t) => t.lever_arm_body_m.every((x) => x === 0)));
  return (
    <section class="sys-p" data-help-part="lever-arm" data-testid="levers">
      <div class="hd">
        <h2>Lever arms</h2>
        {flight && (
          <span class="meta">
            of {flight.name}
            {flight.kit ? `, kit ${flight.kit}` : ''}
          </span>
        )}
      </div>
      {flight === undefined && <NotLoaded failed={failed} />}
      {flight === null && (
        <p class="why">Lever arms come with a flight, and there is none yet: fly one, or import one.</p>
      )}
      {flight && <p class="why">From {point_words[flight.track_point] ?? flight.track_point} to each UWB antenna.</p>}
      {none && (
        <div class="callout caution" role="status">
          <b>Not set.</b> The UWB antenna counts as being at {point_words[flight.track_point]}. Measure from there to
          the UWB antenna and give it with the <a href="#/system/flight">next flight</a>: an error of 1 cm shifts each
          anchor by up to 1 cm.
        </div>
      )}
      {flight && flight.tags.length > 0 && (
        <table class="reads" data-testid="lever-arms">
          <caption class="sr">Lever arms in metres</caption>
          <thead>
            <tr>
              <th scope="col">Tag</th>
              <th scope="col" class="num">
                Forward, m
              </th>
              <th scope="col" class="num">
                Left, m
              </th>
              <th scope="col" class="num">
                Up, m
              </th>
              <th scope="col" class="num">
                Length, m
              </th>
            </tr>
          </thead>
          <tbody>
            {flight.tags.map((t) => (
              <tr key={`${t.tag}${t.antenna}`}>
                <th scope="row" class="whole">
                  {t.tag}
                  {t.antenna ? `, antenna ${t.antenna}` : ''}
                </th>
                {t.lever_arm_body_m.map((x, i) => (
                  <td key={i} class="num">
                    {fixed(x, 3)}
                  </td>
                ))}
                <td class="num">{fixed(Math.hypot(...t.lever_arm_body_m), 3)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {flight && flight.tags.length > 0 && flight.track_point !== 'tag_antenna' && (
        <p class="why" data-testid="lever-arm-sigma">
          {flight.lever_arm_sigma_m == null
            ? 'Its accuracy is not stated (lever_arm_sigma_m of the flight): a flight with one heading is withheld because of it.'
            : `Measured to ${fixed(flight.lever_arm_sigma_m, 3)} m, one sigma, which the accuracies include.`}
        </p>
      )}
      {kit && (
        <dl class="kv s">
          <div>
            <dt>
              Estimated for the kit, {kit.n_flights} flight{kit.n_flights === 1 ? '' : 's'}
            </dt>
            <dd>
              antenna <Q v={fixed(arm ? arm.value * 100 : null, 1)} u="cm" /> higher ±{' '}
              <Q v={fixed(arm ? arm.sigma * 100 : null, 1)} u="cm" />
            </dd>
          </div>
        </dl>
      )}
    </section>
  );
}
