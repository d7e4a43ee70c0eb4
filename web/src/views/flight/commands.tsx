/// The flight bar: progress at the left, commands at the right. Many may watch, one may command: control is taken, shown and given back.
import type { Action } from '../../api/flight';
import type { ControlMsg, ProcedureMsg } from '../../live/flight_messages';
import { done_count } from '../../state/done';
import { may } from '../../state/session';
import { current_mission, current_scene, events, link, live_source, say, server_now_us, tick } from '../../state/store';
import { clock, fixed, percent } from '../../ui/format';
import { useLater } from '../../ui/use_later';
import { checklist_open } from './checklist_open';
import { Aside, load_devices_note } from './aside';
import { command_note, question_of, why_no_command } from './control';
import { HoldButton } from './hold_button';
import { ask, asking, give_back, lease, lost_control, problem, refuse, send, take } from './lease';
import { flying } from './words';

/// Who else has control; null where nobody does, or this page.
const holder_else = (mission: string, p: ProcedureMsg | undefined): ControlMsg | null =>
  lease.value?.mission !== mission && p?.control && p.control.expires_us > server_now_us() ? p.control : null;
export const hold_now = (): void => {
  const m = current_mission.peek(),
    p = current_scene()?.procedure?.value;
  if (!m || !p || !flying(p) || !may('operator')) return;
  const other = holder_else(m.mission, p);
  if (other) say(`Not held: ${other.holder} has control. Ask for it, or take it`);
  else void send(m.mission, 'hold');
};

export function FlightBar() {
  tick.value;
  const mission = current_mission.value,
    latest = current_scene()?.procedure,
    p = latest?.value;
  const mine = lease.value !== null && lease.value.mission === mission?.mission;
  const operator = may('operator'),
    idle = !p || p.status === 'ready' || p.status === 'done' || p.status === 'aborted';
  if (!mission || mission.state !== 'recording' || (!p && !(operator && live_source()?.offers('procedure'))))
    return null;
  const lost = link.value === 'lost',
    other = holder_else(mission.mission, p),
    question = mine ? question_of(lease.value!, events.value, server_now_us()) : null,
    taken = lost_control.value?.mission === mission.mission ? lost_control.value : null;
  const note = (action: string): string =>
    lost ? 'no link' : command_note(p?.commands ?? [], action, server_now_us());
  const dead = why_no_command(lost, mine, other),
    gated = (action: string): string => note(action) || (dead ? 'no control' : ''),
    refused_start = idle && note('start').startsWith('refused') ? note('start') : '',
    off = dead !== '',
    act = (action: Action) => () => void send(mission.mission, action);
  return (
    <div class="fbar" data-testid="flight-bar">
      {p && <Progress p={p} />}
      <Aside load={load_devices_note} mission={mission.mission} />
      {p && <Notice p={p} />}
      <div class="cmds" data-testid="commands">
        {!checklist_open.value && (problem.value || refused_start) && (
          <p class="problem" role="alert">
            {problem.value || `Not started: the aircraft ${refused_start}`}
          </p>
        )}
        {operator && taken && (
          <p class="callout caution" role="alert" data-testid="control-lost">
            <b>You no longer have control.</b> {taken.text}{' '}
            <button class="btn small" onClick={() => (lost_control.value = null)}>
              Understood
            </button>
          </p>
        )}
        {question && (
          <p class="callout caution" role="alert" data-testid="control-asked">
            <b>{question.text}.</b>{' '}
            <button class="btn small" data-testid="control-grant" onClick={() => void give_back(mission.mission)}>
              Give control
            </button>{' '}
            <button class="btn small" data-testid="control-refuse" onClick={() => void refuse(mission.mission)}>
              Keep it
            </button>
          </p>
        )}
        {!operator ? null : other ? (
          <p class="why control theirs" data-testid="control">
            {other.holder} has control, since {new Date(other.since_us / 1000).toISOString().slice(11, 16)} UTC.{' '}
            <button
              class="btn small"
              data-testid="ask-control"
              disabled={lost || asking.value !== null}
              onClick={() => void ask(mission.mission)}
            >
              {asking.value ? 'Asked, waiting' : 'Ask for control'}
            </button>{' '}
            <HoldButton
              testid="take-anyway"
              disabled={lost}
              note="hold 1 s"
              onConfirm={() => void take(mission.mission, true)}
            >
              Take control from them
            </HoldButton>
          </p>
        ) : (
          <p class="why control" data-testid="control">
            {mine ? (
              <>
                <span class="yours">You have control. </span>
                <button class="btn small" onClick={() => void give_back(mission.mission)}>
                  Release control
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
              <HoldButton
                testid="cmd-resume"
                disabled={off}
                why={dead}
                note={gated('resume')}
                onConfirm={act('resume')}
              >
                Resume
              </HoldButton>
            ) : (
              <button
                class="cmd primary"
                data-testid="cmd-hold"
                disabled={lost || other !== null}
                title={lost || other ? dead : undefined}
                onClick={act('hold')}
              >
                <span>
                  <b>Hold</b>
                  <small role="status">{note('hold') || (other ? 'no control' : '')}</small>
                </span>
              </button>
            )}
            <HoldButton testid="cmd-skip" disabled={off} why={dead} note={gated('skip')} onConfirm={act('skip')}>
              Skip
            </HoldButton>
            <HoldButton testid="cmd-return" disabled={off} why={dead} note={gated('return')} onConfirm={act('return')}>
              Return
            </HoldButton>
            <HoldButton testid="cmd-land" disabled={off} why={dead} note={gated('land')} onConfirm={act('land')}>
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
      {operator && idle && <BeforeTakeOff mission={mission.mission} note={refused_start} />}
    </div>
  );
}

const load_plan_notice = () => import('./plan_notice').then((m) => m.PlanNotice);
function Notice({ p }: { p: ProcedureMsg }) {
  const { part: PlanNotice } = useLater(load_plan_notice);
  return PlanNotice && <PlanNotice p={p} />;
}

/// Fetched when there is a flight to start, before anybody asks for it.
const load_checklist = () => import('./checklist').then((m) => m.Checklist);
function BeforeTakeOff({ mission, note }: { mission: string; note: string }) {
  const { part: Checklist } = useLater(load_checklist);
  if (!checklist_open.value || !Checklist) return null;
  return (
    <Checklist
      mission={mission}
      note={note}
      start={async (plan, manual) => {
        await send(mission, 'start', { plan, mode: manual ? 'manual' : 'auto' });
        checklist_open.value = problem.value !== '';
      }}
    />
  );
}

function Progress({ p }: { p: ProcedureMsg }) {
  const { done, gave_up, total } = done_count(current_scene(), current_mission.value),
    battery = p.drone?.battery ?? null,
    needed = flying(p) ? p.battery_needed : null; // on the ground no way back is left
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
