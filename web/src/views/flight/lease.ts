/// Control of this page: taken, renewed while it is ours, given up the moment the stream says that somebody else has it. Goes on in every view.
import { effect, signal } from '@preact/signals';
import { ApiError, error_text } from '../../api/client';
import {
  order_anchor,
  type AnchorOrder,
  ask_for_control,
  command,
  refuse_control,
  release_control,
  renew_control,
  take_control,
  type Action,
} from '../../api/flight';
import { events, link, now_ms, say, scenes, server_now_us, tick } from '../../state/store';
import { answer_of, asked_at_us, loss_of, type Held } from './control';
import { put_lease, take_lease } from './kept_lease';

/// The tab's own storage; null where the browser keeps nothing.
function of_tab(): Storage | null {
  try {
    return globalThis.sessionStorage ?? null;
  } catch {
    return null;
  }
}
const tab = of_tab();
/// Ours, with the mission it is for. It lives as long as the tab, over a reload as well: two browsers of one person are two.
export const lease = signal<Held | null>(tab && take_lease(tab));
if (tab) {
  globalThis.addEventListener('pagehide', () => put_lease(tab, lease.peek()));
  globalThis.addEventListener('pageshow', (e) => {
    if (e.persisted) take_lease(tab); // the page had gone on living, with its own
  });
}
/// Why a control is not ours any more; stands until it is taken again or somebody waves it away.
export const lost_control = signal<{ readonly mission: string; readonly text: string } | null>(null);
export const asking = signal<{ readonly mission: string; readonly at_us: number } | null>(null);
export const problem = signal('');

const RENEW_MS = 20_000,
  RENEW_BLIND_MS = 2000; // where no procedure tells who has control

export async function guarded(work: () => Promise<unknown>): Promise<boolean> {
  problem.value = '';
  try {
    await work();
    return true;
  } catch (e) {
    problem.value = error_text(e);
    if (e instanceof ApiError && e.problem.type.endsWith('no-control') && lease.value)
      gone(lease.value.mission, error_text(e));
    return false;
  }
}
function gone(mission: string, text: string): void {
  lease.value = null;
  lost_control.value = { mission, text };
}
export const take = (mission: string, force: boolean): Promise<boolean> =>
  guarded(async () => {
    lease.value = { ...(await take_control(mission, force)), mission };
    renewed_ms = now_ms();
    lost_control.value = asking.value = null;
    say('You have control');
  });
export const give_back = (mission: string): Promise<boolean> =>
  guarded(async () => {
    await release_control(mission, lease.value?.key ?? '');
    lease.value = null;
  });
export const ask = (mission: string): Promise<boolean> =>
  guarded(async () => {
    await ask_for_control(mission);
    asking.value = { mission, at_us: asked_at_us(mission, events.peek(), server_now_us()) };
  });
export const refuse = (mission: string): Promise<boolean> =>
  guarded(() => refuse_control(mission, lease.value?.key ?? ''));

/// Hold is one press: whoever has no control yet takes it first.
export async function send(mission: string, action: Action, more: Parameters<typeof command>[3] = {}): Promise<void> {
  if (lease.value?.mission !== mission && !(await take(mission, false))) return;
  await guarded(() => command(mission, action, lease.value!.key, more));
}

const ORDER_WORDS: Record<AnchorOrder, string> = {
  accept: 'accepted',
  give_up: 'given up',
  reopen: 'is worked on again',
};
export const order = (mission: string, anchor: string, action: AnchorOrder): Promise<boolean> =>
  guarded(async () => {
    await order_anchor(mission, anchor, lease.value?.key ?? '', action);
    say(`${anchor} ${ORDER_WORDS[action]}`);
  });

let renewed_ms = -Infinity, // a lease of before a reload is asked for at once
  asking_now = false;
async function renew(held: Held): Promise<void> {
  renewed_ms = now_ms();
  try {
    const now = await renew_control(held.mission, held.key);
    if (lease.value?.key === held.key) lease.value = { ...now, mission: held.mission };
  } catch (e) {
    // A lost link is not a lost control: only the server's word ends it.
    if (e instanceof ApiError && e.problem.status === 409 && lease.value?.key === held.key)
      gone(held.mission, error_text(e));
  }
}
const at = (us: number): string => new Date(us / 1000).toISOString().slice(11, 16);
effect(() => {
  tick.value;
  const held = lease.value,
    question = asking.value;
  if (link.peek() === 'lost') return;
  if (held) {
    const p = scenes.get(held.mission)?.procedure?.value,
      loss = loss_of(held, p);
    if (loss)
      gone(
        held.mission,
        loss.by ? `${loss.by.holder} took control at ${at(loss.by.since_us)} UTC.` : 'Your control has run out.',
      );
    else if (now_ms() - renewed_ms > (p ? RENEW_MS : RENEW_BLIND_MS)) void renew(held);
  }
  if (question && !asking_now) {
    const p = scenes.get(question.mission)?.procedure?.value,
      answer = answer_of(question.mission, question.at_us, p?.control ?? null, events.value, server_now_us());
    if (answer === 'waiting') return;
    if (answer === 'granted') {
      asking_now = true;
      void take(question.mission, false).finally(() => {
        asking.value = null;
        asking_now = false;
      });
      return;
    }
    asking.value = null;
    say(answer === 'refused' ? `Refused: ${p?.control?.holder ?? 'the holder'} keeps control` : 'Nobody answered');
  }
});
