/// A change of plan in flight: what differs, what it costs, why it is refused; flown once whoever has control has confirmed it.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { change_flown_plan, flown_plan, plan_difference, read, type Plan, type PlanDifference } from '../../api/plans';
import type { ProcedureMsg } from '../../live/flight_messages';
import { link, say } from '../../state/store';
import { clock } from '../../ui/format';
import { useDialog } from '../../ui/use_dialog';
import { useStable } from '../../ui/use_stable';
import { Small } from '../plan/conflict';
import { origin_of } from '../plan/draft';
import '../plan/plan.css';
import { difference_lines, next_words } from './change_words';
import { HoldButton } from './hold_button';
import { guarded, lease, problem } from './lease';

interface Shown {
  readonly difference: PlanDifference;
  readonly plans: readonly [Plan, Plan] | null; // what is flown, and what would be
}
async function look(p: ProcedureMsg, undo: boolean): Promise<Shown> {
  const [difference, flown, saved] = await Promise.all([
    plan_difference(p.mission, undo),
    flown_plan(p.mission),
    undo || !p.plan ? null : read(p.plan),
  ]);
  return { difference, plans: saved && [flown, saved] };
}

export function PlanChange({ p, undo, close }: { p: ProcedureMsg; undo: boolean; close: () => void }) {
  const [shown, set_shown] = useState<Shown | null>(null),
    [failed, set_failed] = useState(''),
    box = useDialog<HTMLElement>(close, 'plan-change'),
    { mission, waypoint, step, plan_saved_revision, plan_revision } = p,
    mine = lease.value?.mission === mission;
  const ask = useStable(() => look(p, undo));
  // The flight goes on: what is next, and where the aircraft is, changes with its step.
  useEffect(() => {
    let gone = false;
    ask().then(
      (s) => {
        if (gone) return;
        set_shown(s);
        set_failed('');
      },
      (e: unknown) => {
        if (!gone) set_failed(error_text(e));
      },
    );
    return () => {
      gone = true;
    };
  }, [ask, mission, undo, waypoint, step, plan_saved_revision, plan_revision]);
  const d = shown?.difference ?? null;
  const take = async (): Promise<void> => {
    if (!d || !lease.value) return;
    const { key } = lease.value,
      body = { lease: key, revision: d.to_revision, next_waypoint: d.next_waypoint, undo };
    if (!(await guarded(() => change_flown_plan(mission, body)))) return;
    say(`Revision ${d.to_revision} is flown`);
    close();
  };
  return (
    <section class="callout planchange" {...box} aria-label="Change of plan in flight" data-testid="plan-change">
      <h2>{undo ? 'Undo the change of plan' : 'Change of plan in flight'}</h2>
      {failed && (
        <p class="problem" role="alert">
          {failed}
        </p>
      )}
      {!d && !failed && <p role="status">Waiting for the server.</p>}
      {d && <Difference d={d} plans={shown!.plans} />}
      {problem.value && (
        <p class="problem" role="alert">
          {problem.value}
        </p>
      )}
      <div class="actions">
        {!mine && <span class="mut grow">Take control to fly the change.</span>}
        <button class="btn" data-testid="plan-change-close" onClick={close}>
          Close
        </button>
        <HoldButton
          testid="plan-take"
          disabled={!d?.takeable || !mine || link.value === 'lost'}
          note="hold 1 s"
          onConfirm={() => void take()}
        >
          {d ? `Fly revision ${d.to_revision}` : 'Fly it'}
        </HoldButton>
      </div>
    </section>
  );
}

function Difference({ d, plans }: { d: PlanDifference; plans: readonly [Plan, Plan] | null }) {
  const lines = difference_lines(d),
    origin = plans && origin_of(plans[0], null),
    time = (f: PlanDifference['forecast_before_s']): string => `${clock(f.low, true)} to ${clock(f.high, true)}`;
  return (
    <>
      {d.refused.length > 0 && (
        <div class="problem" role="alert" data-testid="plan-refused">
          <b>It cannot be flown from here; revision {d.from_revision} flies on.</b>
          <ul>
            {d.refused.map((r) => (
              <li key={r}>{r}</li>
            ))}
          </ul>
        </div>
      )}
      <p data-testid="plan-next">{next_words(d)}.</p>
      {lines.length ? (
        <ul data-testid="plan-lines">
          {lines.map((l) => (
            <li key={l}>{l}</li>
          ))}
        </ul>
      ) : (
        <p>Only the revision number differs.</p>
      )}
      {d.notes.length > 0 && (
        <ul class="caution" data-testid="plan-notes">
          {d.notes.map((n) => (
            <li key={n}>{n}</li>
          ))}
        </ul>
      )}
      <dl class="kv">
        <div>
          <dt>Still to fly by revision {d.from_revision}</dt>
          <dd>{time(d.forecast_before_s)}</dd>
        </div>
        <div>
          <dt>Still to fly by revision {d.to_revision}</dt>
          <dd data-testid="plan-forecast">{time(d.forecast_after_s)}</dd>
        </div>
      </dl>
      {plans && origin && (
        <div class="pair">
          {(['Flown', 'Changed'] as const).map((name, i) => (
            <figure key={name}>
              <figcaption>{name}</figcaption>
              <Small plan={plans[i]!} other={plans[1 - i]!} origin={origin} name={name} />
            </figure>
          ))}
        </div>
      )}
    </>
  );
}
