/// Before take-off: every item green, or a reason for it. Start is blocked until then, by this page and by the server.
import { useEffect, useRef, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { checklist, set_item, work_off_checklist, type ChecklistItem } from '../../api/flight';
import { plans as fetch_plans, type Plan } from '../../api/plans';
import { sound, toggle_sound } from '../../ui/alarms';
import { Icon, Mark } from '../../ui/marks';
import { problem as refused } from './lease';
import { checklist_open } from './checklist_open';
import { HoldButton } from './hold_button';
import { useDialog } from '../../ui/use_dialog';
import { useStable } from '../../ui/use_stable';

export function Checklist({
  mission,
  note,
  start,
}: {
  mission: string;
  note: string; ///< that the aircraft refused the last Start, and why; else empty
  start: (plan: string, manual: boolean) => Promise<void>;
}) {
  const [items, set_items] = useState<readonly ChecklistItem[] | null>(null),
    [plans, set_plans] = useState<readonly Plan[] | null>(null),
    [plan, set_plan] = useState<string | null>(null),
    [manual, set_manual] = useState(false),
    [problem, set_problem] = useState(''),
    named_plan = useRef<string | null>(null), // which plan the server knows is to be flown
    box = useDialog<HTMLElement>(() => (checklist_open.value = false), 'preflight');
  useEffect(() => {
    refused.value = ''; // of another command
  }, []);
  useEffect(() => {
    fetch_plans().then(
      (list) => {
        set_plans(list);
        set_plan(list[0]?.id ?? null);
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  }, []);
  const look = useStable((): void => {
    const named = plan !== null && named_plan.current !== plan;
    (named ? work_off_checklist(mission, plan) : checklist(mission, plan)).then(
      (list) => {
        if (named) named_plan.current = plan;
        set_items(list);
        set_problem('');
      },
      (e: unknown) => {
        named_plan.current = null; // the server may have started again meanwhile
        set_problem(error_text(e));
      },
    );
  });
  useEffect(() => {
    look();
    const timer = setInterval(look, 1000);
    return () => clearInterval(timer);
  }, [mission, plan, look]);
  const open = items?.filter((i) => i.state !== 'ok') ?? [];
  const set = (item: ChecklistItem, reason: string): void => {
    set_item(mission, item.id, reason).then(look, (e: unknown) => set_problem(error_text(e)));
  };
  return (
    <section class="drawer" {...box} aria-labelledby="checklist-title" data-testid="checklist">
      <div class="hd big">
        <h2 id="checklist-title">Before take-off</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={() => (checklist_open.value = false)}>
          <Icon name="close" />
        </button>
      </div>
      {problem && (
        <div class="problem" role="status">
          {problem}
        </div>
      )}
      {plans?.length === 0 ? (
        <p class="why">
          There is no plan yet.{' '}
          <a class="btn small" href="#/plan" onClick={() => (checklist_open.value = false)}>
            Make one
          </a>
        </p>
      ) : (
        plans && (
          <div class="addform">
            <label>
              <span class="lab">Plan</span>
              <select data-testid="start-plan" value={plan ?? ''} onChange={(e) => set_plan(e.currentTarget.value)}>
                {plans.map((p) => (
                  <option key={p.id} value={p.id!}>
                    {p.name}, revision {p.revision}
                  </option>
                ))}
              </select>
            </label>
            <label class="check">
              <input type="checkbox" checked={manual} onChange={(e) => set_manual(e.currentTarget.checked)} /> A pilot
              flies by hand; this screen says where to
            </label>
          </div>
        )
      )}
      {!items && !problem && <p role="status">Waiting for the server.</p>}
      {items && (
        <ul class="checklist">
          {items.map((i) => (
            <Item key={i.id} item={i} set={set} />
          ))}
          {(sound.value === 'off' || sound.value === 'blocked') && (
            <li data-testid="check-sound">
              <Mark shape="off" tone="off" />
              <span class="grow">
                <b>
                  {sound.value === 'off'
                    ? 'The sound of alarms is off'
                    : 'The browser plays no sound: alarms are silent'}
                </b>
                <span class="mut block">
                  {sound.value === 'off'
                    ? 'A browser sounds only after a tap; nothing else waits for it.'
                    : 'See that the device has an output, is not silenced, and that the browser may play sound here.'}
                </span>
              </span>
              <button class="btn" onClick={toggle_sound}>
                {sound.value === 'off' ? 'Turn sound on' : 'Try again'}
              </button>
            </li>
          )}
        </ul>
      )}
      {(refused.value || note) && (
        <div class="callout bad refusal" role="alert" data-testid="start-refused">
          <b>Not started</b>
          <p>{refused.value || `The aircraft ${note}`}</p>
        </div>
      )}
      <div class="actions">
        <span class="mut grow" role="status">
          {items && (open.length ? `${open.length} item${open.length === 1 ? '' : 's'} open` : 'Everything is green')}
        </span>
        <HoldButton
          testid="cmd-start"
          disabled={!items || !plan || open.length > 0}
          note="hold"
          onConfirm={() => void start(plan!, manual)}
        >
          Start
        </HoldButton>
      </div>
    </section>
  );
}

function Item({ item: i, set }: { item: ChecklistItem; set: (i: ChecklistItem, reason: string) => void }) {
  const [reason, set_reason] = useState<string | null>(null),
    look = i.state === 'ok' ? (i.overridden_by && !i.manual ? 'caution' : 'ok') : i.state === 'open' ? 'off' : 'bad';
  return (
    <li data-testid={`check-${i.id}`}>
      <Mark shape={look} tone={look} />
      <span class="sr">{{ ok: 'green', caution: 'overridden', off: 'to be confirmed', bad: 'not yet' }[look]}</span>
      <span class="grow">
        <b>{i.text}</b>
        {i.overridden_by ? (
          <span class="mut block">
            {i.manual ? `Confirmed by ${i.overridden_by}` : `Overridden by ${i.overridden_by}: ${i.override_reason}`}
          </span>
        ) : (
          i.detail && <span class="mut block">{i.detail}</span>
        )}
      </span>
      {i.state === 'open' && (
        <button class="btn" onClick={() => set(i, 'confirmed')}>
          Confirm
        </button>
      )}
      {i.state === 'failed' &&
        i.overridable &&
        (reason === null ? (
          <button class="btn small" onClick={() => set_reason('')}>
            Override
          </button>
        ) : (
          <form
            class="addform"
            onSubmit={(e) => {
              e.preventDefault();
              if (reason.trim()) set(i, reason.trim());
            }}
          >
            <input
              aria-label={`Reason to override: ${i.text}`}
              placeholder="reason, stored with the flight"
              value={reason}
              maxLength={300}
              onInput={(e) => set_reason(e.currentTarget.value)}
            />
            <button class="btn small" disabled={!reason.trim()}>
              Override
            </button>
          </form>
        ))}
    </li>
  );
}
