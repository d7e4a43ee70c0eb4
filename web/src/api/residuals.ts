/// What every range says against an answer, and answers against each other. Bearings come from the track that was flown.
import { vec3, type Vec3 } from '../live/messages';
import { enu_from_geodetic } from '../map/enu';
import type { AnchorRow } from './anchors';
import { get, given, list, type Wire } from './contract';

/// A row of the contract that has a residual, and where it came from.
export interface Residual extends Omit<ResidualRow, 'network_id'> {
  readonly distance_m: number;
  readonly residual_m: number;
  readonly weight: number;
  readonly bearing_deg: number | null;
}
export type Solve = Wire<'CalibrationSummary'>;
export const solves = (): Promise<Solve[]> => list('/calibrations', { query: { limit: 100 } });

/// Where the track was at an instant: between the two fixes around it, null beyond a second of one.
export interface Way {
  readonly t_us: readonly number[];
  readonly at_m: readonly Vec3[];
}
export function at_instant({ t_us, at_m }: Way, t: number): Vec3 | null {
  let lo = 0,
    hi = t_us.length;
  while (lo < hi) {
    const mid = (lo + hi) >> 1;
    if (t_us[mid]! < t) lo = mid + 1;
    else hi = mid;
  }
  const [a, b] = [lo - 1, lo],
    near = (i: number): boolean => i >= 0 && i < t_us.length && Math.abs(t_us[i]! - t) <= 1e6;
  if (t_us[b] === t) return at_m[b]!;
  if (!near(a) || !near(b)) return near(a) ? at_m[a]! : near(b) ? at_m[b]! : null;
  const share = (t - t_us[a]!) / (t_us[b]! - t_us[a]!),
    p = at_m[a]!,
    q = at_m[b]!;
  return [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), p[2] + share * (q[2] - p[2])];
}
/// Degrees clockwise from north (the y axis), from the anchor to the tag.
export const bearing_from = (anchor: Vec3, tag: Vec3): number =>
  ((Math.atan2(tag[0] - anchor[0], tag[1] - anchor[1]) * 180) / Math.PI + 360) % 360;

type Place = Pick<AnchorRow, 'lon' | 'lat' | 'h_m' | 'enu_m'>;
/// The flight's positions about the anchor, east north up on the globe, else in local metres; at most three pages of it.
async function way_of(mission: string, anchor: Place): Promise<{ readonly way: Way; readonly origin_m: Vec3 } | null> {
  const t_us: number[] = [],
    at_m: Vec3[] = [],
    globe = anchor.lon !== null && anchor.lat !== null,
    zero = { lon: anchor.lon ?? 0, lat: anchor.lat ?? 0, h_m: anchor.h_m ?? 0 };
  let cursor: string | null = null,
    local = false;
  for (let page = 0; page < 3; page++) {
    const track: Wire<'Track'> = await get('/missions/{id}/track', {
        path: { id: mission },
        query: given({ limit: 10000, cursor }),
      }),
      { t_us: times = [], local_m } = track.properties;
    local = !!local_m;
    (local_m ?? track.geometry?.coordinates ?? []).forEach((c, i) => {
      const v = vec3(c),
        t = times[i];
      if (v && t !== undefined && (local || globe)) {
        t_us.push(t);
        at_m.push(local ? v : enu_from_geodetic({ lon: v[0], lat: v[1], h_m: v[2] }, zero));
      }
    });
    cursor = track.next_cursor ?? null;
    if (!cursor) break;
  }
  const origin_m: Vec3 | null = local ? anchor.enu_m : [0, 0, 0];
  return t_us.length && origin_m ? { way: { t_us, at_m }, origin_m } : null;
}
type ResidualRow = Awaited<ReturnType<typeof rows_of>>[number];
const rows_of = (solve: string, anchor: string) =>
  list('/calibrations/{id}/residuals', { path: { id: solve }, query: { anchor } });
export async function residuals(solve: string, anchor: Place & Pick<AnchorRow, 'anchor'>): Promise<Residual[]> {
  const rows = await rows_of(solve, anchor.anchor);
  const ways = new Map<string, Awaited<ReturnType<typeof way_of>>>();
  for (const mission of new Set(rows.map((r) => r.mission)))
    ways.set(mission, await way_of(mission, anchor).catch(() => null));
  return rows.flatMap((r) => {
    const { distance_m, residual_m } = r;
    if (distance_m === null || residual_m === null) return [];
    const w = ways.get(r.mission),
      tag = w ? at_instant(w.way, r.t_us) : null,
      bearing_deg = tag && w ? bearing_from(w.origin_m, tag) : null;
    return [{ ...r, distance_m, residual_m, weight: r.weight ?? 0, bearing_deg }];
  });
}

/// Eight directions, each with the share of all weight that comes from it: a position rests on where its weight comes from.
export const SECTORS = ['N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'] as const;
export function weight_by_sector(rows: readonly Residual[]): number[] {
  const out = SECTORS.map(() => 0),
    seen = rows.filter((r) => r.bearing_deg !== null),
    all = seen.reduce((sum, r) => sum + r.weight, 0);
  for (const r of seen) out[Math.round(r.bearing_deg! / 45) % 8]! += r.weight;
  return all > 0 ? out.map((w) => w / all) : out;
}
/// Most suspicious first: rejected ones, then those furthest from what their sigma allows.
export const by_suspicion = (rows: readonly Residual[]): Residual[] =>
  [...rows].sort(
    (a, b) =>
      Number(b.weight === 0) - Number(a.weight === 0) || Math.abs(b.standardised ?? 0) - Math.abs(a.standardised ?? 0),
  );

type DiffRow = Wire<'PositionDiff'>['items'][number];
export type Change = DiffRow['change'];
export interface Shift extends Pick<DiffRow, 'change' | 'horizontal_m' | 'vertical_m' | 'chi2' | 'chi2_limit'> {
  readonly anchor: string;
  readonly delta_m: Vec3 | null;
}
/// `against`: a calibration, the number of a revision, or "published".
export async function shifts(of: string, against: string): Promise<Shift[]> {
  const rows = await list('/calibrations/{id}/diff', { path: { id: of }, query: { against } });
  return rows.map((r) => ({ ...r, anchor: r.network_id, delta_m: vec3(r.delta_enu_m) }));
}
/// All anchors shifted alike are the base, not the anchors: three or more, at least 2 cm, and apart from each other by less than a tenth of it, or than
/// what solving twice differs by (5 cm, where the shift is twice that).
export function common_shift(
  rows: readonly Pick<Shift, 'delta_m'>[],
): { readonly size_m: number; readonly bearing_deg: number } | null {
  const d = rows.flatMap((r) => (r.delta_m ? [r.delta_m] : []));
  if (d.length < 3) return null;
  const [e, n] = [0, 1].map((i) => d.reduce((sum, v) => sum + v[i]!, 0) / d.length) as [number, number],
    size_m = Math.hypot(e, n);
  const spread_m = Math.sqrt(d.reduce((sum, v) => sum + (v[0] - e) ** 2 + (v[1] - n) ** 2, 0) / d.length);
  return size_m > 0.02 && spread_m < Math.max(0.1 * size_m, Math.min(0.05, size_m / 2))
    ? { size_m, bearing_deg: bearing_from([0, 0, 0], [e, n, 0]) }
    : null;
}
