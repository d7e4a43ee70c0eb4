/// What every range says against an answer, and answers against each other. Bearings come from the track that was flown.
import { num, obj, str, vec3, type Vec3 } from '../live/messages';
import { enu_from_geodetic } from '../map/enu';
import { request } from './client';
import { items } from './system';

export interface Residual {
  readonly mission: string;
  readonly t_us: number;
  readonly distance_m: number;
  readonly residual_m: number;
  readonly standardised: number | null;
  readonly weight: number;
  readonly bearing_deg: number | null;
}
export interface Solve {
  readonly id: string;
  readonly created_at: string;
  readonly missions: readonly string[];
  readonly n_anchors: number;
  readonly n_ok: number;
}
export const solves = (): Promise<Solve[]> =>
  items('/calibrations?limit=100', (o) => ({
    id: str(o.id),
    created_at: str(o.created_at),
    missions: Array.isArray(o.missions) ? o.missions.map(str) : [],
    n_anchors: num(o.n_anchors) ?? 0,
    n_ok: num(obj(o.verdicts)?.ok) ?? 0,
  }));

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

/// The flight's positions about the anchor, east north up on the globe, else in local metres; at most three pages of it.
async function way_of(
  mission: string,
  anchor: {
    readonly lon: number | null;
    readonly lat: number | null;
    readonly h_m: number | null;
    readonly enu_m: Vec3 | null;
  },
): Promise<{ readonly way: Way; readonly origin_m: Vec3 } | null> {
  const t_us: number[] = [],
    at_m: Vec3[] = [],
    globe = anchor.lon !== null && anchor.lat !== null,
    zero = { lon: anchor.lon ?? 0, lat: anchor.lat ?? 0, h_m: anchor.h_m ?? 0 };
  let cursor = '',
    local = false;
  for (let page = 0; page < 3; page++) {
    const f = obj(await request('GET', `/missions/${encodeURIComponent(mission)}/track?limit=10000${cursor}`)),
      p = obj(f?.properties),
      times = Array.isArray(p?.t_us) ? p.t_us : [],
      coordinates = obj(f?.geometry)?.coordinates;
    local = Array.isArray(p?.local_m);
    (local ? (p!.local_m as unknown[]) : Array.isArray(coordinates) ? coordinates : []).forEach((c, i) => {
      const v = vec3(c),
        t = num(times[i]);
      if (v && t !== null && (local || globe)) {
        t_us.push(t);
        at_m.push(local ? v : enu_from_geodetic({ lon: v[0], lat: v[1], h_m: v[2] }, zero));
      }
    });
    if (!str(f?.next_cursor)) break;
    cursor = `&cursor=${encodeURIComponent(str(f?.next_cursor))}`;
  }
  const origin_m: Vec3 | null = local ? anchor.enu_m : [0, 0, 0];
  return t_us.length && origin_m ? { way: { t_us, at_m }, origin_m } : null;
}
export async function residuals(
  solve: string,
  anchor: {
    readonly anchor: string;
    readonly lon: number | null;
    readonly lat: number | null;
    readonly h_m: number | null;
    readonly enu_m: Vec3 | null;
  },
): Promise<Residual[]> {
  const rows = await items(
    `/calibrations/${encodeURIComponent(solve)}/residuals?anchor=${encodeURIComponent(anchor.anchor)}`,
    (o) => ({
      mission: str(o.mission),
      t_us: num(o.t_us),
      distance_m: num(o.distance_m),
      residual_m: num(o.residual_m),
      standardised: num(o.standardised),
      weight: num(o.weight) ?? 0,
    }),
  );
  const ways = new Map<string, Awaited<ReturnType<typeof way_of>>>();
  for (const mission of new Set(rows.map((r) => r.mission)))
    ways.set(mission, await way_of(mission, anchor).catch(() => null));
  return rows.flatMap((r) => {
    if (r.t_us === null || r.distance_m === null || r.residual_m === null) return [];
    const w = ways.get(r.mission),
      tag = w ? at_instant(w.way, r.t_us) : null;
    return [
      {
        ...r,
        t_us: r.t_us,
        distance_m: r.distance_m,
        residual_m: r.residual_m,
        bearing_deg: tag && w ? bearing_from(w.origin_m, tag) : null,
      },
    ];
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

export type Change = 'agrees' | 'moved' | 'added' | 'removed' | 'not_comparable';
export interface Shift {
  readonly anchor: string;
  readonly change: Change;
  readonly delta_m: Vec3 | null;
  readonly horizontal_m: number | null;
  readonly vertical_m: number | null;
  readonly chi2: number | null;
  readonly chi2_limit: number | null;
  readonly now_m: Vec3 | null;
}
/// `against`: a calibration, the number of a revision, or "published".
export async function shifts(of: string, against: string): Promise<Shift[]> {
  return items(`/calibrations/${encodeURIComponent(of)}/diff?against=${encodeURIComponent(against)}`, (o) => ({
    anchor: str(o.network_id),
    change: (['agrees', 'moved', 'added', 'removed'] as const).find((c) => c === o.change) ?? 'not_comparable',
    delta_m: vec3(o.delta_enu_m),
    horizontal_m: num(o.horizontal_m),
    vertical_m: num(o.vertical_m),
    chi2: num(o.chi2),
    chi2_limit: num(o.chi2_limit),
    now_m: vec3(obj(o.now)?.enu_m),
  }));
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
