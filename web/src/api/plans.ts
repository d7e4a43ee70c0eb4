/// Plans: what is to be flown. Corners and waypoints in WGS84, as the server keeps them.
import { elements, num, obj, objects, str, texts, vec3, type Unchecked } from '../live/messages';
import { idempotency_key } from './client';
import { call, get, list, url, type Wire } from './contract';
import { LIMITS } from './generated/limits';

export interface Corner {
  readonly lon: number;
  readonly lat: number;
}
type WireWaypoint = Wire<'PlanWaypoint'>;
/// Every field said: what the contract leaves out is its default.
export interface Waypoint extends Corner, Required<Pick<WireWaypoint, 'height_above_ground_m'>> {
  readonly heading_deg: number | null;
  readonly dwell_s: number | null;
  readonly measure: boolean;
  readonly turn: boolean;
  readonly height_search: boolean;
}
/// As stored: what is absent is the server's default.
export type Settings = Readonly<Partial<Wire<'PlanSettings'>>>;
export const SETTINGS = LIMITS.PlanSettings;
/// Settings that are a number, and what they are while the plan says nothing.
export type NumberSetting = {
  [K in keyof typeof SETTINGS]: (typeof SETTINGS)[K] extends { readonly default: number } ? K : never;
}[keyof typeof SETTINGS];
export const setting = (p: Plan, key: NumberSetting): number => p.settings[key] ?? SETTINGS[key].default;
const BUILDING_HEIGHT_M = LIMITS.PlanBody.building_height_m.default;
type PlanBody = Wire<'PlanBody'>;
type Edited =
  | 'id'
  | 'revision'
  | 'name'
  | 'outline'
  | 'no_fly'
  | 'fence'
  | 'building_height_m'
  | 'settings'
  | 'expected_anchors'
  | 'anchor_targets'
  | 'waypoints'
  | 'created_at'
  | 'changed_at';
export interface Plan {
  readonly id: string | null;
  readonly revision: number;
  readonly name: string;
  readonly outline: readonly Corner[];
  readonly no_fly: readonly (readonly Corner[])[];
  readonly fence: readonly Corner[];
  readonly building_height_m: number;
  readonly settings: Settings;
  readonly expected: readonly string[];
  readonly targets: Readonly<Record<string, number>>; ///< sigma in metres of anchors with one of their own
  readonly waypoints: readonly Waypoint[];
  readonly rest: Readonly<Omit<PlanBody, Edited>>; ///< what this page does not edit, kept as it came
}
export type Issue = Pick<Wire<'PlanIssue'>, 'severity' | 'code' | 'pointer' | 'text'>;
/// An anchor assumed in the building: where, about the plan's origin, and what the flight would make of it.
export interface Assumed {
  readonly e: number;
  readonly n: number;
  readonly up: number;
  readonly sigma_m: number;
  readonly gdop: number | null;
}
export interface Check extends Omit<Wire<'PlanCheck'>, 'predicted'> {
  readonly rms_m: number | null;
  readonly worst_m: number | null;
  readonly assumed: readonly Assumed[];
}

export const EMPTY: Plan = {
  id: null,
  revision: 0,
  name: '',
  outline: [],
  no_fly: [],
  fence: [],
  building_height_m: BUILDING_HEIGHT_M,
  settings: {},
  expected: [],
  targets: {},
  waypoints: [],
  rest: {},
};

/// A GeoJSON ring closes itself; the page works with open ones.
function ring_of(polygon: Unchecked<Wire<'GeoPolygon'>>): Corner[] {
  const ring = elements(elements(obj(polygon)?.coordinates)[0]);
  const corners = ring.flatMap((c) => {
    const [lon, lat] = [num(elements(c)[0]), num(elements(c)[1])];
    return lon !== null && lat !== null ? [{ lon, lat }] : [];
  });
  const [first, last] = [corners[0], corners[corners.length - 1]];
  return corners.length > 1 && first!.lon === last!.lon && first!.lat === last!.lat ? corners.slice(0, -1) : corners;
}
export function plan_of(answer: Unchecked<Wire<'Plan'> | Wire<'PlanBody'>>): Plan {
  const o: Unchecked<PlanBody & { links: unknown }> = obj(answer);
  const {
    id,
    revision,
    name,
    outline,
    no_fly,
    fence,
    building_height_m,
    settings,
    expected_anchors,
    anchor_targets,
    waypoints,
    created_at: _made,
    changed_at: _changed,
    links: _links,
    ...rest
  } = o ?? {};
  return {
    id: str(id) || null,
    revision: num(revision) ?? 0,
    name: str(name),
    outline: ring_of(outline),
    no_fly: elements(no_fly).map(ring_of),
    fence: ring_of(fence),
    building_height_m: num(building_height_m) ?? BUILDING_HEIGHT_M,
    settings: (obj(settings) ?? {}) as Settings,
    rest: rest as Plan['rest'],
    expected: texts(expected_anchors),
    targets: Object.fromEntries(
      objects(anchor_targets).flatMap((t) => {
        const sigma_m = num(t.target_sigma_m);
        return sigma_m === null ? [] : [[str(t.network_id), sigma_m]];
      }),
    ),
    waypoints: objects(waypoints).map((w) => ({
      lon: num(w.lon) ?? 0,
      lat: num(w.lat) ?? 0,
      height_above_ground_m: num(w.height_above_ground_m) ?? 0,
      heading_deg: num(w.heading_deg),
      dwell_s: num(w.dwell_s),
      measure: w.measure !== false,
      turn: w.turn === true,
      height_search: w.height_search === true,
    })),
  };
}
const polygon = (corners: readonly Corner[]): Wire<'GeoPolygon'> | null =>
  corners.length < 3 ? null : { type: 'Polygon', coordinates: [[...corners, corners[0]!].map((c) => [c.lon, c.lat])] };
/// What this page does not edit goes back as it came.
export const body_of = (p: Plan): Wire<'PlanWrite'> => ({
  ...p.rest,
  name: p.name || 'Plan',
  outline: polygon(p.outline),
  no_fly: p.no_fly.map(polygon).filter((x) => x !== null),
  fence: polygon(p.fence),
  building_height_m: p.building_height_m,
  settings: p.settings,
  expected_anchors: [...p.expected],
  anchor_targets: Object.entries(p.targets).map(([network_id, target_sigma_m]) => ({ network_id, target_sigma_m })),
  waypoints: [...p.waypoints],
});

const check_of = ({ predicted, ...check }: Wire<'PlanCheck'>): Check => ({
  ...check,
  rms_m: predicted?.rms_m ?? null,
  worst_m: predicted?.worst_m ?? null,
  assumed: (predicted?.anchors ?? []).flatMap(({ enu_m, sigma_m, gdop }) => {
    const at = vec3(enu_m);
    return at ? [{ e: at[0], n: at[1], up: at[2], sigma_m, gdop }] : [];
  }),
});

export const plans = async (): Promise<Plan[]> => objects(await list('/plans', { query: { limit: 100 } })).map(plan_of);
const held = (p: Plan): { readonly path: { readonly id: string }; readonly headers: Record<string, string> } => ({
  path: { id: p.id ?? '' },
  headers: { 'If-Match': `"p-${p.revision}"` },
});
export async function save(p: Plan): Promise<Plan> {
  const body = body_of(p),
    answer = p.id
      ? await call('put', '/plans/{id}', { ...held(p), body })
      : await call('post', '/plans', { body, headers: { 'Idempotency-Key': idempotency_key() } });
  return plan_of(answer.body);
}
export const remove = (p: Plan): Promise<unknown> => call('delete', '/plans/{id}', held(p));
export const read = async (id: string): Promise<Plan> => plan_of(await get('/plans/{id}', { path: { id } }));
/// What a flight flies: the revision it was started with, or that it was changed to in the air.
export const flown_plan = async (mission: string): Promise<Plan> =>
  plan_of((await call('get', '/missions/{id}/plan', { path: { id: mission } })).body.plan);
export type PlanDifference = Wire<'PlanDifference'>;
export const plan_difference = async (mission: string, undo: boolean): Promise<PlanDifference> =>
  (await call('get', '/missions/{id}/plan/change', { path: { id: mission }, query: { undo } })).body;
export const change_flown_plan = async (mission: string, body: Wire<'PlanChangeRequest'>): Promise<PlanDifference> =>
  (
    await call('post', '/missions/{id}/plan', {
      path: { id: mission },
      body,
      headers: { 'Idempotency-Key': idempotency_key() },
    })
  ).body;
export const check = async (id: string): Promise<Check> =>
  check_of((await call('post', '/plans/{id}/validate', { path: { id } })).body);
/// Of what is drawn, stored or not.
export const check_drawn = async (p: Plan): Promise<Check> =>
  check_of((await call('post', '/plans/validate', { body: body_of(p) })).body);
/// Waypoints from the outline alone; nothing is stored.
export async function generate(p: Plan): Promise<{ plan: Plan; check: Check }> {
  const { body } = await call('post', '/plans/generate', { body: body_of(p) });
  return { plan: { ...p, waypoints: plan_of(body.plan).waypoints }, check: check_of(body.check) };
}
export async function import_file(name: string, text: string): Promise<{ plan: Plan; notes: string[] }> {
  const { body } = await call('post', '/plans/import', {
      query: { dry_run: true, name },
      file: {
        type: text.trimStart().startsWith('<') ? 'application/vnd.google-earth.kml+xml' : 'application/json',
        data: text,
      },
    }),
    answer = obj(body),
    looked_at = answer && 'plan' in answer ? answer : null; // one that is stored is the plan itself
  return { plan: plan_of(looked_at?.plan), notes: texts(looked_at?.notes) };
}
export const export_url = (id: string, format: 'plan' | 'geojson'): string =>
  url('/plans/{id}/export', { path: { id }, query: { format } });
