/// What is on the ground while a plan is drawn: aircraft or carried rover, its track, the base; and an outline walked with the rover. In metres about
/// the plan's origin. No DOM.
import type { Corner, Plan } from '../../api/plans';
import { setting } from '../../api/plans';
import type { AnchorRow } from '../../api/anchors';
import { num, obj, type EstimateMsg, type FixClass, type MissionMsg, type Vec3 } from '../../live/messages';
import { enu_from_geodetic, type Geodetic } from '../../map/enu';
import type { Content } from '../../map/picture';
import { likelier } from '../../state/done';
import { Scene } from '../../state/scene';
import { ground_of } from '../flight/picture';
import { to_m } from './draft';
import { distance_to_edge, type Point } from './tools';

const FRESH_MS = 2000;
/// Where the rover is, as good as it says.
export interface Rover {
  readonly at: Corner;
  readonly m: Point;
  readonly heading_deg: number | null;
  readonly fix: FixClass;
  readonly sigma_h_m: number | null;
  readonly age_ms: number;
  readonly fresh: boolean;
  readonly flies: boolean; ///< it is an aircraft's
}
/// `lost`: the link is, and what came last is not fresh however short a time ago it came.
export function rover_of(scene: Scene | null, origin: Geodetic, now_ms: number, lost: boolean): Rover | null {
  const pose = scene?.pose;
  if (!pose || pose.value.lon === null || pose.value.lat === null) return null;
  const { lon, lat, heading_deg, fix, sigma_m } = pose.value;
  return {
    at: { lon, lat },
    m: to_m({ lon, lat }, origin),
    heading_deg,
    fix,
    sigma_h_m: sigma_m && Math.hypot(sigma_m[0], sigma_m[1]),
    age_ms: now_ms - pose.at_ms,
    fresh: !lost && now_ms - pose.at_ms < FRESH_MS,
    flies: scene?.procedure?.value.drone?.connected === true,
  };
}
/// Why a corner cannot be set at the rover; empty: it can.
export function no_corner(r: Rover | null): string {
  if (!r) return 'no position of a rover yet';
  if (!r.fresh) return 'the rover is silent';
  return r.fix === 'fixed' || r.fix === 'float' ? '' : 'the rover has no RTK fix: a corner needs FIX or FLOAT';
}

const WALK_STEP_M = 0.25;
/// The way of the rover since a moment, without what had no RTK fix: from the track, which has all of it whatever this page did meanwhile.
export function walked(scene: Scene | null, since_us: number, origin: Geodetic): readonly Point[] {
  const pose = scene?.pose?.value;
  if (!scene || !pose?.enu_m || pose.lon === null || pose.lat === null) return [];
  // Metres of the flight are about its own origin; its last place is known both ways.
  const here = to_m({ lon: pose.lon, lat: pose.lat }, origin),
    shift: Point = [here[0] - pose.enu_m[0], here[1] - pose.enu_m[1]],
    out: Point[] = [];
  for (const q of scene.trail) {
    if (q.t_us < since_us || (q.fix !== 'fixed' && q.fix !== 'float')) continue;
    const m: Point = [q.e + shift[0], q.n + shift[1]],
      last = out[out.length - 1];
    if (!last || Math.hypot(m[0] - last[0], m[1] - last[1]) >= WALK_STEP_M) out.push(m);
  }
  return out;
}
const CORNER_TOLERANCE_M = 0.3; ///< a person with a pole does not walk straighter
/// Corners of a walk round something: of a closed way, those that no straight wall within the tolerance replaces.
export function corners_of_walk(path: readonly Point[], tolerance_m = CORNER_TOLERANCE_M): Point[] {
  if (path.length < 3) return [...path];
  // A ring has no ends: it is cut at the place that is furthest from where the walk began, and at its beginning.
  const away = (i: number): number => Math.hypot(path[i]![0] - path[0]![0], path[i]![1] - path[0]![1]),
    far = path.reduce((best, _, i) => (away(i) > away(best) ? i : best), 0),
    closed = [...path, path[0]!],
    kept = [...thinned(closed.slice(0, far + 1), tolerance_m), ...thinned(closed.slice(far), tolerance_m).slice(1, -1)];
  // Where the walk began may be the middle of a wall.
  const [before, first, after] = [kept[kept.length - 1], kept[0], kept[1]];
  return kept.length > 3 && before && first && after && off_line(first, before, after) <= tolerance_m
    ? kept.slice(1)
    : kept;
}
const off_line = (p: Point, a: Point, b: Point): number => distance_to_edge(p, [a, b]);
/// Douglas and Peucker, 1973.
function thinned(path: readonly Point[], tolerance_m: number): Point[] {
  const [a, b] = [path[0]!, path[path.length - 1]!];
  let worst = 0,
    at = -1;
  for (let i = 1; i < path.length - 1; i++) {
    const d = off_line(path[i]!, a, b);
    if (d > worst) {
      worst = d;
      at = i;
    }
  }
  return worst <= tolerance_m
    ? [a, b]
    : [...thinned(path.slice(0, at + 1), tolerance_m).slice(0, -1), ...thinned(path.slice(at), tolerance_m)];
}

/// The flight that is on, about the plan's origin and its ground; null where the two are too far apart to be of one place.
export interface Around {
  readonly shift: Vec3; ///< to be added to metres of the flight
  readonly ground_h_m: number; ///< above the ellipsoid
}
const APART_M = 2000,
  KNOWN_M = 3; ///< an estimate that is worse says nothing about where to fly
export function around(plan: Plan, origin: Geodetic, mission: MissionMsg | null, scene: Scene | null): Around | null {
  const own = mission?.origin;
  if (!own) return null;
  const [e, n] = enu_from_geodetic({ lon: own.lon, lat: own.lat, h_m: origin.h_m }, origin),
    told = num(obj(plan.rest.origin)?.h_m),
    ground_m = ground_of(plan, scene, own.h_m);
  if (Math.hypot(e, n) > APART_M) return null;
  const ground_h_m = told ?? own.h_m + (ground_m ?? 0);
  return { shift: [e, n, own.h_m - ground_h_m], ground_h_m };
}
const plus = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/// The plan as the side elevation draws it: heights above the ground, with the flight that is on and the anchors whose place is known. `picked`: a waypoint.
export function plan_content(
  plan: Plan,
  origin: Geodetic,
  scene: Scene | null,
  near: Around | null,
  known: ReadonlyMap<string, AnchorRow>,
  flight: { readonly running: boolean; readonly link_lost: boolean },
  picked: number | null,
): Content {
  const shifted = new Scene('plan'),
    at = picked === null ? undefined : plan.waypoints[picked];
  if (scene && near) {
    const d = near.shift,
      moved = (p: NonNullable<Scene['pose']>): NonNullable<Scene['pose']> => ({
        at_ms: p.at_ms,
        came_ms: p.came_ms,
        value: {
          ...p.value,
          enu_m: p.value.enu_m && plus(p.value.enu_m, d),
          tag_enu_m: p.value.tag_enu_m && plus(p.value.tag_enu_m, d),
        },
      });
    shifted.trail = scene.trail.map((q) => ({ ...q, e: q.e + d[0], n: q.n + d[1], u: q.u + d[2] }));
    shifted.pose = scene.pose && moved(scene.pose);
    shifted.before = scene.before && moved(scene.before);
  }
  const anchors = new Map<string, EstimateMsg>();
  for (const r of near ? known.values() : []) {
    if (r.lon === null || r.lat === null || r.h_m === null) continue;
    const [e, n] = enu_from_geodetic({ lon: r.lon, lat: r.lat, h_m: origin.h_m }, origin);
    if (Math.hypot(e, n) > APART_M) continue;
    anchors.set(r.anchor, { ...r, enu_m: [e, n, r.h_m - near!.ground_h_m], mirror: null });
  }
  // What the flight finds is newer than what is published.
  for (const { value } of (near && scene?.anchors.values()) ?? []) {
    const a = likelier(value);
    if (a.enu_m && a.v95_m !== null && a.v95_m < KNOWN_M)
      anchors.set(a.anchor, {
        ...a,
        enu_m: plus(a.enu_m, near!.shift),
        mirror: a.mirror?.enu_m ? { ...a.mirror, enu_m: plus(a.mirror.enu_m, near!.shift) } : null,
      });
  }
  return {
    anchors: [...anchors.values()],
    selected: null,
    scene: shifted,
    ...flight,
    flight: {
      outline: plan.outline.map((c) => to_m(c, origin)),
      fence: [],
      no_fly: [],
      waypoints: plan.waypoints.map((c) => to_m(c, origin)),
      reached: 0,
      candidates: [],
      visited: [],
      target: at === undefined ? null : to_m(at, origin),
      heights: {
        ground_m: 0,
        roof_m: plan.building_height_m,
        low_m: setting(plan, 'min_height_m'),
        high_m: setting(plan, 'max_height_m'),
        waypoints: plan.waypoints.map((w) => w.height_above_ground_m),
        target: at?.height_above_ground_m ?? null,
      },
    },
  };
}
