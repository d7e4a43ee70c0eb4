/// What the stream does not tell: flights of an earlier life of the server, from REST. The stream wins wherever both speak.
import { effect } from '@preact/signals';
import { get, list, type Wire } from '../api/contract';
import {
  elements,
  fix_class,
  mission,
  num,
  obj,
  objects,
  str,
  vec3,
  type MissionMsg,
  type Unchecked,
} from '../live/messages';
import type { Topic } from '../live/stream';
import { enu_from_geodetic } from '../map/enu';
import type { TrailPoint } from './scene';
import {
  current_mission,
  events,
  link,
  mission_id,
  mission_list,
  now_ms,
  scene_of,
  synced,
  tick,
  when_back,
} from './store';

const micros = (rfc3339: string | null | undefined): number | null => {
  const ms = Date.parse(str(rfc3339));
  return Number.isNaN(ms) ? null : ms * 1000;
};
export function mission_of_rest(v: Unchecked<Wire<'Mission'>>): MissionMsg | null {
  const o = obj(v),
    created_us = micros(o?.created_at);
  return (
    o &&
    mission({
      mission: o.id,
      name: o.name,
      state: o.state,
      frame: o.frame,
      t_us: micros(o.finished_at) ?? created_us ?? 0,
      started_us: created_us,
      n_ranges: num(o.n_ranges),
      n_fixes: num(o.n_fixes),
    } satisfies Unchecked<Topic<'mission.state'>>)
  );
}
export async function load_missions(): Promise<void> {
  try {
    const items = await list('/missions', { query: { limit: 100 } });
    const known = new Set(mission_list.value.map((m) => m.mission));
    const news = objects(items)
      .map(mission_of_rest)
      .filter((m) => m !== null)
      .filter((m) => !known.has(m.mission));
    for (const m of news) scene_of(m.mission).add_state(m, now_ms());
    if (news.length) mission_list.value = [...mission_list.value, ...news];
    synced.value = true;
  } catch {
    /* what the stream tells will do; asked again when the link is back */
  }
}
/// Estimates of a flight nobody feeds any more: asked for once, when it is looked at and the stream gave none.
async function load_estimates(id: string): Promise<void> {
  try {
    const { live_rows } = await import('../api/anchors'),
      rows = await live_rows(id);
    const scene = scene_of(id);
    for (const r of rows)
      if (!scene.anchors.has(r.anchor))
        scene.add_estimate({ ...r, mission: id, t_us: micros(r.calibrated_at) ?? 0 }, now_ms());
    tick.value++;
  } catch {
    /* no estimates: the view says so */
  }
}
/// The way flown before this page was opened: a reload in the field must not wipe the map. What the stream has told meanwhile stays.
async function load_track(m: MissionMsg): Promise<void> {
  try {
    const feature = await get('/missions/{id}/track', {
      path: { id: m.mission },
      query: { limit: 10_000, since: TRACK_SINCE(m) },
    });
    const scene = scene_of(m.mission),
      news = trail_of(feature, m.origin).filter((p) => !scene.trail[0] || p.t_us < scene.trail[0].t_us);
    scene.add_earlier_trail(news);
    tick.value++;
  } catch {
    /* the trail begins where the page was opened */
  }
}
const TRACK_SINCE = (m: MissionMsg): string => new Date(Math.max(0, m.t_us / 1000 - 480_000)).toISOString(); ///< eight minutes: one page even at 20 Hz
/// GeoJSON of a track as points about the origin of the flight; none where a track on the globe has no origin yet.
export function trail_of(feature: Unchecked<Wire<'Track'>>, origin: MissionMsg['origin']): TrailPoint[] {
  const p = obj(feature?.properties),
    times = elements(p?.t_us),
    fixes = elements(p?.fix);
  const places = Array.isArray(p?.local_m)
    ? elements(p?.local_m).map((c) => vec3(c))
    : origin
      ? elements(obj(feature?.geometry)?.coordinates).map((c) => {
          const v = vec3(c);
          return v && enu_from_geodetic({ lon: v[0], lat: v[1], h_m: v[2] }, origin);
        })
      : [];
  return places.flatMap((at, i) => {
    const t_us = num(times[i]);
    return at && t_us !== null ? [{ t_us, e: at[0], n: at[1], u: at[2], fix: fix_class(fixes[i]) }] : [];
  });
}
export function follow_archive(): void {
  let asked: string | null = null;
  effect(() => {
    const id = mission_id.value;
    if (!id || link.value !== 'live' || !synced.value || asked === id) return;
    asked = id;
    if (scene_of(id).anchors.size === 0) void load_estimates(id);
  });
  let tracked: string | null = null;
  effect(() => {
    const m = current_mission.value; // its origin may come later than its name
    if (!m || link.value !== 'live' || tracked === m.mission || (m.frame === 'wgs84' && !m.origin)) return;
    tracked = m.mission;
    void load_track(m);
  });
  effect(() => {
    if (link.value === 'lost') asked = tracked = null;
  });
  when_back(() => {
    if (!synced.peek()) void load_missions();
  });
  let restored = '';
  effect(() => {
    const id = events.value.filter((e) => ['mission.restored', 'bundle.imported'].includes(e.code)).at(-1)?.id ?? ''; // back, or from another server
    if (id && id !== restored) void load_missions();
    restored = id;
  });
}
