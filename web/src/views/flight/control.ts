/// Who has control, as this page must show it: ours, taken from us, asked for, refused; and what became of commands. No DOM, no requests.
import type { Lease } from '../../api/flight';
import type { CommandMsg, ControlMsg, ProcedureMsg } from '../../live/flight_messages';
import type { EventMsg } from '../../live/messages';

export interface Held extends Lease {
  readonly mission: string;
}
/// Why a page cannot give a command; empty where it can. Hold alone takes control by itself where nobody has it.
export const why_no_command = (lost: boolean, mine: boolean, other: ControlMsg | null): string =>
  lost
    ? 'No link to the server: use the remote control'
    : mine
      ? ''
      : other
        ? `${other.holder} has control: ask for it, or take it`
        : 'Nobody has control: take control first';
const ENDED_US = 2_000_000; // a procedure that was on its way when control was taken does not end it

/// Control of this page that is gone by the word of the stream: somebody took it, or it ran out. Null while it is ours.
export function loss_of(lease: Held, p: ProcedureMsg | null | undefined): { readonly by: ControlMsg | null } | null {
  if (!p || p.mission !== lease.mission) return null;
  if (p.control) return p.control.since_us > lease.since_us ? { by: p.control } : null;
  return p.t_us > lease.since_us + ENDED_US ? { by: null } : null;
}

const ASKED_US = 60_000_000; // a question that nobody answered for a minute is over
/// Who asks this page for control, in the words of the server; null where nobody does, or the holder has answered.
export function question_of(lease: Held, events: readonly EventMsg[], now_us: number): EventMsg | null {
  const mine = events.filter((e) => e.mission === lease.mission && e.t_us > lease.since_us),
    answered = mine.filter((e) => e.code === 'control.refused').at(-1)?.t_us ?? 0;
  return (
    mine.filter((e) => e.code === 'control.asked' && e.t_us > answered && now_us - e.t_us < ASKED_US).at(-1) ?? null
  );
}
/// When a question that is asked now was asked: after every refusal that this page has heard of. Over a slow link the server's time is known late, and the
/// refusal of the question before would answer the new one.
export const asked_at_us = (mission: string, events: readonly EventMsg[], now_us: number): number =>
  events.reduce((at, e) => (e.code === 'control.refused' && e.mission === mission ? Math.max(at, e.t_us) : at), now_us);
export type Answer = 'waiting' | 'granted' | 'refused' | 'expired';
/// What became of our own question of `asked_us`: granted when nobody has control any more.
export function answer_of(
  mission: string,
  asked_us: number,
  control: ControlMsg | null,
  events: readonly EventMsg[],
  now_us: number,
): Answer {
  if (!control || control.expires_us <= now_us) return 'granted';
  if (events.some((e) => e.code === 'control.refused' && e.mission === mission && e.t_us > asked_us)) return 'refused';
  return now_us - asked_us > ASKED_US ? 'expired' : 'waiting';
}

const NOTE_US: Record<CommandMsg['state'], number> = {
  sent: 10_000_000,
  accepted: 10_000_000,
  refused: 30_000_000,
  unconfirmed: 60_000_000,
};
/// What became of the last command of this kind, for as long as it is news: a later flight begins without it.
export function command_note(commands: readonly CommandMsg[], action: string, now_us: number): string {
  const c = commands.filter((x) => x.action === action).at(-1);
  if (!c || now_us - c.t_us > NOTE_US[c.state]) return '';
  return { sent: 'sent', accepted: 'accepted', refused: `refused: ${c.text}`, unconfirmed: 'NOT CONFIRMED' }[c.state];
}
