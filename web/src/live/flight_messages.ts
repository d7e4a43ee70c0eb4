/// What the stream tells of the flight itself: procedure, the planner's last decision, the priors of a turn or a height search. Same rules as messages.ts.
import {
  count,
  elements,
  num,
  obj,
  objects,
  unchecked,
  str,
  texts,
  vec3,
  word,
  words_of,
  type Unchecked,
  type Vec3,
} from './messages';
import type { Topic } from './stream';

type Procedure = Topic<'procedure'>;
type Grid = Topic<'mission.grid'>;
type Aircraft = NonNullable<Procedure['drone']>;
type Command = Procedure['commands'][number];
type Task = Procedure['anchors'][number];

export type Step = Procedure['step'];
export type FlightStatus = Procedure['status'];
export type CommandState = Command['state'];
export const STEPS = words_of<Step>()(
  'ready',
  'take_off',
  'go_to_waypoint',
  'search_anchors',
  'move_around',
  'step_to_waypoint',
  'turn',
  'height_search',
  'ranging',
  'find_next_point',
  'go_to_point',
  'check_connections',
  'go_back',
  'hold',
  'return_home',
  'landing',
  'done',
);
const MODE = words_of<Procedure['mode']>()('auto', 'manual'),
  STATUS = words_of<FlightStatus>()('ready', 'running', 'hold', 'return', 'landing', 'done', 'aborted'),
  COMMAND = words_of<CommandState>()('sent', 'accepted', 'refused', 'unconfirmed');

export interface Spot {
  readonly lon: number;
  readonly lat: number;
  readonly height_m: number | null;
  readonly plan_m: Vec3 | null;
}
export type CommandMsg = Readonly<Command>;
export interface AnchorTask extends Readonly<Pick<Task, 'done' | 'why' | 'iterations'>> {
  readonly anchor: string;
  readonly reached: boolean; // its accuracy; done without it: given up, or accepted by a person
  readonly ended_by: string; // the person who accepted it or gave it up; empty: nobody did
  readonly accepted: boolean;
  readonly target_sigma_m: number | null; // its own, or that of the plan
  readonly at_edge: boolean;
  readonly no_lobe: boolean;
}
export interface DroneMsg extends Readonly<Omit<Aircraft, Unread | 'streams_refused' | 'others' | 'gps_fix'>> {
  readonly gps_fix: number | null;
  readonly streams_refused: readonly string[];
  readonly others: readonly OtherOnLink[];
}
/// Of the aircraft, what the page does not show.
type Unread =
  | 'lon'
  | 'lat'
  | 'heading_deg'
  | 'speed_mps'
  | 'battery_v'
  | 'battery_age_s'
  | 'position_age_s'
  | 'stale'
  | 'ready_to_arm'
  | 'not_ready';
export interface OtherOnLink extends Readonly<
  Pick<Aircraft['others'][number], 'sender' | 'system' | 'component' | 'frames'>
> {
  readonly kind: string;
  readonly silent_s: number | null;
}
export type ControlMsg = Readonly<NonNullable<Procedure['control']>>;
type ProcedureFields =
  | 'mission'
  | 't_us'
  | 'plan'
  | 'plan_name'
  | 'plan_revision'
  | 'mode'
  | 'status'
  | 'step'
  | 'reason'
  | 'waypoint'
  | 'n_waypoints'
  | 'iteration';
export interface ProcedureMsg extends Readonly<Pick<Procedure, ProcedureFields>> {
  readonly plan_saved_revision: number | null; // newest that was saved since the start; none: null
  readonly plan_undo_revision: number | null; // flown before the last change
  readonly in_step_s: number | null;
  readonly step_limit_s: number | null;
  readonly ended: string;
  readonly elapsed_s: number | null;
  readonly target_sigma_m: number | null; // of the position, 1 sigma: an anchor within it is done
  readonly forecast_s: { readonly low: number; readonly high: number } | null;
  readonly part: number;
  readonly k: number;
  readonly target: (Spot & { readonly heading_deg: number | null }) | null;
  readonly distance_m: number | null;
  readonly anchors: readonly AnchorTask[];
  readonly battery_needed: number | null;
  readonly alarm: { readonly id: string; readonly reaction: string; readonly text: string } | null;
  readonly drone: DroneMsg | null;
  readonly control: ControlMsg | null;
  readonly commands: readonly CommandMsg[];
}
export interface Candidate extends Spot {
  readonly value: number | null;
  readonly p_nlos: number | null;
  readonly refused: string | null;
}
type GridFields =
  'mission' | 't_us' | 'iteration' | 'chosen' | 'value_before' | 'predicted' | 'reached' | 'reason' | 'outcome';
export interface GridMsg extends Readonly<Pick<Grid, GridFields>> {
  readonly rule: string;
  readonly candidates: readonly Candidate[];
  readonly visited_plan_m: readonly Vec3[];
}
/// RSS over heading (degrees) or over height (metres) of one anchor.
export interface ProfileMsg extends Readonly<Pick<Topic<'mission.turn'>, 'mission' | 'anchor' | 't_us' | 'running'>> {
  readonly samples: readonly (readonly [number, number])[];
  readonly best: number | null;
  readonly sigma: number | null;
}

type Point = Grid['candidates'][number];
function spot(v: Unchecked<Pick<Point, 'lon' | 'lat' | 'height_above_ground_m' | 'enu_m'>>): Spot | null {
  const o = obj(v),
    [lon, lat] = [num(o?.lon), num(o?.lat)];
  return lon === null || lat === null
    ? null
    : { lon, lat, height_m: num(o?.height_above_ground_m), plan_m: vec3(o?.enu_m) };
}

export function drone(v: Unchecked<Aircraft>): DroneMsg | null {
  const d = obj(v);
  return (
    d && {
      connected: d.connected === true,
      silent_s: num(d.silent_s),
      mode: str(d.mode),
      armed: d.armed === true,
      in_air: d.in_air === true,
      taken_over: d.taken_over === true,
      failsafe: d.failsafe === true,
      battery: num(d.battery),
      above_home_m: num(d.above_home_m),
      text: str(d.text),
      autopilot: str(d.autopilot),
      gps_fix: num(d.gps_fix),
      peer: str(d.peer),
      link_signed: d.link_signed === true,
      frames_refused: count(d.frames_refused),
      streams_refused: texts(d.streams_refused),
      link_trouble: str(d.link_trouble),
      others: objects(d.others).map((o) => ({
        sender: str(o.sender),
        system: count(o.system),
        component: count(o.component),
        kind: str(o.kind),
        frames: count(o.frames),
        silent_s: num(o.silent_s),
      })),
    }
  );
}
export function procedure(v: unknown): ProcedureMsg | null {
  const o = unchecked<Procedure>(v);
  if (!o || !str(o.mission)) return null;
  const target = spot(o.target),
    alarm = obj(o.alarm),
    forecast = obj(o.forecast_s),
    c = obj(o.control);
  return {
    mission: str(o.mission),
    t_us: count(o.t_us),
    plan: str(o.plan) || null,
    plan_name: str(o.plan_name),
    plan_revision: count(o.plan_revision),
    plan_saved_revision: num(o.plan_saved_revision),
    plan_undo_revision: num(o.plan_undo_revision),
    mode: word(o.mode, MODE, 'auto'),
    status: word(o.status, STATUS, 'ready'),
    step: word(o.step, STEPS, 'ready'),
    reason: str(o.reason),
    in_step_s: num(o.in_step_s),
    step_limit_s: num(o.step_limit_s),
    ended: str(o.ended),
    elapsed_s: num(o.elapsed_s),
    target_sigma_m: num(o.target_sigma_m),
    forecast_s: forecast ? { low: num(forecast.low) ?? 0, high: num(forecast.high) ?? 0 } : null,
    waypoint: count(o.waypoint),
    n_waypoints: count(o.n_waypoints),
    part: count(o.part),
    k: count(o.k),
    iteration: count(o.iteration),
    target: target && { ...target, heading_deg: num(obj(o.target)?.heading_deg) },
    distance_m: num(o.distance_m),
    anchors: objects(o.anchors).map((a) => ({
      anchor: str(a.network_id),
      done: a.done === true,
      reached: a.reached === true,
      ended_by: str(a.ended_by),
      accepted: a.accepted === true,
      target_sigma_m: num(a.target_sigma_m),
      why: str(a.why),
      iterations: count(a.iterations),
      at_edge: a.height_at_edge === true,
      no_lobe: a.no_lobe === true,
    })),
    battery_needed: num(o.battery_needed),
    alarm: alarm && { id: str(alarm.id), reaction: str(alarm.reaction), text: str(alarm.text) },
    drone: drone(o.drone),
    control: c && { holder: str(c.holder), since_us: count(c.since_us), expires_us: count(c.expires_us) },
    commands: objects(o.commands).map((x) => ({
      number: count(x.number),
      action: str(x.action),
      state: word(x.state, COMMAND, 'sent'),
      text: str(x.text),
      by: str(x.by),
      t_us: count(x.t_us),
    })),
  };
}
export function grid(v: unknown): GridMsg | null {
  const o = unchecked<Grid>(v);
  if (!o || !str(o.mission)) return null;
  const candidates = objects(o.candidates).map((c) => {
    const at = spot(c);
    return at && { ...at, value: num(c.value), p_nlos: num(c.p_nlos), refused: str(c.refused) || null };
  });
  const chosen = num(o.chosen);
  return {
    mission: str(o.mission),
    t_us: count(o.t_us),
    iteration: count(o.iteration),
    rule: str(o.rule),
    candidates: candidates.filter((c): c is Candidate => c !== null),
    chosen: candidates.every((c) => c !== null) ? chosen : null,
    value_before: num(o.value_before),
    predicted: num(o.predicted),
    reached: num(o.reached),
    reason: str(o.reason),
    outcome: str(o.outcome),
    visited_plan_m: elements(o.visited)
      .map((at) => vec3(at))
      .filter((x): x is Vec3 => x !== null),
  };
}
type Profile = Topic<'mission.turn'> | Topic<'mission.height'>;
function profile(o: Unchecked<Profile>, best: number | null, sigma: number | null): ProfileMsg | null {
  if (!o || !str(o.mission) || !str(o.anchor)) return null;
  const samples = elements(o.samples).flatMap((s): [number, number][] => {
    const [at, level] = [num(elements(s)[0]), num(elements(s)[1])];
    return at === null || level === null ? [] : [[at, level]];
  });
  return {
    mission: str(o.mission),
    anchor: str(o.anchor),
    t_us: count(o.t_us),
    running: o.running === true,
    samples,
    best,
    sigma,
  };
}
export function turn(v: unknown): ProfileMsg | null {
  const o = unchecked<Topic<'mission.turn'>>(v);
  return profile(o, num(o?.bearing_deg), num(o?.sigma_deg));
}
export function height(v: unknown): ProfileMsg | null {
  const o = unchecked<Topic<'mission.height'>>(v);
  return profile(o, num(o?.height_m), num(o?.sigma_m));
}
