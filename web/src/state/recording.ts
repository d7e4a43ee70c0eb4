/// A stored flight, and the player that feeds a scene from it as the stream would have. No DOM.
import { get, list, type Wire } from '../api/contract';
import { plan_of, setting, type Plan } from '../api/plans';
import {
  all,
  count,
  elements,
  estimate,
  fix_class,
  num,
  obj,
  str,
  objects,
  vec3,
  type EstimateMsg,
  type MissionMsg,
  type Pose,
  type RangeMsg,
  type Unchecked,
  type Vec3,
} from '../live/messages';
import { grid, height, procedure, turn } from '../live/flight_messages';
import type { Topic } from '../live/stream';
import { enu_from_geodetic, type Geodetic } from '../map/enu';
import { Scene } from './scene';

interface Lonlat {
  readonly lon: number;
  readonly lat: number;
}
export interface Mark {
  readonly t_us: number;
  readonly level: string;
  readonly code: string;
  readonly text: string;
  readonly place: Lonlat | null; ///< where the aircraft is sent by it
}
interface Timed {
  readonly t_us: number;
}
export interface Recording {
  readonly mission: MissionMsg;
  readonly from_us: number;
  readonly to_us: number;
  readonly poses: readonly Pose[];
  readonly ranges: readonly RangeMsg[];
  readonly marks: readonly Mark[];
  readonly cut: boolean;
}

const PAGE = 10_000,
  PAGES_MAX = 60; ///< 600 000 rows of each: three hours at 55 Hz, some 200 MB of the browser; what is longer is played up to there

interface Page<Row> {
  readonly items?: readonly Unchecked<Row>[] | null;
  readonly next_cursor?: string | null;
}
async function pages<Row, T>(
  page: (query: { mission: string; limit: number; cursor?: string }) => Promise<Page<Row> | null>,
  mission: string,
  of: (row: Unchecked<Row>) => T | null,
  read: (n_rows: number) => void,
): Promise<{ rows: T[]; cut: boolean }> {
  const rows: T[] = [];
  let cursor = '';
  for (let i = 0; i < PAGES_MAX; i++) {
    const answer = await page({ mission, limit: PAGE, ...(cursor ? { cursor } : {}) });
    const items = elements(answer?.items);
    for (const o of items) {
      const row = of(o);
      if (row) rows.push(row);
    }
    read(items.length);
    cursor = str(answer?.next_cursor);
    if (!cursor) return { rows, cut: false };
  }
  return { rows, cut: true };
}

/// The first place on the globe is the origin of a flight whose own is not known any more.
export function poses_of(rows: readonly Unchecked<Wire<'Fix'>>[], mission: string, origin: Geodetic | null): Pose[] {
  let zero = origin;
  return objects(rows).flatMap((o) => {
    const t_us = num(o.t_us),
      [lon, lat, h_m] = [num(o.lon), num(o.lat), num(o.h_m)],
      local = vec3(o.local_m),
      c = elements(o.cov_enu_m2).map((v) => num(v));
    if (t_us === null) return [];
    const here = lon !== null && lat !== null ? { lon, lat, h_m: h_m ?? 0 } : null;
    zero ??= here;
    const sigma = (v: number | null | undefined): number => Math.sqrt(Math.max(0, v ?? 0)),
      q = elements(o.q).map((v) => num(v)),
      [x, y, z, w] = q;
    // Body x-axis of the quaternion in ENU: its bearing is the heading.
    const heading_deg =
      x != null && y != null && z != null && w != null
        ? (Math.atan2(1 - 2 * (y * y + z * z), 2 * (x * y + w * z)) * 180) / Math.PI
        : null;
    return [
      {
        mission,
        t_us,
        lon,
        lat,
        h_m,
        enu_m: local ?? (here && zero ? enu_from_geodetic(here, zero) : null),
        tag_enu_m: null,
        heading_deg: heading_deg === null ? null : (heading_deg + 360) % 360,
        fix: fix_class(o.fix),
        sigma_m: c.length === 6 ? ([sigma(c[0]), sigma(c[3]), sigma(c[5])] as const) : null,
        speed_mps: null,
      },
    ];
  });
}
/// Class and correction are what the promoted models make of it now; without one it is as measured.
export const range_of =
  (mission: string) =>
  (row: Unchecked<Wire<'Range'>>): RangeMsg | null => {
    const o = obj(row),
      t_us = num(o?.t_us),
      distance_m = num(o?.distance_m),
      predicted = obj(o?.predicted);
    return !o || t_us === null || distance_m === null
      ? null
      : {
          t_us,
          mission,
          tag: str(o.tag),
          anchor: str(o.anchor),
          distance_m,
          corrected_m: distance_m - (num(predicted?.bias_m) ?? 0),
          sigma_m: null,
          rss_dbm: num(o.rx_dbm) ?? num(o.rss_dbm),
          p_los: num(predicted?.p_los),
          used: true,
          refused: null,
        };
  };

const place_of = (place: unknown): Lonlat | null => {
  const o = obj(place),
    [lon, lat] = [num(o?.lon), num(o?.lat)];
  return lon === null || lat === null ? null : { lon, lat };
};

/// A row, and when the server received it.
export interface Arrival extends Timed {
  readonly received_us: number;
}
const PLAYED_AGAIN_US = 5e6;

/// In the order in which they were received.
export const arrivals_of = (rows: readonly Unchecked<Wire<'Fix'>>[]): Arrival[] =>
  objects(rows)
    .flatMap((row) => {
      const t_us = num(row.t_us),
        received_us = num(row.received_us);
      return t_us === null || received_us === null ? [] : [{ t_us, received_us }];
    })
    .sort((a, b) => a.received_us - b.received_us);

/// When in the flight that was which the server saw at this moment: a flight that is played again, or faster than it was flown, has rows of other times.
export function flight_time(arrivals: readonly Arrival[], at_us: number): number {
  let lo = 0,
    hi = arrivals.length;
  while (lo < hi) {
    const mid = (lo + hi) >> 1;
    if (arrivals[mid]!.received_us <= at_us) lo = mid + 1;
    else hi = mid;
  }
  const row = arrivals[Math.max(0, lo - 1)],
    shift_us = row ? row.t_us - row.received_us : 0;
  return Math.abs(shift_us) < PLAYED_AGAIN_US ? at_us : at_us + shift_us;
}

/// Events within the recording, in the order of the flight: the server gives the newest first.
export const marks_of = (
  events: readonly Unchecked<Wire<'Event'>>[],
  from_us: number,
  to_us: number,
  arrivals: readonly Arrival[] = [],
): Recording['marks'] =>
  objects(events)
    .map((e) => ({
      t_us: flight_time(arrivals, count(e.t_us)),
      level: str(e.level),
      code: str(e.code),
      text: str(e.text),
      place: place_of(e.place),
    }))
    .filter((e) => e.t_us >= from_us && e.t_us <= to_us)
    .sort((a, b) => a.t_us - b.t_us);

/// Where not all is read, it ends where either of the two does: beyond it the other would look like a tag or receiver that fell silent.
export function span_of(
  poses: readonly Timed[],
  ranges: readonly Timed[],
  cut: boolean,
): { from_us: number; to_us: number } {
  const both = [poses, ranges].filter((rows) => rows.length > 0),
    ends = both.map((rows) => rows[rows.length - 1]!.t_us);
  if (!both.length) return { from_us: 0, to_us: 0 };
  return {
    from_us: Math.min(...both.map((rows) => rows[0]!.t_us)),
    to_us: cut ? Math.min(...ends) : Math.max(...ends),
  };
}

/// `read` gets the number of rows that have come so far.
export async function load_recording(mission: MissionMsg, read: (n_rows: number) => void): Promise<Recording> {
  const of = mission.mission;
  let n_rows = 0;
  const more = (n: number): void => read((n_rows += n));
  const [fixes, ranges, events] = await Promise.all([
    pages(
      (query) => get('/fixes', { query }),
      of,
      (row) => row,
      more,
    ),
    pages((query) => get('/ranges', { query: { ...query, predicted: true } }), of, range_of(of), more),
    pages(
      ({ cursor }) =>
        get('/missions/{id}/events', { path: { id: of }, query: { limit: 1000, ...(cursor ? { cursor } : {}) } }),
      of,
      (row) => row,
      () => undefined,
    ).catch(() => ({ rows: [] })),
  ]);
  const by_time = (a: Timed, b: Timed): number => a.t_us - b.t_us,
    poses = poses_of(fixes.rows, mission.mission, mission.origin).sort(by_time),
    cut = fixes.cut || ranges.cut,
    span = span_of(poses, ranges.rows.sort(by_time), cut);
  return {
    mission,
    ...span,
    poses,
    ranges: ranges.rows,
    cut,
    marks: marks_of(events.rows, span.from_us, span.to_us, arrivals_of(fixes.rows)),
  };
}

/// What was estimated when, in the order of time: the server computes it from the stored rows, which takes seconds for a long flight.
export async function estimates_over_time(mission: string): Promise<EstimateMsg[]> {
  // As the stream would have said them.
  const items: readonly Topic<'anchors.estimates'>[] = await list('/missions/{id}/estimates', {
    path: { id: mission },
  });
  return all(items ?? [], estimate).sort((a, b) => a.t_us - b.t_us);
}

/// What the procedure showed at a moment.
export interface Shown extends Timed {
  readonly add: (scene: Scene, at_ms: number) => void;
}
const adding = <T>(read: (v: unknown) => T | null, put: (scene: Scene, value: T, at_ms: number) => void) => {
  return (data: unknown): Shown['add'] | null => {
    const value = read(data);
    return value && ((scene, at_ms) => put(scene, value, at_ms));
  };
};
const SHOWN: Readonly<Record<string, (data: unknown) => Shown['add'] | null>> = {
  plan: adding(
    (data): Plan | null => {
      const o = obj((data as { plan?: unknown } | null)?.plan);
      return o && plan_of(o);
    },
    (scene, plan) => {
      scene.flown = { plan, low_m: setting(plan, 'min_height_m'), high_m: setting(plan, 'max_height_m') };
      scene.estimates_version++;
    },
  ),
  procedure: adding(procedure, (scene, p, at_ms) => scene.add_procedure(p, at_ms)),
  'mission.grid': adding(grid, (scene, g, at_ms) => scene.add_grid(g, at_ms)),
  'mission.turn': adding(turn, (scene, t, at_ms) => scene.turns.set(t.anchor, { value: t, at_ms })),
  'mission.height': adding(height, (scene, h, at_ms) => scene.heights.set(h.anchor, { value: h, at_ms })),
};
export function shown_of(row: Unchecked<Wire<'ProcedureLogEntry'>>): Shown | null {
  const o = obj(row),
    t_us = num(o?.t_us),
    add = SHOWN[str(o?.topic)]?.(o?.data) ?? null;
  return t_us === null || !add ? null : { t_us, add };
}
/// In the order of time; none of a flight that was not flown by this product.
export async function load_procedure(mission: string): Promise<Shown[]> {
  const { rows } = await pages(
    ({ cursor }) =>
      get('/missions/{id}/procedure-log', {
        path: { id: mission },
        query: { limit: 1000, ...(cursor ? { cursor } : {}) },
      }),
    mission,
    shown_of,
    () => undefined,
  );
  return rows;
}

/// First index whose time is above t.
export function after(rows: readonly Timed[], t_us: number): number {
  let [lo, hi] = [0, rows.length];
  while (lo < hi) {
    const mid = (lo + hi) >> 1;
    if (rows[mid]!.t_us <= t_us) lo = mid + 1;
    else hi = mid;
  }
  return lo;
}

/// The event after a moment, or before it; null where there is none. Several of one moment are one step.
export function neighbour<T extends Timed>(marks: readonly T[], t_us: number, by: 1 | -1): T | null {
  const next = after(marks, t_us);
  if (by === 1) return marks[next] ?? null;
  for (let i = next - 1; i >= 0; i--) if (marks[i]!.t_us < t_us) return marks[i]!;
  return null;
}

/// The corners of the box that holds the track; none where no place is known.
export function reach_of(poses: readonly Pick<Pose, 'enu_m'>[]): Vec3[] {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  for (const { enu_m } of poses)
    enu_m?.forEach((v, i) => {
      low[i] = Math.min(low[i]!, v);
      high[i] = Math.max(high[i]!, v);
    });
  if (low[0] === Infinity) return [];
  const [es, ns, us] = [0, 1, 2].map((i) => [low[i]!, high[i]!]) as [number[], number[], number[]];
  return es.flatMap((e) => ns.flatMap((n) => us.map((u): Vec3 => [e, n, u])));
}

const BEFORE_US = 120_000_000; ///< what a jump shows of the past: the trail of the live view
export class Player {
  scene: Scene;
  t_us: number;
  private pose = 0;
  private range = 0;
  private estimate = 0;
  /// Null: not there (yet); positions are then what the scene was given.
  private estimates: readonly EstimateMsg[] | null = null;
  private procedure: readonly Shown[] = [];
  private shown = 0;

  /// What the map fits, so that it stands still while the flight is played, and shows where it was flown from the start.
  readonly reach_m: readonly Vec3[];

  constructor(readonly recording: Recording) {
    this.reach_m = reach_of(recording.poses);
    this.scene = new Scene(recording.mission.mission);
    this.t_us = recording.from_us;
  }
  get of_the_moment(): boolean {
    return this.estimates !== null;
  }
  /// From here on, positions and ellipses are of the moment that is shown.
  learn(estimates: readonly EstimateMsg[], now_ms: number): void {
    this.estimates = estimates;
    this.begin_anew(this.t_us);
    this.to(this.t_us, now_ms);
  }
  /// From here on, what the procedure showed is that of the moment.
  learn_procedure(shown: readonly Shown[], now_ms: number): void {
    this.procedure = shown;
    this.begin_anew(this.t_us);
    this.to(this.t_us, now_ms);
  }
  /// Else its events alone say where it stood.
  get procedure_kept(): boolean {
    return this.procedure.length > 0;
  }
  private begin_anew(at: number): void {
    const { anchors, version } = this.scene;
    this.scene = new Scene(this.recording.mission.mission);
    if (!this.estimates) for (const [id, e] of anchors) this.scene.anchors.set(id, e);
    this.scene.version = version + 1;
    this.pose = after(this.recording.poses, at - BEFORE_US);
    this.range = after(this.recording.ranges, at - BEFORE_US);
    this.shown = 0;
    this.estimate = 0; // all of them up to the moment: the convergence begins with the flight
  }
  /// Onwards by playing, anywhere by a jump. `now_ms` is the page's clock: what is heard now is fresh.
  to(t_us: number, now_ms: number): void {
    const at = Math.max(this.recording.from_us, Math.min(this.recording.to_us, t_us));
    if (at < this.t_us || at - this.t_us > BEFORE_US) this.begin_anew(at);
    this.t_us = at;
    const age_ms = (t: number): number => now_ms - Math.max(0, (at - t) / 1000);
    for (; this.pose < this.recording.poses.length && this.recording.poses[this.pose]!.t_us <= at; this.pose++) {
      const p = this.recording.poses[this.pose]!;
      this.scene.add_pose(p, age_ms(p.t_us));
      this.scene.add_rtk(
        { mission: p.mission, t_us: p.t_us, fix: p.fix, satellites: null, correction_age_s: null, sigma_m: p.sigma_m },
        age_ms(p.t_us),
      );
    }
    for (; this.range < this.recording.ranges.length && this.recording.ranges[this.range]!.t_us <= at; this.range++) {
      const r = this.recording.ranges[this.range]!;
      this.scene.add_range(r, age_ms(r.t_us));
    }
    const { estimates } = this;
    if (estimates)
      for (; this.estimate < estimates.length && estimates[this.estimate]!.t_us <= at; this.estimate++)
        this.scene.add_estimate(estimates[this.estimate]!, age_ms(estimates[this.estimate]!.t_us));
    for (; this.shown < this.procedure.length && this.procedure[this.shown]!.t_us <= at; this.shown++)
      this.procedure[this.shown]!.add(this.scene, age_ms(this.procedure[this.shown]!.t_us));
    this.freshen(at, now_ms);
  }
  /// While it stands still, what was fresh at that moment stays fresh.
  private freshen(at_us: number, now_ms: number): void {
    const age_ms = (t: number): number => now_ms - Math.max(0, (at_us - t) / 1000),
      { pose, rtk, procedure } = this.scene;
    if (procedure) this.scene.procedure = { value: procedure.value, at_ms: age_ms(procedure.value.t_us) };
    if (pose) {
      const at_ms = age_ms(pose.value.t_us);
      this.scene.pose = { value: pose.value, at_ms, came_ms: at_ms };
    }
    if (rtk) this.scene.rtk = { value: rtk.value, at_ms: age_ms(rtk.value.t_us) };
    for (const row of this.scene.ranges.values()) {
      row.at_ms = age_ms(row.last.t_us);
      this.scene.range_at_ms = Math.max(this.scene.range_at_ms, row.at_ms);
    }
    for (const [id, e] of this.scene.anchors)
      this.scene.anchors.set(id, { value: e.value, at_ms: age_ms(e.value.t_us) });
  }
}
