/// One line for alarms under the strip. Its place is always kept, so that nothing on the page moves under a finger when an alarm comes, when
/// they become several, or when the last one goes: what does not fit lies over the page, in a list that is opened.
import { useRef, useState } from 'preact/hooks';
import { me } from '../state/session';
import { link, live_source, now_ms, tick } from '../state/store';
import { by_urgency, type Alarm } from './alarm_rules';
import { acknowledge, alarms, mute } from './alarms';
import { AlarmRow, shape_of } from './alarm_row';
import { age, clock } from './format';
import { Mark } from './marks';
import { open_sign_in } from './sign_in_state';
import { useDialog } from './use_dialog';

const UNREAD_MS = 500; ///< a tap that soon after the line has changed was meant for what stood there before

const for_s = (a: Alarm): string => clock((now_ms() - a.since_ms) / 1000, true);

/// Signed out there is nothing to retry: the server is asked again once somebody has signed in.
function Retry() {
  if (me.value === null)
    return (
      <button class="btn" onClick={open_sign_in}>
        Sign in
      </button>
    );
  const retry = live_source()?.retry_in_ms() ?? null;
  return (
    <button class="btn" onClick={() => live_source()?.retryNow()}>
      Retry now<small>{retry === null ? '' : `in ${Math.ceil(retry / 1000)} s`}</small>
    </button>
  );
}
function Actions({ a }: { a: Alarm }) {
  const shown_ms = useRef(now_ms());
  if (a.id === 'link.lost')
    return (
      <>
        <Retry />
        <button class="btn" onClick={mute}>
          Mute 2 min
        </button>
      </>
    );
  if (a.acknowledged || a.priority === 'advisory') return null;
  return (
    <button
      class="btn"
      onClick={() => {
        if (now_ms() - shown_ms.current > UNREAD_MS) acknowledge(a.id);
      }}
    >
      Acknowledge
    </button>
  );
}

/// All of them. While it is open every row keeps its place: a new one comes last, and what is over stays, said to be over.
function AlarmList({ list, close }: { list: readonly Alarm[]; close: () => void }) {
  const box = useDialog<HTMLDivElement>(close, 'alarms'),
    rows = useRef(new Map<string, Alarm>()).current,
    standing = new Set(list.map((a) => a.id));
  for (const a of list) rows.set(a.id, a);
  return (
    <div class="alarmlist" id="alarm-list" {...box} aria-label="All alarms">
      <ul class="alarmrows">
        {[...rows.values()].map((a) => {
          const over = !standing.has(a.id);
          return (
            <AlarmRow key={a.id} a={a} stood={for_s(a)} over={over}>
              {!over && <Actions a={a} />}
            </AlarmRow>
          );
        })}
      </ul>
      <button class="btn" onClick={close}>
        Close
      </button>
    </div>
  );
}

/// With no alarm: what that is worth. Without data nothing is assessed, and what is shown is of the past.
function Calm({ last_known }: { last_known: boolean }) {
  if (last_known)
    return (
      <>
        <Mark shape="off" tone="off" />
        <div class="grow" data-testid="last-known">
          <h2>Last known values, {age(live_source()?.data_age_ms() ?? Infinity)} old</h2>
          <p>No data from anchord: nothing on this page is current.</p>
        </div>
        <Retry />
      </>
    );
  return (
    <p class="mut grow">
      {link.value === 'live' || link.value === 'late' ? 'No alarms' : 'No data from anchord: nothing is assessed.'}
    </p>
  );
}
function Shown({ a, last_known }: { a: Alarm; last_known: boolean }) {
  return (
    <>
      <span class="sign">
        <Mark shape={shape_of(a)} />
        <span class="clock" aria-hidden="true">
          {for_s(a)}
        </span>
      </span>
      <div class="grow">
        <h2>{a.title}</h2>
        <p>
          {last_known && (
            <b data-testid="last-known">Last known values, {age(live_source()?.data_age_ms() ?? Infinity)} old. </b>
          )}
          {a.advice}
        </p>
      </div>
      <Actions key={a.id} a={a} />
    </>
  );
}

/// `last_known`: the view shows values that came before the link was lost. Its values are struck; this line gives their age.
export function AlarmLine({ last_known }: { last_known: boolean }) {
  tick.value;
  const [open, set_open] = useState(false),
    list = [...alarms.value].sort(by_urgency),
    // Where no flight is recorded a lost link is no alarm, and the others are only what they were: the age of all comes first.
    first = last_known && list[0]?.id !== 'link.lost' ? undefined : list[0],
    loud = first?.priority === 'critical' && !first.acknowledged,
    others = list.length - (first ? 1 : 0);
  return (
    <section class="alarmline" aria-label="Alarms" data-testid="alarm-bar">
      <div
        class={
          first
            ? `alarm ${loud ? 'first' : 'second'} ${first.priority}${first.acknowledged ? ' acked' : ''}`
            : 'alarm calm'
        }
        data-testid={first && `alarm-${first.id}`}
      >
        {first ? <Shown a={first} last_known={last_known} /> : <Calm last_known={last_known} />}
        {(list.length > 0 || open) && (
          <button
            class="btn more"
            data-testid="alarm-more"
            aria-expanded={open}
            aria-controls={open ? 'alarm-list' : undefined}
            onClick={() => set_open(!open)}
          >
            {others > 0 && first ? `+${others} more` : others > 0 ? `${others} known` : 'Details'}
            <span class="sr"> {list.length === 1 ? 'of the alarm' : 'alarms'}</span>
          </button>
        )}
      </div>
      {open && <AlarmList list={list} close={() => set_open(false)} />}
      {/* Spoken once per alarm, without the running clock; only critical interrupts. */}
      {first && (
        <p class="sr" role={first.priority === 'critical' ? 'alert' : 'status'}>
          {first.title}. {first.advice}
        </p>
      )}
    </section>
  );
}
