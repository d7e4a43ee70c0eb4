/// The flight bar: progress at the left, commands at the right. Many may watch, one may command: control is taken, shown and given back.
import { signal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { ApiError, error_text } from '../../api/client';
import { command, release_control, renew_control, take_control, type Action, type Lease } from '../../api/flight';
import type { ProcedureMsg } from '../../live/flight_messages';
import { done_count } from '../../state/done';
import { may } from '../../state/session';
import { current_mission, current_scene, link, live_source, say, server_now_us, tick } from '../../state/store';
import { clock, fixed, percent } from '../../ui/format';
import { Checklist, checklist_open } from './checklist';
import { DevicesNote } from './devices_note';
import { HoldButton } from './hold_button';
import { flying } from './words';

/// Ours, with the mission it is for. Lives as long as the page: two browsers of one person are two.
export const lease = signal<(Lease & { readonly mission: string }) | null>(null);
const problem = signal(''),
  taken_by = signal(false);
const RENEW_MS = 20_000;

async function guarded(work: () => Promise<unknown>): Promise<void> {
  problem.value = '';
  try {
    await work();
  } catch (e) {
    problem.value = error_text(e);
    if (e instanceof ApiError && e.problem.type.endsWith('no-control')) lease.value = null;
    taken_by.value = e instanceof ApiError && e.problem.status === 409;
  }
}
const take = (mission: string, force: boolean): Promise<void> =>
  guarded(async () => {
    lease.value = { ...(await take_control(mission, force)), mission };
    taken_by.value = false;
    say('You have control');
  });
const give_back = (mission: string): Promise<void> =>
  guarded(async () => {
    await release_control(mission, lease.value?.key ?? '');
    lease.value = null;
  });
/// Hold is one press: whoever has no control yet takes it first.
export async function send(mission: string, action: Action, more: Parameters<typeof command>[3] = {}): Promise<void> {
  await guarded(async () => {
    if (lease.value?.mission !== mission) lease.value = { ...(await take_control(mission, false)), mission };
    await command(mission, action, lease.value.key, more);
  });
}
export const hold_now = (): void => {
  const m = current_mission.peek(),
    p = current_scene()?.procedure?.value;
  if (m && p && flying(p)) void send(m.mission, 'hold');
};

export function FlightBar() {
  tick.value;
  const mission = current_mission.value,
    latest = current_scene()?.procedure,
    p = latest?.value;
  const mine = lease.value !== null && lease.value.mission === mission?.mission;
  const id = mission?.mission;
  useEffect(() => {
    if (!mine || !id) return;
    const timer = setInterval(
      () =>
        void guarded(async () => {
          lease.value = { ...(await renew_control(id, lease.value!.key)), mission: id };
        }),
      RENEW_MS,
    );
    return () => clearInterval(timer);
  }, [mine, id]);
  const operator = may('operator'),
    idle = !p || p.status === 'ready' || p.status === 'done' || p.status === 'aborted';
  if (!mission || mission.state !== 'recording' || (!p && !(operator && live_source()?.offers('procedure'))))
    return null;
  const lost = link.value === 'lost',
    other = !mine && p?.control && p.control.expires_us > server_now_us() ? p.control : null;
  const note = (action: string): string => {
    const c = [...(p?.commands ?? [])].reverse().find((x) => x.action === action);
    return lost
      ? 'no link'
      : c
        ? { sent: 'sent', accepted: 'accepted', refused: `refused: ${c.text}`, unconfirmed: 'NOT CONFIRMED' }[c.state]
        : '';
  };
  const off = lost || !operator || other !== null,
    act = (action: Action) => () => void send(mission.mission, action);
  return (
    <div class="fbar" data-testid="flight-bar">
      {p && <Progress p={p} />}
      <DevicesNote mission={mission.mission} />
      <div class="cmds" data-testid="commands">
        {problem.value && (
          <p class="problem" role="alert">
            {problem.value}
          </p>
        )}
        {!operator ? null : other ? (
          <p class="why" data-testid="control">
            {other.holder} has control, since {new Date(other.since_us / 1000).toISOString().slice(11, 16)} UTC.{' '}
            {taken_by.value && (
              <HoldButton
                testid="take-anyway"
                disabled={lost}
                note="hold"
                onConfirm={() => void take(mission.mission, true)}
              >
                Take it from them
              </HoldButton>
            )}
            <button class="btn small" onClick={() => void take(mission.mission, false)}>
              Ask
            </button>
          </p>
        ) : (
          <p class="why control" data-testid="control">
            {mine ? (
              <>
                You have control.{' '}
                <button class="btn small" onClick={() => void give_back(mission.mission)}>
                  Release
                </button>
              </>
            ) : (
              <button
                class="btn small"
                disabled={lost}
                data-testid="take-control"
                onClick={() => void take(mission.mission, false)}
              >
                Take control
              </button>
            )}
          </p>
        )}
        {operator && p && flying(p) && (
          <>
            {p.status === 'hold' ? (
              <HoldButton testid="cmd-resume" disabled={off} note={note('resume')} onConfirm={act('resume')}>
                Resume
              </HoldButton>
            ) : (
              <button class="cmd primary" data-testid="cmd-hold" disabled={lost} onClick={act('hold')}>
                <span>
                  <b>Hold</b>
                  <small role="status">{note('hold')}</small>
                </span>
              </button>
            )}
            <HoldButton testid="cmd-skip" disabled={off} note={note('skip')} onConfirm={act('skip')}>
              Skip
            </HoldButton>
            <HoldButton testid="cmd-return" disabled={off} note={note('return')} onConfirm={act('return')}>
              Return
            </HoldButton>
            <HoldButton testid="cmd-land" disabled={off} note={note('land')} onConfirm={act('land')}>
              Land
            </HoldButton>
          </>
        )}
        {operator && idle && (
          <button
            class="btn primary"
            data-testid="open-checklist"
            disabled={lost || other !== null}
            onClick={() => (checklist_open.value = true)}
          >
            Checklist and start
          </button>
        )}
      </div>
      {checklist_open.value && idle && (
        <Checklist
          mission={mission.mission}
          start={async (plan, manual) => {
            await send(mission.mission, 'start', { plan, mode: manual ? 'manual' : 'auto' });
            checklist_open.value = problem.value !== '';
          }}
        />
      )}
    </div>
  );
}

function Progress({ p }: { p: ProcedureMsg }) {
  const { done, gave_up, total } = done_count(current_scene(), current_mission.value),
    battery = p.drone?.battery ?? null,
    needed = p.battery_needed;
  return (
    <dl class="kv prog" data-testid="flight-progress">
      <div>
        <dt>Waypoints</dt>
        <dd>
          {Math.min(p.waypoint, p.n_waypoints)} of {p.n_waypoints}
        </dd>
      </div>
      <div>
        <dt>Anchors done</dt>
        <dd>
          {done} of {total}
          {gave_up > 0 && <span class="u caution"> {gave_up} given up</span>}
        </dd>
      </div>
      <div>
        <dt>Flown</dt>
        <dd data-testid="flown">
          {clock(p.elapsed_s, true)}
          {p.forecast_s && (
            <span class="u">
              {' '}
              forecast {clock(p.forecast_s.low, true)} to {clock(p.forecast_s.high, true)}
            </span>
          )}
        </dd>
      </div>
      {battery !== null && (
        <div>
          <dt>Battery</dt>
          <dd class={needed !== null && battery < needed ? 'bad' : ''}>
            {percent(battery)} %{needed !== null && <span class="u"> return needs {fixed(needed * 100, 0)} %</span>}
          </dd>
        </div>
      )}
    </dl>
  );
}
