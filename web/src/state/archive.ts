/// What the stream does not tell: flights of an earlier life of the server, from REST. The stream wins wherever both speak.
import { effect } from '@preact/signals';
import { rows_of_collection } from '../api/anchors';
import { request } from '../api/client';
import { mission, num, obj, str, type MissionMsg } from '../live/messages';
import { link, mission_id, mission_list, now_ms, scene_of, synced, tick } from './store';

const micros = (rfc3339: unknown): number | null => {
  const ms = Date.parse(str(rfc3339));
  return Number.isNaN(ms) ? null : ms * 1000;
};
export function mission_of_rest(v: unknown): MissionMsg | null {
  const o = obj(v), created_us = micros(o?.created_at);
  return o && mission({ mission: o.id, name: o.name, state: o.state, frame: o.frame, t_us: micros(o.finished_at) ?? created_us ?? 0, started_us: created_us, n_ranges: num(o.n_ranges), n_fixes: num(o.n_fixes) });
}
export async function load_missions(): Promise<void> {
  try {
    const items = obj(await request('GET', '/missions?limit=100'))?.items;
    const known = new Set(mission_list.value.map((m) => m.mission));
    const news = (Array.isArray(items) ? items : []).map(mission_of_rest).filter((m) => m !== null).filter((m) => !known.has(m.mission));
    for (const m of news) scene_of(m.mission).add_state(m, now_ms());
    if (news.length) mission_list.value = [...mission_list.value, ...news];
  } catch { /* the stream alone will do */ }
  synced.value = true;
}
/// Estimates of a flight nobody feeds any more: asked for once, when it is looked at and the stream gave none.
async function load_estimates(id: string): Promise<void> {
  try {
    const { rows } = rows_of_collection(await request('GET', `/anchors?view=live&mission=${encodeURIComponent(id)}&limit=1000`));
    const scene = scene_of(id);
    for (const r of rows) if (!scene.anchors.has(r.anchor)) scene.add_estimate({ ...r, mission: id, t_us: micros(r.calibrated_at) ?? 0 }, now_ms());
    tick.value++;
  } catch { /* no estimates: the view says so */ }
}
export function follow_archive(): void {
  let asked: string | null = null;
  effect(() => {
    const id = mission_id.value;
    if (!id || link.value !== 'live' || !synced.value || asked === id) return;
    asked = id;
    if (scene_of(id).anchors.size === 0) void load_estimates(id);
  });
  effect(() => { if (link.value === 'lost') asked = null; });
}
