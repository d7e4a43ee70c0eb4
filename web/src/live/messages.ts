/// What the stream carries, and the guards that let it in. A message is `unknown` until a guard here has looked at it; a field that is missing or of
/// the wrong kind becomes null ("unknown"), a message without its key fields is dropped and counted by the caller. Names and kinds are those of
/// api/asyncapi.yaml (`stream`): a guard that reads something else does not compile.
import type { Topic } from './stream';

export type Vec3 = readonly [number, number, number];
export type FixClass = Topic<'drone.pose'>['fix'];
type Estimate = Topic<'anchors.estimates'>;
/// Not on the wire are `accepted` and `moved`, of what is published; `gave_up`, where the procedure ended its work on the anchor without its accuracy;
/// those of a calibration: `withheld`, or `passes` its gates; and where the accuracy goal is known, `within_goal` or `over_goal` (state/done.ts).
export type AnchorStatus =
  Estimate['status'] | 'accepted' | 'moved' | 'gave_up' | 'withheld' | 'passes' | 'within_goal' | 'over_goal';
export type Verdict = Estimate['verdict'];

export type Place = Readonly<Pick<Estimate, 'lon' | 'lat' | 'h_m'>>;
export type Ellipse95 = Readonly<NonNullable<Estimate['ellipse95']>>;

type PoseFields = 'mission' | 't_us' | 'heading_deg' | 'fix' | 'speed_mps';
export interface Pose extends Place, Readonly<Pick<Topic<'drone.pose'>, PoseFields>> {
  readonly enu_m: Vec3 | null;
  readonly tag_enu_m: Vec3 | null;
  readonly sigma_m: Vec3 | null;
}
type RtkFields = 'mission' | 't_us' | 'fix' | 'satellites' | 'correction_age_s';
export interface Rtk extends Readonly<Pick<Topic<'rtk.status'>, RtkFields>> {
  readonly sigma_m: Vec3 | null;
}
export type RangeMsg = Readonly<Omit<Topic<'ranges'>, 'tag_enu_m' | 'residual_m' | 'models'>>;
export interface Mirror extends Place {
  readonly enu_m: Vec3 | null;
  readonly probability: number | null;
}
/// One acceptance test of the server: its number against its limit.
export interface GateMsg extends Readonly<Omit<Estimate['gates'][number], 'limit'>> {
  readonly limit: number | null;
}
type Shaped = 'status' | 'enu_m' | 'cov_enu_m2' | 'ellipse95' | 'mirror' | 'gates';
export interface EstimateMsg extends Readonly<Omit<Estimate, Shaped | 'models_moved_m'>> {
  readonly status: AnchorStatus;
  readonly enu_m: Vec3 | null;
  readonly cov_enu_m2: readonly number[] | null; ///< ee, en, eu, nn, nu, uu
  readonly ellipse95: Ellipse95 | null;
  readonly mirror: Mirror | null;
  readonly gates: readonly GateMsg[]; ///< what the server held it against, the accuracy goal last
}
type State = Topic<'mission.state'>;
export interface MissionMsg extends Readonly<Omit<State, 'origin' | 'range_rate_hz' | 'fixes_refused'>> {
  readonly origin: Readonly<NonNullable<State['origin']>> | null;
  readonly range_rate_hz: number | null;
  readonly fixes_refused: Readonly<State['fixes_refused']>; ///< by reason
}
export interface DeviceMsg extends Readonly<Pick<Topic<'devices'>, 'kind' | 'state' | 'last_seen_us'>> {
  readonly network_id: string;
  readonly rate_hz: number | null;
}
type Counted = 'queue_depth' | 'db_bytes' | 'disk_free_bytes' | 'ws_clients';
export type SystemMsg = Readonly<Omit<Topic<'system'>, Counted>> & { readonly [K in Counted]: number | null };
export type EventMsg = Readonly<Topic<'events'>>;
export type AlarmMsg = Readonly<Omit<Topic<'alarms'>, 'mission'>> & { readonly mission: string | null }; ///< null: of the whole server
export type RevisionMsg = Readonly<Topic<'revisions'>>;

type Obj = Record<string, unknown>;
/// What the contract says of a message or an answer, until a guard has looked: a server of another version may leave any of it out. A member that the
/// contract does not have, or has as something else than the guard reads, does not compile.
export type Unchecked<T> =
  | (T extends readonly (infer E)[]
      ? readonly Unchecked<E>[]
      : T extends object
        ? { readonly [K in keyof T]?: Unchecked<T[K]> }
        : T)
  | null
  | undefined;
/// What a guard may be given: its own kind in the words of the contract, or something that no contract speaks of.
type Given<T, V> = unknown extends V ? unknown : T | null | undefined;

export const obj = <V>(v: V): (unknown extends V ? Obj : Extract<V, object>) | null =>
  (typeof v === 'object' && v !== null && !Array.isArray(v) ? v : null) as ReturnType<typeof obj<V>>;
export const num = <V>(v: V & Given<number, V>): number | null =>
  typeof v === 'number' && Number.isFinite(v) ? v : null;
export const str = <V>(v: V & Given<string, V>): string => (typeof v === 'string' ? v : '');
export const count = <V>(v: V & Given<number, V>): number => num<unknown>(v) ?? 0;
export const word = <T extends string>(v: string | null | undefined, words: readonly T[], otherwise: T): T =>
  words.includes(v as T) ? (v as T) : otherwise;
/// A list, empty where there is none: its elements as the contract has them, which Array.isArray would forget.
export const elements = <E>(v: readonly E[] | null | undefined): readonly E[] =>
  Array.isArray(v) ? (v as readonly E[]) : [];
export const objects = <E>(v: readonly E[] | null | undefined): Extract<E, object>[] =>
  elements(v).flatMap((e) => (obj(e) ? [e as Extract<E, object>] : []));
export const texts = (v: Unchecked<readonly string[]>): string[] =>
  elements(v).filter((s): s is string => typeof s === 'string');

export const fix_class = (v: string | null | undefined): FixClass => word(v, FIX, 'none');
type Numbers = readonly (number | null | undefined)[];
export function vec3<V>(v: V & Given<Numbers, V>): Vec3 | null {
  if (!Array.isArray(v) || v.length !== 3) return null;
  const [a, b, c] = v.map(num<unknown>);
  return a == null || b == null || c == null ? null : [a, b, c];
}
export function cov6(v: Numbers | null | undefined): readonly number[] | null {
  return Array.isArray(v) && v.length === 6 && v.every((x) => num<unknown>(x) !== null) ? (v as number[]) : null;
}
export function ellipse(v: Unchecked<Ellipse95>): Ellipse95 | null {
  const o = obj(v);
  const [major_m, minor_m, azimuth_deg] = [num(o?.major_m), num(o?.minor_m), num(o?.azimuth_deg)];
  return major_m == null || minor_m == null || azimuth_deg == null ? null : { major_m, minor_m, azimuth_deg };
}
/// All words of an enum of the contract: one that is missing here does not compile.
export const words_of =
  <T extends string>() =>
  <const W extends readonly T[]>(...all: Exclude<T, W[number]> extends never ? W : never): W =>
    all;
const FIX = words_of<FixClass>()('none', 'single', 'dgps', 'float', 'fixed');
export const STATUS = words_of<Estimate['status'] | 'accepted' | 'moved'>()(
  'found',
  'estimating',
  'converged',
  'ambiguous',
  'accepted',
  'moved',
);
export const VERDICT = words_of<Verdict>()('ok', 'weak_geometry', 'ambiguous', 'too_few', 'diverged');
const MISSION_STATE = words_of<State['state']>()('planned', 'recording', 'finished'),
  FRAME = words_of<State['frame']>()('wgs84', 'local'),
  DEVICE_STATE = words_of<DeviceMsg['state']>()('live', 'late', 'lost'),
  LEVEL = words_of<EventMsg['level']>()('info', 'warning', 'critical'),
  PRIORITY = words_of<AlarmMsg['priority']>()('critical', 'warning', 'advisory');

/// What came as a message of the topic; null where it is no object.
export const unchecked = <T>(v: unknown): Extract<Unchecked<T>, object> | null =>
  obj(v) as Extract<Unchecked<T>, object> | null;
const place = (o: Exclude<Unchecked<Place>, null | undefined>): Place => ({
  lon: num(o.lon),
  lat: num(o.lat),
  h_m: num(o.h_m),
});

export function pose(v: unknown): Pose | null {
  const o = unchecked<Topic<'drone.pose'>>(v);
  const t_us = num(o?.t_us);
  if (!o || t_us == null) return null;
  return {
    mission: str(o.mission),
    t_us,
    ...place(o),
    enu_m: vec3(o.enu_m),
    tag_enu_m: vec3(o.tag_enu_m),
    heading_deg: num(o.heading_deg),
    fix: fix_class(o.fix),
    sigma_m: vec3(o.sigma_m),
    speed_mps: num(o.speed_mps),
  };
}
export function rtk(v: unknown): Rtk | null {
  const o = unchecked<Topic<'rtk.status'>>(v);
  const t_us = num(o?.t_us);
  if (!o || t_us == null) return null;
  return {
    mission: str(o.mission),
    t_us,
    fix: fix_class(o.fix),
    satellites: num(o.satellites),
    correction_age_s: num(o.correction_age_s),
    sigma_m: vec3(o.sigma_m),
  };
}
export function range(v: unknown): RangeMsg | null {
  const o = unchecked<Topic<'ranges'>>(v);
  const [t_us, distance_m] = [num(o?.t_us), num(o?.distance_m)];
  if (!o || t_us == null || distance_m == null || !str(o.anchor)) return null;
  return {
    t_us,
    mission: str(o.mission),
    tag: str(o.tag),
    anchor: str(o.anchor),
    distance_m,
    corrected_m: num(o.corrected_m) ?? distance_m,
    sigma_m: num(o.sigma_m),
    rss_dbm: num(o.rss_dbm),
    p_los: num(o.p_los),
    used: o.used === true,
    refused: str(o.refused) || null,
  };
}
export function mirror(v: Unchecked<Estimate['mirror']>): Mirror | null {
  const o = obj(v);
  return o && { ...place(o), enu_m: vec3(o.enu_m), probability: num(o.probability) };
}
export const gates = (v: Unchecked<readonly GateMsg[]>): GateMsg[] =>
  objects(v).flatMap((o) =>
    str(o.name)
      ? [{ name: str(o.name), value: num(o.value), limit: num(o.limit), passed: o.passed === true, why: str(o.why) }]
      : [],
  );
export function estimate(v: unknown): EstimateMsg | null {
  const o = unchecked<Topic<'anchors.estimates'>>(v);
  if (!o || !str(o.anchor)) return null;
  return {
    mission: str(o.mission),
    anchor: str(o.anchor),
    t_us: count(o.t_us),
    status: word(o.status, STATUS, 'estimating'),
    verdict: word(o.verdict, VERDICT, 'too_few'),
    reason: str(o.reason),
    ...place(o),
    enu_m: vec3(o.enu_m),
    cov_enu_m2: cov6(o.cov_enu_m2),
    ellipse95: ellipse(o.ellipse95),
    h95_m: num(o.h95_m),
    v95_m: num(o.v95_m),
    gdop: num(o.gdop),
    gdop_trace: num(o.gdop_trace),
    n_ranges: count(o.n_ranges),
    n_refused: count(o.n_refused),
    rms_residual_m: num(o.rms_residual_m),
    probability: num(o.probability),
    mirror: mirror(o.mirror),
    gates: gates(o.gates),
  };
}
export function mission(v: unknown): MissionMsg | null {
  const o = unchecked<Topic<'mission.state'>>(v);
  if (!o || !str(o.mission)) return null;
  const g = obj(o.origin);
  const [lon, lat, h_m] = [num(g?.lon), num(g?.lat), num(g?.h_m)];
  return {
    mission: str(o.mission),
    name: str(o.name),
    state: word(o.state, MISSION_STATE, 'recording'),
    t_us: count(o.t_us),
    started_us: num(o.started_us),
    frame: word(o.frame, FRAME, 'wgs84'),
    origin: lon == null || lat == null || h_m == null ? null : { lon, lat, h_m },
    n_ranges: count(o.n_ranges),
    n_fixes: count(o.n_fixes),
    anchors_found: count(o.anchors_found),
    anchors_converged: count(o.anchors_converged),
    range_rate_hz: num(o.range_rate_hz),
    fixes_refused: Object.fromEntries(
      Object.entries(obj(o.fixes_refused) ?? {}).map(([reason, n]) => [reason, count(n)]),
    ),
  };
}
export function device(v: unknown): DeviceMsg | null {
  const o = unchecked<Topic<'devices'>>(v);
  return o && str(o.network_id)
    ? {
        network_id: str(o.network_id),
        kind: str(o.kind),
        state: word(o.state, DEVICE_STATE, 'lost'),
        last_seen_us: num(o.last_seen_us),
        rate_hz: num(o.rate_hz),
      }
    : null;
}
export function system(v: unknown): SystemMsg | null {
  const o = unchecked<Topic<'system'>>(v);
  return (
    o && {
      t_us: count(o.t_us),
      recording: o.recording === true,
      queue_depth: num(o.queue_depth),
      db_bytes: num(o.db_bytes),
      disk_free_bytes: num(o.disk_free_bytes),
      ws_clients: num(o.ws_clients),
      synchronous: str(o.synchronous),
    }
  );
}
export function event(v: unknown): EventMsg | null {
  const o = unchecked<Topic<'events'>>(v);
  return (
    o && {
      id: str(o.id),
      t_us: count(o.t_us),
      level: word(o.level, LEVEL, 'info'),
      code: str(o.code),
      text: str(o.text),
      mission: str(o.mission) || null,
    }
  );
}
export function alarm(v: unknown): AlarmMsg | null {
  const o = unchecked<Topic<'alarms'>>(v);
  return o && str(o.id)
    ? {
        id: str(o.id),
        priority: word(o.priority, PRIORITY, 'warning'),
        since_us: count(o.since_us),
        text: str(o.text),
        acknowledged: o.acknowledged === true,
        mission: str(o.mission) || null,
      }
    : null;
}
export function revision(v: unknown): RevisionMsg | null {
  const o = unchecked<Topic<'revisions'>>(v);
  const n = num(o?.revision);
  return o && n != null ? { revision: n, t_us: count(o.t_us), calibration: str(o.calibration) } : null;
}

/// One object or an array of them, through a guard; what does not pass is left out.
export function all<T>(data: unknown, guard: (v: unknown) => T | null): T[] {
  return (Array.isArray(data) ? data : [data]).map(guard).filter((x): x is T => x !== null);
}
