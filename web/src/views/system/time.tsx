/// Clocks: whose time stamps what, how far the others are from it; and the aircraft as its autopilot tells.
import { useEffect, useState } from 'preact/hooks';
import { devices as fetch_devices, type Device } from '../../api/devices';
import { flights as fetch_flights, kit_of, type Kit } from '../../api/site';
import { clock_and_drone, type ServerClock } from '../../api/system';
import type { DroneMsg, OtherOnLink } from '../../live/flight_messages';
import { NotLoaded } from '../../ui/empty';
import { age, fixed, percent } from '../../ui/format';
import { Chip, Mark, Q } from '../../ui/marks';

interface Look {
  readonly clock: ServerClock | null;
  readonly drone: DroneMsg | null;
  readonly devices: readonly Device[];
}
const ms = (s: number | null): string => fixed(s === null ? null : s * 1000, Math.abs(s ?? 0) < 0.01 ? 2 : 0);

export function TimePanel() {
  const [look, set_look] = useState<Look | null>(null),
    [failed, set_failed] = useState(false),
    [kit, set_kit] = useState<Kit | null>(null);
  useEffect(() => {
    const ask = (): void => {
      Promise.all([clock_and_drone(), fetch_devices()]).then(
        ([now, devices]) => {
          set_look({ ...now, devices });
          set_failed(false);
        },
        () => set_failed(true),
      );
    };
    ask();
    fetch_flights()
      .then(kit_of)
      .then(set_kit, () => undefined);
    const timer = setInterval(ask, 3000);
    return () => clearInterval(timer);
  }, []);
  if (!look)
    return (
      <section class="sys-p" data-testid="clocks">
        <h2>Clocks and aircraft</h2>
        <NotLoaded failed={failed} />
      </section>
    );
  return (
    <>
      <Clocks look={look} kit={kit} />
      <Aircraft drone={look.drone} />
    </>
  );
}

/// 50 ms is where the alarm is raised.
const LIMIT_S = 0.05;
function Clocks({ look: { clock, devices }, kit }: { look: Look; kit: Kit | null }) {
  const lag = kit?.next_flight.lag_s;
  const own = devices.filter((d) => d.clock),
    off = clock?.system_offset_s != null && Math.abs(clock.system_offset_s) > LIMIT_S;
  return (
    <section class="sys-p" data-testid="clocks">
      <h2>Clocks</h2>
      {!clock ? (
        <p class="why">This server has no devices, so it has no clocks to show.</p>
      ) : (
        <>
          <div>
            {clock.source === 'receiver' ? (
              <Chip shape="ok" tone="ok" word="TIME OF THE RECEIVER" />
            ) : (
              <Chip shape="caution" tone="caution" word="TIME OF THE COMPUTER" />
            )}{' '}
            <span class="why">
              {clock.source === 'receiver'
                ? 'Measurements are stamped in UTC as the rover reports it.'
                : 'No receiver has reported the time yet: stamps are as good as the clock of this computer.'}
            </span>
          </div>
          {clock.skew && (
            <div class="callout caution" role="status">
              <b>A clock is wrong.</b> {clock.skew[0]!.toUpperCase() + clock.skew.slice(1)}.
              {off && ' Let the computer follow NTP, or a GNSS receiver (chrony).'}
            </div>
          )}
          <table class="reads" data-testid="clock-table">
            <caption class="sr">Clocks and how they differ</caption>
            <thead>
              <tr>
                <th scope="col">Clock</th>
                <th scope="col" class="num">
                  Offset, ms
                </th>
                <th scope="col" class="num">
                  Drift, ppm
                </th>
                <th scope="col" class="num">
                  σ, ms
                </th>
              </tr>
            </thead>
            <tbody>
              <tr>
                <th scope="row">
                  This computer
                  {off && (
                    <>
                      {' '}
                      <Mark shape="caution" tone="caution" />
                    </>
                  )}
                </th>
                <td class="num">{clock.system_offset_s === null ? 'no receiver' : ms(clock.system_offset_s)}</td>
                <td class="num">–</td>
                <td class="num">{ms(clock.sigma_s)}</td>
              </tr>
              {own.map((d) => (
                <tr key={d.id}>
                  <th scope="row">
                    {d.name}
                    {d.clock!.skewed && (
                      <>
                        {' '}
                        <Mark shape="bad" tone="bad" />
                      </>
                    )}
                  </th>
                  <td class="num">–</td>
                  <td class="num">{d.clock!.settled ? fixed(d.clock!.drift_ppm, 1) : 'listening'}</td>
                  <td class="num">{ms(d.clock!.sigma_s)}</td>
                </tr>
              ))}
              {kit && lag && (
                <tr>
                  <th scope="row">UWB after RTK, estimated for kit {kit.kit}</th>
                  <td class="num">{ms(lag.value)}</td>
                  <td class="num">–</td>
                  <td class="num">{ms(lag.sigma)}</td>
                </tr>
              )}
            </tbody>
          </table>
          <p class="sub">
            Limits: 50 ms for this computer, 200 ppm for a device. A device counts from its own start, so it has a drift
            and no offset.
          </p>
        </>
      )}
    </section>
  );
}

function Aircraft({ drone: d }: { drone: DroneMsg | null }) {
  return (
    <section class="sys-p" data-testid="aircraft">
      <h2>Aircraft</h2>
      {!d ? (
        <p class="why">
          Flown by hand: this server has no link to an autopilot. The setting drone.address (MAVLink, like udp://:14550)
          gives it one at its next start.
        </p>
      ) : (
        <>
          <div>
            {d.connected ? (
              d.failsafe ? (
                <Chip shape="bad" tone="bad" word="FAILSAFE" />
              ) : (
                <Chip shape="ok" tone="ok" word="CONNECTED" />
              )
            ) : (
              <Chip shape="bad" tone="bad" word="NO LINK" />
            )}{' '}
            <span class="why">
              {d.connected
                ? d.text
                : 'Nothing was received from the autopilot ' +
                  `${d.silent_s !== null ? `for ${age(d.silent_s * 1000)}` : 'yet'}: power, telemetry radio, ` +
                  'drone.address.'}
            </span>
          </div>
          <dl class="kv s">
            <div>
              <dt>Autopilot</dt>
              <dd>{d.autopilot || '–'}</dd>
            </div>
            <div>
              <dt>Mode</dt>
              <dd>{d.mode || '–'}</dd>
            </div>
            <div>
              <dt>Battery</dt>
              <dd class={d.connected ? '' : 'stale'}>
                {d.battery === null ? '–' : <Q v={percent(d.battery)} u="%" />}
              </dd>
            </div>
            <div>
              <dt>State</dt>
              <dd>{d.in_air ? 'in the air' : d.armed ? 'armed' : 'on the ground'}</dd>
            </div>
            <div>
              <dt>Link</dt>
              <dd>
                {d.peer || '–'}, {d.link_signed ? 'signed' : 'not signed'}
              </dd>
            </div>
            <div>
              <dt>Last seen</dt>
              <dd>{d.silent_s === null ? 'never' : `${age(d.silent_s * 1000)} ago`}</dd>
            </div>
          </dl>
          {d.link_trouble !== '' && (
            <div class="callout caution" role="status">
              <b>{d.link_trouble}</b>
            </div>
          )}
          {d.frames_refused > 0 && (
            <div class="callout caution" role="status">
              <b>{d.frames_refused} frames rejected.</b> Unsigned, or signed with another key: somebody else sends on
              this link, or the autopilot has not this server&apos;s key.
            </div>
          )}
          {d.streams_refused.length > 0 && (
            <div class="callout caution" role="status">
              <b>The autopilot refuses telemetry: {d.streams_refused.join(', ')}.</b> ArduPilot sends it from 4.0 on.
            </div>
          )}
          {d.others.length > 0 && <Others others={d.others} />}
        </>
      )}
    </section>
  );
}

function Others({ others }: { others: readonly OtherOnLink[] }) {
  return (
    <table class="reads" data-testid="link-others">
      <caption>Others on the link: counted, their commands ignored</caption>
      <thead>
        <tr>
          <th scope="col">Sender</th>
          <th scope="col">What</th>
          <th scope="col" class="num">
            System
          </th>
          <th scope="col" class="num">
            Frames
          </th>
          <th scope="col" class="num">
            Last seen
          </th>
        </tr>
      </thead>
      <tbody>
        {others.map((o) => (
          <tr key={`${o.sender} ${o.system} ${o.component}`}>
            <th scope="row">{o.sender || 'same end'}</th>
            <td>{o.kind}</td>
            <td class="num">
              {o.system}/{o.component}
            </td>
            <td class="num">{o.frames}</td>
            <td class="num">{age((o.silent_s ?? 0) * 1000)} ago</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
