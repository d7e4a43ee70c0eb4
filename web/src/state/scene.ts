/// What is known of one flight, as mutable data: the stream writes it, the map reads it every frame, the text four times a second. No DOM, no signals.
import type { Plan } from '../api/plans';
import type { GridMsg, ProcedureMsg, ProfileMsg } from '../live/flight_messages';
import type { EstimateMsg, FixClass, MissionMsg, Pose, RangeMsg, Rtk, Vec3 } from '../live/messages';
import { sigma_h, sigma_position } from '../map/enu';

/// A value and when it was measured, by the steady clock of this page (state/measured.ts; of a replayed flight, by the moment that is shown).
export interface Heard<T> {
  readonly value: T;
  readonly at_ms: number;
}
/// What moves on the screen is drawn by when it came.
export interface Came<T> extends Heard<T> {
  readonly came_ms: number;
}
export interface TrailPoint {
  readonly t_us: number;
  readonly e: number;
  readonly n: number;
  readonly u: number;
  readonly fix: FixClass;
}
export interface RangeRow {
  last: RangeMsg;
  at_ms: number;
  readonly recent: { t_us: number; d: number }[];
}
export interface HistoryPoint {
  readonly t_us: number;
  readonly sigma_h_m: number | null;
  readonly sigma_m: number | null; ///< of the position, all three axes
  readonly h95_m: number | null;
  readonly gdop: number | null;
}

const TRAIL_POINTS = 6000;
const TRAIL_STEP_M = 0.1; // below a pixel at any scale a flight is watched at; standing still must not fill the trail
const RECENT_US = 20_000_000; // the 20 s sparkline
const HISTORY_POINTS = 1200;

/// A plan in the air, and the heights between which it flies.
export interface Flown {
  readonly plan: Plan;
  readonly low_m: number;
  readonly high_m: number;
}

export class Scene {
  state: MissionMsg | null = null;
  state_at_ms = -Infinity;
  pose: Came<Pose> | null = null;
  before: Came<Pose> | null = null; ///< for interpolation
  rtk: Heard<Rtk> | null = null;
  trail: TrailPoint[] = [];
  readonly anchors = new Map<string, Heard<EstimateMsg>>();
  readonly history = new Map<string, HistoryPoint[]>();
  readonly ranges = new Map<string, RangeRow>();
  range_at_ms = -Infinity;
  procedure: Heard<ProcedureMsg> | null = null;
  grid: Heard<GridMsg> | null = null;
  flown: Flown | null = null; ///< of a stored flight: what Live asks for
  readonly turns = new Map<string, Heard<ProfileMsg>>();
  readonly heights = new Map<string, Heard<ProfileMsg>>();
  version = 0; ///< grows with every change: what was drawn of it is still right while it stands
  estimates_version = 0; ///< grows with estimates only: the slow picture of the map need not be drawn for a pose
  fix_since_us: number | null = null;

  constructor(readonly id: string) {}

  add_state(m: MissionMsg, at_ms: number): void {
    this.state = m;
    this.state_at_ms = at_ms;
    this.version++;
  }
  add_pose(p: Pose, at_ms: number, came_ms = at_ms): void {
    if (this.pose && p.t_us < this.pose.value.t_us - 5_000_000) this.forget_track(); // the flight began again (a looped replay)
    if (!this.pose || this.pose.value.fix !== p.fix) this.fix_since_us = p.t_us;
    this.before = this.pose;
    this.pose = { value: p, at_ms, came_ms };
    if (p.enu_m) {
      const last = this.trail[this.trail.length - 1];
      if (
        !last ||
        last.fix !== p.fix ||
        Math.hypot(p.enu_m[0] - last.e, p.enu_m[1] - last.n, p.enu_m[2] - last.u) > TRAIL_STEP_M ||
        p.t_us - last.t_us > 2_000_000
      ) {
        this.trail.push({ t_us: p.t_us, e: p.enu_m[0], n: p.enu_m[1], u: p.enu_m[2], fix: p.fix });
        if (this.trail.length > TRAIL_POINTS) this.trail.splice(0, TRAIL_POINTS / 6);
      }
    }
    this.version++;
  }
  add_rtk(r: Rtk, at_ms: number): void {
    this.rtk = { value: r, at_ms };
    this.version++;
  }
  add_range(r: RangeMsg, at_ms: number): void {
    let row = this.ranges.get(r.anchor);
    if (!row) this.ranges.set(r.anchor, (row = { last: r, at_ms, recent: [] }));
    if (r.t_us < row.last.t_us - 5_000_000) row.recent.length = 0;
    else if (r.t_us < row.last.t_us) return; // late by a little: the newer one stays
    row.last = r;
    row.at_ms = at_ms;
    row.recent.push({ t_us: r.t_us, d: r.corrected_m });
    while (row.recent.length > 1 && r.t_us - row.recent[0]!.t_us > RECENT_US) row.recent.shift();
    this.range_at_ms = Math.max(this.range_at_ms, at_ms);
    this.version++;
  }
  add_estimate(e: EstimateMsg, at_ms: number): void {
    this.anchors.set(e.anchor, { value: e, at_ms });
    let h = this.history.get(e.anchor);
    if (!h) this.history.set(e.anchor, (h = []));
    const last = h[h.length - 1];
    if (last && e.t_us < last.t_us - 5_000_000) h.length = 0;
    if (!last || e.t_us > last.t_us) h.push(history_point(e));
    if (h.length > HISTORY_POINTS) h.splice(0, HISTORY_POINTS / 6);
    this.version++;
    this.estimates_version++;
  }
  /// Which anchors are done or given up is part of the slow picture.
  add_procedure(p: ProcedureMsg, at_ms: number): void {
    const tasks = (x: ProcedureMsg | undefined): string =>
      x ? `${x.status} ${x.anchors.map((a) => `${a.anchor}${a.done}${a.reached}${a.accepted}`).join()}` : '';
    if (tasks(p) !== tasks(this.procedure?.value)) this.estimates_version++;
    this.procedure = { value: p, at_ms };
    this.version++;
  }
  /// A new decision is part of the slow picture.
  add_grid(g: GridMsg, at_ms: number): void {
    this.grid = { value: g, at_ms };
    this.version++;
    this.estimates_version++;
  }
  /// Older than all that is there, oldest first; thinned as a live trail is.
  add_earlier_trail(points: readonly TrailPoint[]): void {
    const kept: TrailPoint[] = [];
    for (const p of points) {
      const last = kept[kept.length - 1];
      if (
        !last ||
        last.fix !== p.fix ||
        Math.hypot(p.e - last.e, p.n - last.n, p.u - last.u) > TRAIL_STEP_M ||
        p.t_us - last.t_us > 2_000_000
      )
        kept.push(p);
    }
    this.trail = [...kept, ...this.trail].slice(-TRAIL_POINTS);
    this.version++;
  }
  /// What was estimated before this page was opened, in the order of time.
  add_earlier_estimates(list: readonly EstimateMsg[]): void {
    const earlier = new Map<string, HistoryPoint[]>();
    for (const e of list) {
      const points = earlier.get(e.anchor) ?? [];
      earlier.set(e.anchor, points);
      points.push(history_point(e));
    }
    for (const [anchor, points] of earlier) {
      const known = this.history.get(anchor) ?? [],
        first_us = known[0]?.t_us ?? Infinity;
      this.history.set(anchor, [...points.filter((p) => p.t_us < first_us), ...known].slice(-HISTORY_POINTS));
    }
    this.version++;
  }
  forget_track(): void {
    this.trail = [];
    this.before = null;
    this.version++;
  }
}

const history_point = (e: EstimateMsg): HistoryPoint => ({
  t_us: e.t_us,
  sigma_h_m: sigma_h(e.cov_enu_m2),
  sigma_m: sigma_position(e.cov_enu_m2),
  h95_m: e.h95_m,
  gdop: e.gdop,
});

/// Ranges a second of one row, by measurement time over the last 3 s of it; null with fewer than two.
export function rate_hz(row: RangeRow): number | null {
  const r = row.recent,
    end = r[r.length - 1];
  if (!end) return null;
  let i = r.length - 1;
  while (i > 0 && end.t_us - r[i - 1]!.t_us < 3_000_000) i--;
  const span_s = (end.t_us - r[i]!.t_us) / 1e6;
  return r.length - i < 2 || span_s <= 0 ? null : (r.length - 1 - i) / span_s;
}

export type RangeClass = 'los' | 'nlos' | 'unclear';
/// dashboard.md section 4: unclear is a probability of 0.4 to 0.6, or no model.
export const range_class = (p_los: number | null): RangeClass =>
  p_los === null || (p_los >= 0.4 && p_los <= 0.6) ? 'unclear' : p_los > 0.6 ? 'los' : 'nlos';

/// Drone between its last two poses, drawn one pose late so that it moves evenly; where they are far apart in time or place, it jumps.
export function interpolated(
  scene: Scene,
  now_ms: number,
): { body: Vec3; antenna: Vec3; heading_deg: number | null } | null {
  const [a, b] = [scene.before, scene.pose];
  if (!b?.value.enu_m) return null;
  const body_b = b.value.enu_m,
    antenna_b = b.value.tag_enu_m ?? body_b;
  if (!a?.value.enu_m || b.came_ms - a.came_ms > 1000 || b.came_ms <= a.came_ms)
    return { body: body_b, antenna: antenna_b, heading_deg: b.value.heading_deg };
  const f = Math.min(1, (now_ms - b.came_ms) / (b.came_ms - a.came_ms));
  const mix = (p: Vec3, q: Vec3): Vec3 => [
    p[0] + (q[0] - p[0]) * f,
    p[1] + (q[1] - p[1]) * f,
    p[2] + (q[2] - p[2]) * f,
  ];
  const [ha, hb] = [a.value.heading_deg, b.value.heading_deg];
  const heading_deg = ha === null || hb === null ? hb : ha + (((((hb - ha) % 360) + 540) % 360) - 180) * f;
  return { body: mix(a.value.enu_m, body_b), antenna: mix(a.value.tag_enu_m ?? a.value.enu_m, antenna_b), heading_deg };
}
