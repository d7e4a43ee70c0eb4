import { describe, expect, it } from 'vitest';
import { procedure } from '../src/live/flight_messages';
import { event, type EventMsg } from '../src/live/messages';
import {
  answer_of,
  asked_at_us,
  command_note,
  loss_of,
  question_of,
  why_no_command,
} from '../src/views/flight/control';

const T = 1_777_889_472_000_000,
  s = (n: number): number => T + n * 1e6;
const lease = { mission: 'm', key: 'k', since_us: T, expires_us: s(60) };
const seen = (at_s: number, since_s: number | null, holder = 'operator 2') =>
  procedure({
    mission: 'm',
    t_us: s(at_s),
    control: since_s === null ? null : { holder, since_us: s(since_s), expires_us: s(since_s + 60) },
  });
const said = (code: string, at_s: number, mission = 'm'): EventMsg =>
  event({ id: `${code}${at_s}`, t_us: s(at_s), level: 'info', code, text: `${code} text`, mission })!;

describe('control of this page', () => {
  it('is gone at the first word that somebody else took it, or that it ran out', () => {
    expect(loss_of(lease, seen(5, 4))!.by!.holder).toBe('operator 2');
    expect(loss_of(lease, seen(70, null))).toEqual({ by: null });
  });
  it('stays while the stream tells of ours, of the one before, of another flight, or not yet of it', () => {
    expect(loss_of(lease, seen(5, 0, 'me'))).toBeNull();
    expect(loss_of(lease, seen(0.5, -30))).toBeNull(); // on its way when ours was taken
    expect(loss_of(lease, seen(0.5, null))).toBeNull();
    expect(loss_of({ ...lease, mission: 'other' }, seen(5, 4))).toBeNull();
    expect(loss_of(lease, null)).toBeNull();
  });
  it('is asked for by an event, until it is answered or a minute has passed', () => {
    const asked = said('control.asked', 10);
    expect(question_of(lease, [said('control.asked', -5), asked], s(12))).toBe(asked);
    expect(question_of(lease, [asked, said('control.refused', 11)], s(12))).toBeNull();
    expect(question_of(lease, [asked], s(80))).toBeNull();
    expect(question_of(lease, [said('control.asked', 10, 'x')], s(12))).toBeNull();
  });
  it('is granted when nobody has it, refused by the word of the holder', () => {
    const control = seen(1, 0)!.control;
    expect(answer_of('m', s(10), control, [], s(12))).toBe('waiting');
    expect(answer_of('m', s(10), control, [said('control.refused', 9)], s(12))).toBe('waiting');
    expect(answer_of('m', s(10), control, [said('control.refused', 11)], s(12))).toBe('refused');
    // Asked again at once, the server's time known 3 s late: what refused the first question is no answer to the second.
    const before = [said('control.refused', 11), said('control.refused', 30, 'other')],
      again_us = asked_at_us('m', before, s(8));
    expect(answer_of('m', again_us, control, before, s(12))).toBe('waiting');
    expect(answer_of('m', again_us, control, [...before, said('control.refused', 13)], s(14))).toBe('refused');
    expect(answer_of('m', s(10), null, [], s(12))).toBe('granted');
    expect(answer_of('m', s(10), { ...control!, expires_us: s(900) }, [], s(80))).toBe('expired');
  });
});

describe('the note under a command', () => {
  const land = (state: string) =>
    procedure({
      mission: 'm',
      commands: [{ number: 1, action: 'land', state, text: 'not flying', by: 'me', t_us: T }],
    })!.commands;
  it('is gone when it is no news: it does not stand through the next flight', () => {
    expect(command_note(land('accepted'), 'land', s(3))).toBe('accepted');
    expect(command_note(land('accepted'), 'land', s(11))).toBe('');
    expect(command_note(land('refused'), 'land', s(20))).toBe('refused: not flying');
    expect(command_note(land('refused'), 'land', s(31))).toBe('');
    expect(command_note(land('unconfirmed'), 'land', s(31))).toBe('NOT CONFIRMED');
    expect(command_note(land('accepted'), 'hold', s(3))).toBe('');
  });
});

describe('a command', () => {
  const other = { holder: 'operator 2', since_us: T, expires_us: s(60) };
  it('can be given by the page that has control, and by no other', () => {
    expect(why_no_command(false, true, null)).toBe('');
    expect(why_no_command(false, false, null)).toMatch(/^Nobody has control: take control first/);
    expect(why_no_command(false, false, other)).toMatch(/^operator 2 has control/);
    expect(why_no_command(true, true, null)).toMatch(/^No link/);
  });
});
