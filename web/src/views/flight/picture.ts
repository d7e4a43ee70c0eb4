/// The plan and the planner's last decision as the map draws them, in metres about the origin of the flight.
import { signal } from '@preact/signals';
import type { Plan } from '../../api/plans';
import type { GridMsg } from '../../live/flight_messages';
import { num, obj } from '../../live/messages';
import { enu_from_geodetic, type Geodetic } from '../../map/enu';
import type { FlightPicture, Heights, Point } from '../../map/flight_layer';
import type { Flown, Scene } from '../../state/scene';
import { current_mission, current_scene } from '../../state/store';

/// The plan that is in the air: fetched once per revision, since only a change that was taken makes it another.
const flown = signal<{ readonly key: string; readonly plan: Flown | null } | null>(null);
export function follow_plan(): void {
  const p = current_scene()?.procedure?.value,
    key = p?.plan ? `${p.plan}/${p.plan_revision}` : '';
  if (!p?.plan || flown.peek()?.key === key) return;
  flown.value = { key, plan: null };
  read_plan(p.mission).then(
    (plan) => {
      flown.value = { key, plan };
    },
    () => undefined,
  );
}
/// How plans are read comes when the first one is: no page needs it before.
async function read_plan(mission: string): Promise<Flown | null> {
  const { flown_plan, setting } = await import('../../api/plans'),
    plan = await flown_plan(mission);
  return plan && { plan, low_m: setting(plan, 'min_height_m'), high_m: setting(plan, 'max_height_m') };
}

/// Six equal steps of value; the smallest is best.
export function ranks(
  candidates: readonly { readonly value: number | null; readonly refused: string | null }[],
): (number | null)[] {
  const good = candidates.flatMap((c) => (c.value === null || c.refused ? [] : [c.value])),
    lo = Math.min(...good),
    span = Math.max(...good) - lo;
  return candidates.map((c) =>
    c.value === null || c.refused ? null : span > 0 ? Math.min(5, Math.floor(((c.value - lo) / span) * 6)) : 0,
  );
}

const made = new WeakMap<GridMsg, FlightPicture>(); // the slow picture is drawn often, a decision comes seldom
export function flight_picture(): FlightPicture | null {
  const origin = current_mission.peek()?.origin;
  return origin ? picture_of(current_scene(), flown.value?.plan ?? null, origin) : null;
}
/// Null before there is a procedure.
export function picture_of(scene: Scene | null, read: Flown | null, origin: Geodetic): FlightPicture | null {
  const p = scene?.procedure?.value,
    grid = scene?.grid?.value ?? null,
    plan = read?.plan;
  if (!p) return null;
  const at = (c: { lon: number; lat: number }): Point => {
    const [e, n] = enu_from_geodetic({ lon: c.lon, lat: c.lat, h_m: origin.h_m }, origin);
    return [e, n];
  };
  const decision = grid && (made.get(grid) ?? remember(grid, at));
  return {
    outline: plan?.outline.map(at) ?? [],
    fence: plan?.fence.map(at) ?? [],
    no_fly: plan?.no_fly.map((a) => a.map(at)) ?? [],
    waypoints: plan?.waypoints.map(at) ?? [],
    reached: Math.max(0, p.waypoint - 1),
    candidates: p.step === 'done' || p.step === 'ready' ? [] : (decision?.candidates ?? []),
    visited: decision?.visited ?? [],
    target: p.target && at(p.target),
    heights: read && heights_of(read, scene, origin.h_m, p.target?.height_m ?? null),
  };
}
/// A plan counts from the ground: of the height its origin says, else where the aircraft took off.
export function ground_of(plan: Plan, scene: Scene | null, origin_h_m: number): number | null {
  const h_m = num(obj(plan.rest.origin)?.h_m),
    pose = scene?.pose?.value.enu_m,
    above_m = scene?.procedure?.value.drone?.above_home_m;
  return h_m !== null ? h_m - origin_h_m : pose && above_m != null ? pose[2] - above_m : lowest(scene);
}
function heights_of(
  { plan, low_m, high_m }: Flown,
  scene: Scene | null,
  origin_h_m: number,
  target_m: number | null,
): Heights {
  return {
    ground_m: ground_of(plan, scene, origin_h_m),
    roof_m: plan.building_height_m,
    low_m,
    high_m,
    waypoints: plan.waypoints.map((w) => w.height_above_ground_m),
    target: target_m,
  };
}
function lowest(scene: Scene | null): number | null {
  const ups = scene?.trail.map((q) => q.u) ?? [];
  return ups.length ? ups.reduce((a, b) => Math.min(a, b)) : null;
}
function remember(grid: GridMsg, at: (c: { lon: number; lat: number }) => Point): FlightPicture {
  const rank = ranks(grid.candidates),
    known = grid.candidates.find((c) => c.plan_m !== null);
  // The planner's own metres are about the plan's origin; one candidate known both ways tells how far apart the two are.
  const shift: Point | null = known ? [at(known)[0] - known.plan_m![0], at(known)[1] - known.plan_m![1]] : null;
  const picture: FlightPicture = {
    outline: [],
    fence: [],
    no_fly: [],
    waypoints: [],
    reached: 0,
    target: null,
    heights: null,
    candidates: grid.candidates.map((c, i) => ({ at: at(c), rank: rank[i]! })),
    visited: shift ? grid.visited_plan_m.map((v): Point => [v[0] + shift[0], v[1] + shift[1]]) : [],
  };
  made.set(grid, picture);
  return picture;
}
