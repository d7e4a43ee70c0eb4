/// What the stream tells of the flight itself: procedure, the planner's last decision, the priors of a turn or a height search. Same rules as messages.ts.
import { num, obj, str, vec3, type Vec3 } from './messages';

export const STEPS = [
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
] as const;
export type Step = (typeof STEPS)[number];
export type FlightStatus = 'ready' | 'running' | 'hold' | 'return' | 'landing' | 'done' | 'aborted';
export type CommandState = 'sent' | 'accepted' | 'refused' | 'unconfirmed';

export interface Spot {
  readonly lon: number;
  readonly lat: number;
  readonly height_m: number | null;
  readonly plan_m: Vec3 | null;
}
export interface CommandMsg {
  readonly number: number;
  readonly action: string;
  readonly state: CommandState;
  readonly text: string;
  readonly by: string;
  readonly t_us: number;
}
export interface AnchorTask {
  readonly anchor: string;
  readonly done: boolean;
  readonly reached: boolean; // its accuracy; done without it: given up, or accepted by a person
  readonly ended_by: string; // the person who accepted it or gave it up; empty: nobody did
  readonly accepted: boolean;
  readonly target_sigma_m: number | null; // its own, or that of the plan
  readonly why: string;
  readonly iterations: number;
  readonly at_edge: boolean;
  readonly no_lobe: boolean;
}
export interface DroneMsg {
  readonly connected: boolean;
  readonly silent_s: number | null;
  readonly gps_fix: number | null;
  readonly mode: string;
  readonly armed: boolean;
  readonly in_air: boolean;
  readonly taken_over: boolean;
  readonly failsafe: boolean;
  readonly battery: number | null;
  readonly above_home_m: number | null;
  readonly text: string;
  readonly autopilot: string;
  readonly peer: string;
  readonly link_signed: boolean;
  readonly frames_refused: number;
  readonly streams_refused: readonly string[];
  readonly others: readonly OtherOnLink[];
}
export interface OtherOnLink {
  readonly sender: string;
  readonly system: number;
  readonly component: number;
  readonly kind: string;
  readonly frames: number;
  readonly silent_s: number | null;
}
export interface ControlMsg {
  readonly holder: string;
  readonly since_us: number;
  readonly expires_us: number;
}
export interface ProcedureMsg {
  readonly mission: string;
  readonly t_us: number;
  readonly plan: string | null;
  readonly plan_name: string;
  readonly plan_revision: number;
  readonly plan_saved_revision: number | null; // newest that was saved since the start; none: null
  readonly plan_undo_revision: number | null; // flown before the last change
  readonly mode: 'auto' | 'manual';
  readonly status: FlightStatus;
  readonly step: Step;
  readonly reason: string;
  readonly in_step_s: number | null;
  readonly step_limit_s: number | null;
  readonly ended: string;
  readonly elapsed_s: number | null;
  readonly target_sigma_m: number | null; // of the position, 1 sigma: an anchor within it is done
  readonly forecast_s: { readonly low: number; readonly high: number } | null;
  readonly waypoint: number;
  readonly n_waypoints: number;
  readonly part: number;
  readonly k: number;
  readonly iteration: number;
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
export interface GridMsg {
  readonly mission: string;
  readonly t_us: number;
  readonly iteration: number;
  readonly rule: string;
  readonly candidates: readonly Candidate[];
  readonly chosen: number | null;
  readonly value_before: number | null;
  readonly predicted: number | null;
  readonly reached: number | null;
  readonly reason: string;
  readonly outcome: string;
  readonly visited_plan_m: readonly Vec3[];
}
/// RSS over heading (degrees) or over height (metres) of one anchor.
export interface ProfileMsg {
  readonly mission: string;
  readonly anchor: string;
  readonly t_us: number;
  readonly running: boolean;
  readonly samples: readonly (readonly [number, number])[];
  readonly best: number | null;
  readonly sigma: number | null;
}

const word = <T extends string>(v: unknown, words: readonly T[], otherwise: T): T =>
  words.includes(v as T) ? (v as T) : otherwise;
const count = (v: unknown): number => num(v) ?? 0;
const list = (v: unknown): Record<string, unknown>[] =>
  Array.isArray(v) ? v.map(obj).filter((o): o is Record<string, unknown> => o !== null) : [];
function spot(o: Record<string, unknown> | null): Spot | null {
  const [lon, lat] = [num(o?.lon), num(o?.lat)];
  return lon === null || lat === null
    ? null
    : { lon, lat, height_m: num(o?.height_above_ground_m), plan_m: vec3(o?.enu_m) };
}

export function drone(v: unknown): DroneMsg | null {
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
      streams_refused: Array.isArray(d.streams_refused)
        ? d.streams_refused.filter((s): s is string => typeof s === 'string')
        : [],
      others: list(d.others).map((o) => ({
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
  const o = obj(v);
  if (!o || !str(o.mission)) return null;
  const target = spot(obj(o.target)),
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
    mode: word(o.mode, ['auto', 'manual'] as const, 'auto'),
    status: word(o.status, ['ready', 'running', 'hold', 'return', 'landing', 'done', 'aborted'] as const, 'ready'),
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
    anchors: list(o.anchors).map((a) => ({
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
    commands: list(o.commands).map((x) => ({
      number: count(x.number),
      action: str(x.action),
      state: word(x.state, ['sent', 'accepted', 'refused', 'unconfirmed'] as const, 'sent'),
      text: str(x.text),
      by: str(x.by),
      t_us: count(x.t_us),
    })),
  };
}
export function grid(v: unknown): GridMsg | null {
  const o = obj(v);
  if (!o || !str(o.mission)) return null;
  const candidates = list(o.candidates).map((c) => {
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
    visited_plan_m: (Array.isArray(o.visited) ? o.visited : []).map(vec3).filter((x): x is Vec3 => x !== null),
  };
}
const profile =
  (best: string, sigma: string) =>
  (v: unknown): ProfileMsg | null => {
    const o = obj(v);
    if (!o || !str(o.mission) || !str(o.anchor)) return null;
    const samples = (Array.isArray(o.samples) ? o.samples : []).flatMap((s): [number, number][] =>
      Array.isArray(s) && num(s[0]) !== null && num(s[1]) !== null ? [[s[0] as number, s[1] as number]] : [],
    );
    return {
      mission: str(o.mission),
      anchor: str(o.anchor),
      t_us: count(o.t_us),
      running: o.running === true,
      samples,
      best: num(o[best]),
      sigma: num(o[sigma]),
    };
  };
export const turn = profile('bearing_deg', 'sigma_deg');
export const height = profile('height_m', 'sigma_m');
