/// The procedure in words. No DOM.
import type { FlightStatus, ProcedureMsg, Step } from '../../live/flight_messages';
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
export const flying = (p: ProcedureMsg): boolean =>
  p.status === 'running' || p.status === 'hold' || p.status === 'return' || p.status === 'landing';
