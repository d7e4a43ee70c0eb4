/// The plan being edited, in metres about its own origin for the map, and every change as a new draft, so that undo is a list. No DOM.
import type { Corner, Plan, Waypoint } from '../../api/plans';
import { num, obj } from '../../live/messages';
import { enu_from_geodetic, geodetic_from_enu, type Geodetic } from '../../map/enu';

export type Shape = 'outline' | 'fence' | 'waypoints' | `no_fly/${number}`;
export interface Picked {
  readonly shape: Shape;
  readonly index: number;
}

/// Middle of what is drawn; `otherwise` while nothing is.
export function origin_of(p: Plan, otherwise: Geodetic | null): Geodetic | null {
  const at: Corner[] = p.outline.length ? [...p.outline] : p.waypoints.length ? [...p.waypoints] : [...p.fence];
  if (!at.length) return otherwise;
  const mean = (f: (c: Corner) => number): number => at.reduce((a, c) => a + f(c), 0) / at.length;
  return { lon: mean((c) => c.lon), lat: mean((c) => c.lat), h_m: 0 };
}
/// Where the server puts the origin of a plan: its own, else the middle of its outline, else of its waypoints.
export function plan_origin(p: Plan): Geodetic | null {
  const own = obj(p.rest.origin),
    [lon, lat] = [num(own?.lon), num(own?.lat)];
  return lon !== null && lat !== null
    ? { lon, lat, h_m: 0 }
    : p.outline.length || p.waypoints.length
      ? origin_of({ ...p, fence: [] }, null)
      : null;
}
export const to_m = (c: Corner, o: Geodetic): [number, number] => {
  const [e, n] = enu_from_geodetic({ lon: c.lon, lat: c.lat, h_m: o.h_m }, o);
  return [e, n];
};
export const from_m = (e: number, n: number, o: Geodetic): Corner => {
  const { lon, lat } = geodetic_from_enu(e, n, o);
  return { lon, lat };
};

export function corners(p: Plan, shape: Shape): readonly Corner[] {
  return shape === 'waypoints'
    ? p.waypoints
    : shape === 'outline'
      ? p.outline
      : shape === 'fence'
        ? p.fence
        : (p.no_fly[Number(shape.slice(7))] ?? []);
}
export function with_corners(p: Plan, shape: Shape, list: readonly Corner[]): Plan {
  if (shape === 'waypoints') return { ...p, waypoints: list as readonly Waypoint[] };
  if (shape === 'outline') return { ...p, outline: list };
  if (shape === 'fence') return { ...p, fence: list };
  const areas = [...p.no_fly];
  areas[Number(shape.slice(7))] = list;
  return { ...p, no_fly: areas.filter((a) => a !== undefined) };
}
export const NEW_WAYPOINT: Omit<Waypoint, 'lon' | 'lat'> = {
  height_above_ground_m: 4,
  heading_deg: null,
  dwell_s: null,
  measure: true,
  turn: false,
  height_search: false,
};

export const added = (p: Plan, shape: Shape, c: Corner): Plan =>
  with_corners(p, shape, [
    ...corners(p, shape),
    shape === 'waypoints' ? { ...(p.waypoints[p.waypoints.length - 1] ?? NEW_WAYPOINT), ...c } : c,
  ]);
export const moved = (p: Plan, at: Picked, c: Corner): Plan =>
  with_corners(
    p,
    at.shape,
    corners(p, at.shape).map((old, i) => (i === at.index ? { ...old, ...c } : old)),
  );
export function removed(p: Plan, at: Picked): Plan {
  const left = corners(p, at.shape).filter((_, i) => i !== at.index);
  if (at.shape.startsWith('no_fly/') && left.length === 0)
    return { ...p, no_fly: p.no_fly.filter((_, i) => i !== Number(at.shape.slice(7))) };
  return with_corners(p, at.shape, left);
}

const UNDO_MAX = 50;
export interface History {
  readonly now: Plan;
  readonly before: readonly Plan[];
  readonly after: readonly Plan[];
}
export const begun = (p: Plan): History => ({ now: p, before: [], after: [] });
export const changed = (h: History, now: Plan): History => ({
  now,
  before: [...h.before, h.now].slice(-UNDO_MAX),
  after: [],
});
export const undone = (h: History): History =>
  h.before.length
    ? { now: h.before[h.before.length - 1]!, before: h.before.slice(0, -1), after: [h.now, ...h.after] }
    : h;
export const redone = (h: History): History =>
  h.after.length ? { now: h.after[0]!, before: [...h.before, h.now], after: h.after.slice(1) } : h;

/// Under which an unsaved plan is kept on this device.
export const draft_key = (id: string | null): string => `plan/${id ?? 'new'}`;
const cornered = (v: unknown): boolean =>
  Array.isArray(v) && v.every((c) => num(obj(c)?.lon) !== null && num(obj(c)?.lat) !== null);
/// A plan that was kept, if it is one.
export function plan_from_draft(kept: unknown): Plan | null {
  const o = obj(kept);
  if (
    !o ||
    (o.id !== null && typeof o.id !== 'string') ||
    o.id === '' ||
    typeof o.name !== 'string' ||
    num(o.revision) === null ||
    num(o.building_height_m) === null ||
    !obj(o.settings) ||
    !obj(o.rest)
  )
    return null;
  const expected = Array.isArray(o.expected) && o.expected.every((a) => typeof a === 'string') ? o.expected : [], // older drafts have none of
    kept_targets = obj(o.targets) ?? {}, // either
    targets = Object.values(kept_targets).every((m) => num(m) !== null) ? kept_targets : {};
  return cornered(o.outline) &&
    cornered(o.fence) &&
    cornered(o.waypoints) &&
    Array.isArray(o.no_fly) &&
    o.no_fly.every(cornered)
    ? ({ ...o, expected, targets } as unknown as Plan)
    : null;
}
