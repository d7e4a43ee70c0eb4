/// What positions rest on: sites with the datum, the epoch and the base of their coordinates, lever arms of flights, and what kits have learned.
import { num, obj, str, vec3, type Vec3 } from '../live/messages';
import { exchange, idempotency_key, request } from './client';
import { items } from './system';

export type BaseSource = '' | 'known_point' | 'survey_in' | 'network';
export interface Site {
  readonly id: string;
  readonly name: string;
  readonly frame: string;
  readonly epoch: number | null;
  readonly source: BaseSource;
  readonly sigma_m: number | null;
  readonly origin: { readonly lon: number; readonly lat: number; readonly h_m: number } | null;
}
export interface Flight {
  readonly id: string;
  readonly name: string;
  readonly kit: string;
  readonly site: string;
  readonly track_point: string;
  readonly created_at: string;
  readonly tags: readonly { readonly tag: string; readonly antenna: number; readonly arm_m: Vec3 }[];
}
export interface Kit {
  readonly kit: string;
  readonly n_flights: number;
  readonly lag_s: Valued;
  readonly lever_up_m: Valued;
  readonly bias_m: Valued;
  readonly calibrated: boolean;
}
export interface Valued {
  readonly value: number | null;
  readonly sigma: number | null;
}

export function site_of(o: Record<string, unknown>): Site {
  const crs = obj(o.crs),
    base = obj(crs?.base),
    g = obj(o.origin),
    [lon, lat, h_m] = [num(g?.lon), num(g?.lat), num(g?.h_m)],
    source = str(base?.source);
  return {
    id: str(o.id),
    name: str(o.name),
    frame: str(crs?.frame),
    epoch: num(crs?.epoch),
    source: source === 'known_point' || source === 'survey_in' || source === 'network' ? source : '',
    sigma_m: num(base?.sigma_m),
    origin: lon === null || lat === null || h_m === null ? null : { lon, lat, h_m },
  };
}
export const sites = (): Promise<Site[]> => items('/sites?limit=100', site_of);
export interface Datum {
  readonly frame: string;
  readonly epoch: number | null;
  readonly source: BaseSource;
  readonly sigma_m: number | null;
}
/// Only what is known: an empty field stays unknown, never a guess.
const crs_of = (d: Datum): object => ({
  crs: {
    ...(d.frame ? { frame: d.frame } : {}),
    ...(d.epoch === null ? {} : { epoch: d.epoch }),
    base: { ...(d.source ? { source: d.source } : {}), ...(d.sigma_m === null ? {} : { sigma_m: d.sigma_m }) },
  },
});
export async function change_site(id: string, d: Datum): Promise<void> {
  const { etag } = await exchange('GET', `/sites/${id}`);
  await request('PATCH', `/sites/${id}`, crs_of(d), {
    'If-Match': etag,
    'Content-Type': 'application/merge-patch+json',
  });
}
export const create_site = (name: string, d: Datum): Promise<unknown> =>
  request('POST', '/sites', { name, ...crs_of(d) }, { 'Idempotency-Key': idempotency_key() });

/// The newest flights, newest first.
export const flights = (): Promise<Flight[]> =>
  items('/missions?limit=5', (o) => ({
    id: str(o.id),
    name: str(o.name),
    kit: str(o.kit),
    site: str(o.site),
    track_point: str(o.track_point),
    created_at: str(o.created_at),
    tags: (Array.isArray(o.tags) ? o.tags : []).map(obj).flatMap((t) => {
      const arm_m = vec3(t?.lever_arm_body_m);
      return t && arm_m ? [{ tag: str(t.tag), antenna: num(t.antenna) ?? 0, arm_m }] : [];
    }),
  }));
const valued = (v: unknown): Valued => ({ value: num(obj(v)?.value), sigma: num(obj(v)?.sigma) });
/// What the kit of the newest flight has learned; null where it has learned nothing yet: a profile comes with the first calibration of a kit's flights.
export async function kit_of(list: readonly Flight[]): Promise<Kit | null> {
  const name = list.find((f) => f.kit)?.kit;
  if (!name) return null;
  const solved = (
    await items('/calibrations?limit=50&fields=id,missions', (o) =>
      Array.isArray(o.missions) ? (o.missions as unknown[]) : [],
    )
  ).flat();
  if (!list.some((f) => f.kit === name && solved.includes(f.id))) return null;
  const o = obj(await request('GET', `/devices/${encodeURIComponent(name)}/profile`)),
    next = obj(o?.next_flight),
    bias = obj(o?.bias);
  return (
    o && {
      kit: str(o.kit),
      n_flights: num(o.n_flights) ?? 0,
      lag_s: valued(next?.lag_s),
      lever_up_m: valued(next?.lever_up_m),
      bias_m: valued(next?.bias_m),
      calibrated: bias?.calibrated === true,
    }
  );
}
