/// Anchors as the Anchors view shows them, whether they come from the stream, from a published revision or from a fresh calibration.
import {
  cov6,
  elements,
  ellipse,
  estimate,
  gates as gates_of,
  num,
  obj,
  objects,
  str,
  STATUS,
  vec3,
  word,
  VERDICT,
  type AnchorStatus,
  type EstimateMsg,
  type GateMsg,
  type Mirror,
  type Unchecked,
} from '../live/messages';
import type { Topic } from '../live/stream';
import { ellipse_from_covariance, enu_from_geodetic } from '../map/enu';
import { gate_value } from '../ui/gates';
import { newest_summary } from './calibrations';
import { call, get, given, list, url, type Wire } from './contract';

export type Gate = GateMsg;
/// What the uncertainty of a position comes from: sources and their shares of the covariance, largest first.
export interface Budget {
  readonly shares: readonly { readonly source: string; readonly share: number }[];
  readonly help: string; ///< what would help most, in words
}
/// The limits by which the accuracy of an anchor is assessed, from the server: it has one rule for every place that shows it.
export interface AnchorGoal {
  readonly words: string; ///< which goal it is, with its limits
  readonly reached: boolean;
  readonly limits: readonly Gate[];
}
export interface AnchorRow extends EstimateMsg {
  readonly goal: AnchorGoal | null; ///< null of a running estimate, whose gates have its limits
  readonly acceptable: boolean | null; ///< verdict ok and every gate passed; null where none were run
  readonly contradiction: string; ///< how a later flight contradicts the published place; else empty
  readonly budget: Budget | null;
  readonly override: string; ///< why a person published it although a gate failed
  readonly name: string;
  readonly absolute_h95_m: number | null;
  readonly absolute_v95_m: number | null;
  readonly calibrated_at: string | null;
  readonly revision: number | null;
  readonly crs: string;
  readonly calibration: string | null; ///< that it comes from; null of a running estimate
  readonly building: string;
  readonly floor: string;
  readonly height_msl_m: number | null;
}

export const row_of_estimate = (e: EstimateMsg): AnchorRow => ({
  ...e,
  goal: null,
  name: '',
  absolute_h95_m: null,
  absolute_v95_m: null,
  calibrated_at: null,
  revision: null,
  crs: '',
  acceptable: null,
  contradiction: '',
  budget: null,
  override: '',
  calibration: null,
  building: '',
  floor: '',
  height_msl_m: null,
});

function budget_of(v: Unchecked<Wire<'ErrorBudget'>>): Budget | null {
  const o = obj(v),
    sources = obj(o?.sources);
  if (!o || !sources) return null;
  const shares = Object.entries(sources)
    .map(([source, one]) => ({ source, share: num(obj(one)?.share) ?? 0 }))
    .filter((s) => s.share > 0)
    .sort((a, b) => b.share - a.share);
  return { shares, help: str(o.help_text) };
}
function goal_of(v: Unchecked<Wire<'AnchorGoal'>>): AnchorGoal | null {
  const o = obj(v);
  return o && { words: str(o.words), reached: o.reached === true, limits: gates_of(o.limits) };
}
/// How the position is over its goal; empty within it, and where no goal is known.
export const over_goal_words = (r: AnchorRow): string =>
  r.goal === null || r.goal.reached
    ? ''
    : `over the ${r.goal.words}: ${r.goal.limits
        .filter((g) => !g.passed)
        .map(gate_value)
        .join(', ')}`;
type Lonlat = Readonly<Record<'lon' | 'lat' | 'h_m', number | null>>;
const place_at = (coordinates: Unchecked<readonly number[]>): Lonlat => {
  const c = vec3(coordinates);
  return { lon: c?.[0] ?? null, lat: c?.[1] ?? null, h_m: c?.[2] ?? null };
};
function mirror_of(v: Unchecked<Wire<'Mirror'>>): Mirror | null {
  const o = obj(v);
  return o && { ...place_at(o.coordinates), enu_m: vec3(o.enu_m), probability: num(o.probability) };
}
function crs_words(v: Unchecked<Wire<'Crs'>>): string {
  const o = obj(v),
    base = obj(o?.base);
  if (!o) return '';
  const sigma = num(base?.sigma_m);
  return [
    str(o.frame) || str(o.id),
    num(o.epoch) ? `epoch ${num(o.epoch)}` : '',
    str(base?.source)
      ? `base ${str(base?.source).replaceAll('_', ' ')}${sigma === null ? '' : ` σ ${Math.round(sigma * 1000)} mm`}`
      : '',
  ]
    .filter(Boolean)
    .join(', ');
}

/// An anchor of a calibration has no status: it passes its gates or is withheld, as the report says, and one that passes is green only within its
/// goal. Null: the server's word stands.
function status_of(status: string, verdict: string, acceptable: unknown, goal: AnchorGoal | null): AnchorStatus | null {
  if ((STATUS as readonly string[]).includes(status)) return null;
  if (status === 'contradicted') return 'moved';
  if (verdict === 'ambiguous') return 'ambiguous';
  if (verdict !== 'ok' || acceptable === false) return 'withheld';
  return goal === null ? 'passes' : goal.reached ? 'within_goal' : 'over_goal';
}

/// `properties` of a GeoJSON feature or one anchor of a calibration; `geometry` beside it.
type Described = Partial<Wire<'Anchor'>['properties']> & Partial<Omit<Wire<'AnchorResult'>, 'geometry'>>;
export function row_of(v: Unchecked<Described>, geometry: Unchecked<Wire<'Point'>>): AnchorRow | null {
  const p = obj(v),
    network_id = str(p?.network_id);
  if (!p || !network_id) return null;
  const accuracy = obj(p.accuracy),
    relative = obj(accuracy?.relative),
    absolute = obj(accuracy?.absolute),
    quality = obj(p.quality);
  const cov = cov6(relative?.cov_enu_m2),
    provenance = obj(p.provenance);
  const verdict = str(quality?.verdict) || str(p.verdict);
  const status = str(p.status);
  const contradiction = str(obj(p.contradiction)?.text);
  const base = estimate({
    anchor: network_id,
    mission: str(elements(provenance?.missions)[0]),
    verdict: word(verdict, VERDICT, 'ok'),
    reason: contradiction || str(quality?.reason) || str(p.reason),
    ...place_at(obj(geometry)?.coordinates),
    enu_m: p.enu_m ?? p.local_m,
    cov_enu_m2: relative?.cov_enu_m2,
    h95_m: relative?.h95_m,
    v95_m: relative?.v95_m,
    gdop: quality?.gdop,
    gdop_trace: quality?.gdop_trace,
    n_ranges: quality?.n_ranges,
    n_refused: quality?.n_refused,
    rms_residual_m: quality?.rms_residual_m,
  } satisfies Unchecked<Topic<'anchors.estimates'>>);
  if (!base) return null;
  const other_side = mirror_of(p.mirror),
    goal = goal_of(p.goal);
  return {
    ...base,
    status: status_of(status, verdict, quality?.acceptable, goal) ?? word(status, STATUS, 'found'),
    goal,
    ellipse95: ellipse(relative?.ellipse95) ?? (cov && ellipse_from_covariance(cov)),
    mirror: other_side,
    contradiction,
    budget: budget_of(p.budget),
    probability: other_side?.probability == null ? null : 1 - other_side.probability,
    name: str(p.name),
    absolute_h95_m: num(absolute?.h95_m),
    absolute_v95_m: num(absolute?.v95_m),
    calibrated_at: str(p.calibrated_at) || null,
    revision: num(p.revision),
    crs: crs_words(p.crs),
    gates: gates_of(quality?.gates),
    acceptable: typeof quality?.acceptable === 'boolean' ? quality.acceptable : null,
    override: str(obj(quality?.override)?.reason),
    calibration: str(provenance?.calibration) || null,
    building: str(p.building),
    floor: str(p.floor),
    height_msl_m: num(p.height_orthometric_m),
  };
}
export interface Collected {
  readonly rows: AnchorRow[];
  readonly revision: number | null;
}
export function rows_of_collection(answer: Unchecked<Wire<'AnchorCollection'>>): Collected {
  const rows = objects(obj(answer)?.features).flatMap((f) => {
    const row = row_of(f.properties, f.geometry);
    return row ? [row] : [];
  });
  return {
    rows,
    revision:
      num(obj(answer)?.revision) ??
      rows.reduce<number | null>((r, x) => (x.revision === null ? r : Math.max(r ?? 0, x.revision)), null),
  };
}
/// What the flight itself estimates of its anchors.
export const live_rows = async (mission: string): Promise<readonly AnchorRow[]> =>
  rows_of_collection(await get('/anchors', { query: { view: 'live', mission, limit: 1000 } })).rows;
export const published = async (): Promise<Collected> =>
  rows_of_collection(await get('/anchors', { query: { limit: 1000 } }));
/// Where the table of them is as a file: what a flight estimates, else what is published.
export const anchors_url = (format: 'csv' | 'geojson', live: boolean, mission: string | null): string =>
  url('/anchors', { query: given({ format, view: live ? 'live' : null, mission: live ? mission : null }) });

export interface Calibration {
  readonly id: string;
  readonly created_at: string;
  readonly published: boolean;
  readonly after_landing: boolean; ///< made by the server when the flight had landed
  readonly lever_arm_sigma_m: number | null; ///< how well the arm of its first flight is known, as the accuracies hold it
  readonly rows: readonly AnchorRow[];
}
/// Null: still a job, for whoever waited for it.
export function calibration_of(answer: Unchecked<Wire<'Calibration'>>): Calibration | null {
  const o = obj(answer);
  if (!o || !str(o.id) || !o.anchors) return null;
  return {
    id: str(o.id),
    created_at: str(o.created_at),
    published: elements(o.published).length > 0,
    after_landing: obj(o.settings)?.after_landing === true,
    lever_arm_sigma_m: num(obj(elements(obj(o.provenance)?.flights)[0])?.lever_arm_sigma_m),
    rows: objects(o.anchors).flatMap((a) => {
      const row = row_of(a, a.geometry);
      return row ? [{ ...row, calibration: str(o.id) }] : [];
    }),
  };
}
/// `lever_arm_sigma_m`: how well the arm was measured; null: as the flight declares.
export async function calibrate(
  mission: string,
  key: string,
  lever_arm_sigma_m: number | null = null,
): Promise<Calibration> {
  const { body } = await call('post', '/calibrations', {
      body: given<Wire<'CalibrationCreate'>>({ missions: [mission], lever_arm_sigma_m }),
      headers: { Prefer: 'wait=120', 'Idempotency-Key': key },
    }),
    done = calibration_of(body);
  if (!done) throw new Error('The calibration is still running; try again in a minute.');
  return done;
}
export async function newest_calibration(mission: string): Promise<Calibration | null> {
  const of_it = await newest_summary(mission);
  return of_it ? calibration_of(await get('/calibrations/{id}', { path: { id: of_it.id } })) : null;
}
/// An anchor that fails a gate goes out only with the reason a person gives for it.
export type Override = NonNullable<Wire<'Publish'>['overrides']>[number];
/// The revision's note carries who was left out by a person, and why: 500 characters at most.
export function note_of(note: string, out: readonly (readonly [string, string])[]): string {
  const words = out.map(([id, why]) => `${id}${why.trim() ? ` (${why.trim()})` : ''}`).join(', ');
  return [note.trim(), words && `Left out: ${words}.`].filter(Boolean).join(' ').slice(0, 500);
}
/// `only`: those a person chose; null: all that pass every gate.
export async function publish(
  calibration: string,
  note: string,
  overrides: readonly Override[],
  key: string,
  only: readonly string[] | null = null,
): Promise<number | null> {
  const body = given<Wire<'Publish'>>({
    note,
    anchors: only && [...only],
    overrides: overrides.length ? [...overrides] : null,
  });
  const answer = await call('post', '/calibrations/{id}/publish', {
    path: { id: calibration },
    body,
    headers: { 'Idempotency-Key': key },
  });
  return answer.body.revision;
}

/// Against what is published: where each anchor was, in metres, and whether it moved beyond what both covariances allow.
export type Moved = Wire<'PositionDiff'>['items'][number];
export const moved_since_published = async (calibration: string): Promise<Map<string, Moved>> =>
  new Map((await list('/calibrations/{id}/diff', { path: { id: calibration } })).map((o) => [o.network_id, o]));
export const report_url = (calibration: string): string =>
  url('/calibrations/{id}/report', { path: { id: calibration } });

/// One published position of an anchor, and how far it is from the one before; null where either has no place on the globe.
export interface Past {
  readonly revision: number;
  readonly published_at: string;
  readonly status: string;
  readonly h95_m: number | null;
  readonly v95_m: number | null;
  readonly horizontal_m: number | null;
  readonly vertical_m: number | null;
}
export function past_of(answer: Unchecked<readonly Wire<'Published'>[]>): Past[] {
  const all = objects(answer);
  return all.map((o, i) => {
    const here = place_at(obj(o.geometry)?.coordinates),
      earlier = all[i + 1],
      before = earlier ? place_at(obj(earlier.geometry)?.coordinates) : null,
      relative = obj(obj(o.accuracy)?.relative);
    const known = here.lon !== null && here.lat !== null && before?.lon != null && before.lat !== null;
    const shift = known
      ? enu_from_geodetic(
          { lon: here.lon, lat: here.lat, h_m: here.h_m ?? 0 },
          { lon: before.lon, lat: before.lat, h_m: before.h_m ?? 0 },
        )
      : null;
    return {
      revision: num(o.revision) ?? 0,
      published_at: str(o.published_at),
      status: str(o.verdict),
      h95_m: num(relative?.h95_m),
      v95_m: num(relative?.v95_m),
      horizontal_m: shift && Math.hypot(shift[0], shift[1]),
      vertical_m: shift && shift[2],
    };
  });
}
export const past = async (anchor: string): Promise<Past[]> =>
  past_of(await list('/anchors/{id}/history', { path: { id: anchor } }));
