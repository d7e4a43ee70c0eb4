/// The procedure in words. No DOM.
import type { FlightStatus, GridMsg, ProcedureMsg, Step } from '../../live/flight_messages';
import type { DoneCount } from '../../state/done';
import { fixed } from '../../ui/format';
import type { Shape, Tone } from '../../ui/marks';

export const STEP_WORDS: Record<Step, string> = {
  ready: 'On the ground',
  take_off: 'Take off',
  go_to_waypoint: 'Go to waypoint',
  search_anchors: 'Search anchors',
  move_around: 'Move around',
  step_to_waypoint: 'Toward next waypoint',
  turn: '360 turn',
  height_search: 'Search height',
  ranging: 'Ranging',
  find_next_point: 'Find next point',
  go_to_point: 'Fly to next point',
  check_connections: 'Reachability',
  go_back: 'Go back',
  hold: 'Hold',
  return_home: 'Return',
  landing: 'Land',
  done: 'Landed',
};
/// The eleven stages of the track, in the order in which a flight sees them.
export const TRACK: readonly (readonly Step[])[] = [
  ['ready', 'take_off', 'go_to_waypoint'],
  ['search_anchors'],
  ['move_around'],
  ['step_to_waypoint'],
  ['turn'],
  ['height_search'],
  ['ranging'],
  ['find_next_point'],
  ['go_to_point', 'check_connections', 'go_back'],
  ['return_home'],
  ['landing', 'done'],
];
export const stage_of = (step: Step): number => TRACK.findIndex((steps) => steps.includes(step));
/// What usually comes after; the machine decides.
const NEXT: Partial<Record<Step, Step>> = {
  ready: 'take_off',
  take_off: 'go_to_waypoint',
  go_to_waypoint: 'search_anchors',
  search_anchors: 'ranging',
  move_around: 'search_anchors',
  step_to_waypoint: 'search_anchors',
  turn: 'ranging',
  height_search: 'ranging',
  ranging: 'find_next_point',
  find_next_point: 'go_to_point',
  go_to_point: 'check_connections',
  check_connections: 'ranging',
  go_back: 'find_next_point',
  return_home: 'landing',
  landing: 'done',
};
export const next_step = (step: Step): Step | null => NEXT[step] ?? null;

export const STATUS_LOOK: Record<FlightStatus, readonly [Shape, Tone, string]> = {
  ready: ['ok', 'ok', 'READY'],
  running: ['info', 'info', 'RUNNING'],
  hold: ['caution', 'caution', 'HOLD'],
  return: ['caution', 'caution', 'RETURN'],
  landing: ['caution', 'caution', 'LANDING'],
  done: ['ok', 'ok', 'DONE'],
  aborted: ['bad', 'bad', 'ABORTED'],
};
/// A plan that was flown to its end is done; what it was flown for need not be. Empty where nothing is missing, or the flight is not over.
export function missed_words(status: FlightStatus, { done, gave_up, total }: DoneCount): string {
  if (status !== 'done' || gave_up === 0) return '';
  return done === 0
    ? `The plan is flown, and no anchor reached the accuracy that was wanted: ${gave_up} of ${total} given up.`
    : `The plan is flown, but ${gave_up} of ${total} anchors did not reach the accuracy that was wanted.`;
}
export const flying = (p: ProcedureMsg): boolean =>
  p.status === 'running' || p.status === 'hold' || p.status === 'return' || p.status === 'landing';

/// What a value of the planner is, in the unit in which the server's reasons name it: the root of a variance is a length, the root of a trace is GDOP.
export const grid_measure = (g: Pick<GridMsg, 'rule'>): string =>
  ({ dissertation: 'GDOP', a_optimal: 'Expected error, rms', d_optimal: 'Error ellipsoid, log det' })[g.rule] ??
  'Value';
export function value_words(g: Pick<GridMsg, 'rule'>, v: number | null): string {
  if (v === null || (g.rule !== 'd_optimal' && v < 0)) return '–';
  if (g.rule === 'd_optimal') return fixed(v, 2);
  return g.rule === 'dissertation' ? fixed(Math.sqrt(v), 2) : `${fixed(Math.sqrt(v), 3)} m`;
}
/// What became of the decision: a best candidate that is not flown to is not a chosen one.
export function grid_outcome(g: Pick<GridMsg, 'chosen' | 'outcome'>): {
  readonly shape: Shape;
  readonly tone: Tone;
  readonly word: string;
  readonly why: string;
  readonly flown: boolean;
} {
  const [event, ...rest] = g.outcome.split(': '),
    why = rest.join(': ');
  if (event === 'done_here') return { shape: 'off', tone: 'off', word: 'ENOUGH HERE', why, flown: false };
  if (event === 'no_point' || g.chosen === null)
    return { shape: 'off', tone: 'off', word: 'NO POINT', why: event === 'no_point' ? why : '', flown: false };
  return { shape: 'ok', tone: 'ok', word: 'CHOSEN', why: '', flown: true };
}

const HOLE_DEG = 20;
/// Samples of a turn as lines round the compass, broken where no heading was looked at: a hole closed by a straight line looks measured.
export function turn_runs(samples: readonly (readonly [number, number])[]): (readonly [number, number])[][] {
  const sorted = [...samples].sort((a, b) => a[0] - b[0]),
    first = sorted[0],
    runs: (readonly [number, number])[][] = [];
  if (!first) return runs;
  const round: (readonly [number, number])[] = [...sorted, [first[0] + 360, first[1]]];
  for (const [i, s] of round.entries()) {
    const before = round[i - 1];
    if (!before || s[0] - before[0] > HOLE_DEG) runs.push([s]);
    else runs[runs.length - 1]!.push(s);
  }
  return runs.filter((r) => r.length > 1);
}
