/// What the stream carries, and the guards that let it in. A message is `unknown` until a guard here has looked at it; a field that is missing or of
/// the wrong kind becomes null ("unknown"), a message without its key fields is dropped and counted by the caller.

export type Vec3 = readonly [number, number, number];
export type FixClass = 'none' | 'single' | 'dgps' | 'float' | 'fixed';
/// Not on the wire are `gave_up`, where the procedure ended its work on the anchor without its accuracy, and those of a calibration: `withheld`, or
/// `passes` its gates; and where the accuracy goal is known, `within_goal` or `over_goal` (state/done.ts).
export type AnchorStatus =
  | 'found'
  | 'estimating'
  | 'converged'
  | 'ambiguous'
  | 'accepted'
  | 'moved'
  | 'gave_up'
  | 'withheld'
  | 'passes'
  | 'within_goal'
  | 'over_goal';
export type Verdict = 'ok' | 'weak_geometry' | 'ambiguous' | 'too_few' | 'diverged';

export interface Place {
  readonly lon: number | null;
  readonly lat: number | null;
  readonly h_m: number | null;
}
export interface Ellipse95 {
  readonly major_m: number;
  readonly minor_m: number;
  readonly azimuth_deg: number;
}

export interface Pose extends Place {
  readonly mission: string;
  readonly t_us: number;
  readonly enu_m: Vec3 | null;
  readonly tag_enu_m: Vec3 | null;
  readonly heading_deg: number | null;
  readonly fix: FixClass;
  readonly sigma_m: Vec3 | null;
  readonly speed_mps: number | null;
}
export interface Rtk {
  readonly mission: string;
  readonly t_us: number;
  readonly fix: FixClass;
  readonly satellites: number | null;
  readonly correction_age_s: number | null;
  readonly sigma_m: Vec3 | null;
}
export interface RangeMsg {
  readonly t_us: number;
  readonly mission: string;
  readonly tag: string;
  readonly anchor: string;
  readonly distance_m: number;
  readonly corrected_m: number;
  readonly sigma_m: number | null;
  readonly rss_dbm: number | null;
  readonly p_los: number | null;
  readonly used: boolean;
  readonly refused: string | null;
}
export interface Mirror extends Place {
  readonly enu_m: Vec3 | null;
  readonly probability: number | null;
}
export interface EstimateMsg extends Place {
  readonly mission: string;
  readonly anchor: string;
  readonly t_us: number;
  readonly status: AnchorStatus;
  readonly verdict: Verdict;
  readonly reason: string;
  readonly enu_m: Vec3 | null;
  readonly cov_enu_m2: readonly number[] | null; ///< ee, en, eu, nn, nu, uu
  readonly ellipse95: Ellipse95 | null;
  readonly h95_m: number | null;
  readonly v95_m: number | null;
  readonly gdop: number | null;
  readonly gdop_trace: number | null;
  readonly n_ranges: number;
  readonly n_refused: number;
  readonly rms_residual_m: number | null;
  readonly probability: number | null;
  readonly mirror: Mirror | null;
  readonly gates: readonly GateMsg[]; ///< what the server held it against, the accuracy goal last
}
/// One acceptance test of the server: its number against its limit.
export interface GateMsg {
  readonly name: string;
  readonly value: number | null;
  readonly limit: number | null;
  readonly passed: boolean;
  readonly why: string;
}
export interface MissionMsg {
  readonly mission: string;
  readonly name: string;
  readonly state: 'planned' | 'recording' | 'finished';
  readonly t_us: number;
  readonly started_us: number | null;
  readonly frame: 'wgs84' | 'local';
  readonly origin: { readonly lon: number; readonly lat: number; readonly h_m: number } | null;
  readonly n_ranges: number;
  readonly n_fixes: number;
  readonly anchors_found: number;
  readonly anchors_converged: number;
  readonly range_rate_hz: number | null;
  readonly fixes_refused: Readonly<Record<string, number>>; ///< by reason
}
export interface DeviceMsg {
  readonly network_id: string;
  readonly kind: string;
  readonly state: 'live' | 'late' | 'lost';
  readonly last_seen_us: number | null;
  readonly rate_hz: number | null;
}
export interface SystemMsg {
  readonly t_us: number;
  readonly recording: boolean;
  readonly queue_depth: number | null;
  readonly db_bytes: number | null;
  readonly disk_free_bytes: number | null;
  readonly ws_clients: number | null;
  readonly synchronous: string;
}
export interface EventMsg {
  readonly id: string;
  readonly t_us: number;
  readonly level: 'info' | 'warning' | 'critical';
  readonly code: string;
  readonly text: string;
  readonly mission: string | null;
}
export interface AlarmMsg {
  readonly id: string;
  readonly priority: 'critical' | 'warning' | 'advisory';
  readonly since_us: number;
  readonly text: string;
  readonly acknowledged: boolean;
}
export interface RevisionMsg {
  readonly revision: number;
  readonly t_us: number;
  readonly calibration: string;
}

type Obj = Record<string, unknown>;
export const obj = (v: unknown): Obj | null =>
  typeof v === 'object' && v !== null && !Array.isArray(v) ? (v as Obj) : null;
export const num = (v: unknown): number | null => (typeof v === 'number' && Number.isFinite(v) ? v : null);
export const str = (v: unknown): string => (typeof v === 'string' ? v : '');
const count = (v: unknown): number => num(v) ?? 0;
const word = <T extends string>(v: unknown, words: readonly T[], otherwise: T): T =>
  words.includes(v as T) ? (v as T) : otherwise;

export const fix_class = (v: unknown): FixClass => word(v, FIX, 'none');
export function vec3(v: unknown): Vec3 | null {
  if (!Array.isArray(v) || v.length !== 3) return null;
  const [a, b, c] = v.map(num);
  return a == null || b == null || c == null ? null : [a, b, c];
}
export function cov6(v: unknown): readonly number[] | null {
  return Array.isArray(v) && v.length === 6 && v.every((x) => num(x) !== null) ? (v as number[]) : null;
}
export function ellipse(v: unknown): Ellipse95 | null {
  const o = obj(v);
  const [major_m, minor_m, azimuth_deg] = [num(o?.major_m), num(o?.minor_m), num(o?.azimuth_deg)];
  return major_m == null || minor_m == null || azimuth_deg == null ? null : { major_m, minor_m, azimuth_deg };
}
const place = (o: Obj): Place => ({ lon: num(o.lon), lat: num(o.lat), h_m: num(o.h_m) });
const FIX = ['none', 'single', 'dgps', 'float', 'fixed'] as const;
export const STATUS = ['found', 'estimating', 'converged', 'ambiguous', 'accepted', 'moved'] as const;
export const VERDICT = ['ok', 'weak_geometry', 'ambiguous', 'too_few', 'diverged'] as const;

export function pose(v: unknown): Pose | null {
  const o = obj(v);
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
  const o = obj(v);
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
  const o = obj(v);
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
export function mirror(v: unknown): Mirror | null {
  const o = obj(v);
  return o && { ...place(o), enu_m: vec3(o.enu_m), probability: num(o.probability) };
}
export const gates = (v: unknown): GateMsg[] =>
  (Array.isArray(v) ? v.map(obj) : []).flatMap((o) =>
    o && str(o.name)
      ? [{ name: str(o.name), value: num(o.value), limit: num(o.limit), passed: o.passed === true, why: str(o.why) }]
      : [],
  );
export function estimate(v: unknown): EstimateMsg | null {
  const o = obj(v);
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
  const o = obj(v);
  if (!o || !str(o.mission)) return null;
  const g = obj(o.origin);
  const [lon, lat, h_m] = [num(g?.lon), num(g?.lat), num(g?.h_m)];
  return {
    mission: str(o.mission),
    name: str(o.name),
    state: word(o.state, ['planned', 'recording', 'finished'] as const, 'recording'),
    t_us: count(o.t_us),
    started_us: num(o.started_us),
    frame: word(o.frame, ['wgs84', 'local'] as const, 'wgs84'),
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
  const o = obj(v);
  return o && str(o.network_id)
    ? {
        network_id: str(o.network_id),
        kind: str(o.kind),
        state: word(o.state, ['live', 'late', 'lost'] as const, 'lost'),
        last_seen_us: num(o.last_seen_us),
        rate_hz: num(o.rate_hz),
      }
    : null;
}
export function system(v: unknown): SystemMsg | null {
  const o = obj(v);
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
  const o = obj(v);
  return (
    o && {
      id: str(o.id),
      t_us: count(o.t_us),
      level: word(o.level, ['info', 'warning', 'critical'] as const, 'info'),
      code: str(o.code),
      text: str(o.text),
      mission: str(o.mission) || null,
    }
  );
}
export function alarm(v: unknown): AlarmMsg | null {
  const o = obj(v);
  return o && str(o.id)
    ? {
        id: str(o.id),
        priority: word(o.priority, ['critical', 'warning', 'advisory'] as const, 'warning'),
        since_us: count(o.since_us),
        text: str(o.text),
        acknowledged: o.acknowledged === true,
      }
    : null;
}
export function revision(v: unknown): RevisionMsg | null {
  const o = obj(v);
  const n = num(o?.revision);
  return o && n != null ? { revision: n, t_us: count(o.t_us), calibration: str(o.calibration) } : null;
}

/// One object or an array of them, through a guard; what does not pass is left out.
export function all<T>(data: unknown, guard: (v: unknown) => T | null): T[] {
  return (Array.isArray(data) ? data : [data]).map(guard).filter((x): x is T => x !== null);
}
