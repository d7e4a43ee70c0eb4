/// The procedure and the alarms of a moment of a stored flight, from its events: each step is one, and each alarm that came or went. No DOM.
import type { ProcedureMsg, Step } from '../live/flight_messages';
import { STEPS } from '../live/flight_messages';
import type { Alarm, Priority } from '../ui/alarm_rules';
import type { Mark } from './recording';

export interface Moment {
  readonly step: Step;
  readonly reason: string;
  readonly since_us: number;
  readonly started_us: number;
  readonly iteration: number; ///< points measured so far
  readonly reached: readonly string[]; ///< anchors whose work is over, with the words of the procedure
}

const step_of = (m: Mark): Step | null =>
  m.code.startsWith('procedure.') ? (STEPS.find((s) => s === m.code.slice('procedure.'.length)) ?? null) : null;

/// Null before the take-off: a flight may be recorded long before it is flown, or be flown by nobody here.
export function procedure_at(marks: readonly Mark[], t_us: number): Moment | null {
  let now = null as Moment | null;
  for (const m of marks) {
    if (m.t_us > t_us) break;
    const step = step_of(m);
    if (m.code === 'anchor.done' && now !== null) now = { ...now, reached: [...now.reached, m.text] };
    if (!step) continue;
    const anew: Moment | null = step === 'take_off' && now?.step !== 'take_off' ? null : now;
    now = {
      step,
      reason: m.text,
      since_us: m.t_us,
      started_us: anew?.started_us ?? m.t_us,
      iteration: (anew?.iteration ?? 0) + Number(step === 'find_next_point' && anew?.step === 'ranging'),
      reached: anew?.reached ?? [],
    };
  }
  return now;
}

/// Where to measure next, as it was last decided on this way: to a better point, or enough here. Null where the way was not decided by that.
export function decision_at(marks: readonly Mark[], t_us: number): Mark | null {
  let decided: Mark | null = null,
    before: Step | null = null;
  for (const m of marks) {
    if (m.t_us > t_us) break;
    const step = step_of(m);
    if (!step) continue;
    if (before === 'find_next_point' && step !== 'hold') decided = m;
    else if (step === 'take_off' || step === 'return_home') decided = null;
    before = step;
  }
  return decided;
}

const ELSEWHERE: readonly Step[] = ['take_off', 'hold', 'return_home', 'landing', 'done'];
/// Where the aircraft was sent to or stood at, and where it had measured by then; of the last take-off before the moment.
export function places_at(
  marks: readonly Mark[],
  t_us: number,
): { readonly target: Mark['place']; readonly measured: readonly NonNullable<Mark['place']>[] } {
  let target: Mark['place'] = null,
    measured: NonNullable<Mark['place']>[] = [];
  for (const m of marks) {
    if (m.t_us > t_us) break;
    const step = step_of(m);
    if (step === 'ranging' && target && !measured.includes(target)) measured.push(target);
    if (step === 'take_off') measured = [];
    if (m.place) target = m.place;
    else if (step && ELSEWHERE.includes(step)) target = null;
  }
  return { target, measured };
}

const PRIORITY: Readonly<Record<string, Priority>> = { critical: 'critical', warning: 'warning' };
/// Newest last, their `since_ms` by the clock of the flight. "alarm.raised" says "id: what is wrong", "alarm.cleared" "id is over".
export function alarms_at(marks: readonly Mark[], t_us: number): Alarm[] {
  const standing = new Map<string, Alarm>();
  for (const m of marks) {
    if (m.t_us > t_us) break;
    if (m.code === 'alarm.raised') {
      const [id = '', ...words] = m.text.split(': ');
      standing.set(id, {
        id,
        priority: PRIORITY[m.level] ?? 'advisory',
        title: words.join(': ') || id,
        advice: '',
        since_ms: m.t_us / 1000,
        acknowledged: false,
      });
    } else if (m.code === 'alarm.cleared') standing.delete(m.text.replace(/ is over$/, ''));
  }
  return [...standing.values()];
}

export const status_of = (step: Step): ProcedureMsg['status'] =>
  step === 'hold'
    ? 'hold'
    : step === 'return_home'
      ? 'return'
      : step === 'landing'
        ? 'landing'
        : step === 'ready'
          ? 'ready'
          : step === 'done'
            ? 'done'
            : 'running';
