/// The signals of the page, and the sink that fills them. Scenes are mutable; `tick` says, at most four times a second, that text may look again.
import { computed, effect, signal } from '@preact/signals';
import * as f from '../live/flight_messages';
import * as m from '../live/messages';
import { age } from '../ui/format';
import type { LinkState, LiveSink, LiveSource } from '../live/source';
import type { TopicName } from '../live/stream';
import { Measured, type TimeOf } from './measured';
import { Scene } from './scene';

export const TOPICS = [
  'mission.state',
  'drone.pose',
  'rtk.status',
  'ranges',
  'anchors.estimates',
  'devices',
  'system',
  'events',
  'alarms',
  'revisions',
  'jobs',
  'procedure',
  'mission.grid',
  'mission.turn',
  'mission.height',
] as const satisfies readonly TopicName[];

/// A link that cannot keep up gets less, and nothing older.
export const PARAMS = {
  'anchors.estimates': { max_hz: 2, deltas: true },
  'drone.pose': { max_hz: 10 }, // between two of them the map moves it
  ranges: { max_age_s: 1 },
} as const;

export const link = signal<LinkState>('connecting');
export const tick = signal(0);
export const scenes = new Map<string, Scene>();
export const mission_list = signal<readonly m.MissionMsg[]>([]);
export const chosen_mission = signal<string | null>(null); ///< by the user; null follows the newest recording
export const chosen_anchor = signal<string | null>(null);
export const server_alarms = signal<readonly m.AlarmMsg[]>([]);
export const devices = signal<readonly m.DeviceMsg[]>([]);
export const system = signal<{ value: m.SystemMsg; at_ms: number } | null>(null);
export const events = signal<readonly m.EventMsg[]>([]);
export const revision = signal<number | null>(null);
export const jobs_version = signal(0); ///< grows with every news of a job; what a job is about is asked over REST
export const toast = signal<{ text: string; id: number } | null>(null);
export const synced = signal(false); ///< first snapshots are in: before that, empty means "not loaded yet"

/// The server of another version than the one that this page came from: what the page has not loaded yet is not there any more.
export const newer_server = signal(false);
let first_server: string | null = null;

export const now_ms = (): number => performance.now();
let source: LiveSource | null = null;
export const live_source = (): LiveSource | null => source;
export const server_now_us = (): number => source?.now_us() ?? Date.now() * 1000;
/// Until when anything is known: with the link lost no clock of a flight counts on.
export const known_until_us = (): number =>
  server_now_us() - (link.value === 'lost' ? (source?.data_age_ms() ?? 0) * 1000 : 0);

/// Newest recording first, then the newest of the others; of two with the same measurements the one that came later (their ids rise).
export const ordered_missions = computed(() =>
  [...mission_list.value].sort(
    (a, b) =>
      Number(b.state === 'recording') - Number(a.state === 'recording') ||
      (b.started_us ?? b.t_us) - (a.started_us ?? a.t_us) ||
      (b.mission > a.mission ? 1 : -1),
  ),
);
export const mission_id = computed(() => {
  const chosen = chosen_mission.value;
  return chosen && mission_list.value.some((x) => x.mission === chosen)
    ? chosen
    : (ordered_missions.value[0]?.mission ?? null);
});
export function scene_of(id: string): Scene {
  let scene = scenes.get(id);
  if (!scene) scenes.set(id, (scene = new Scene(id)));
  return scene;
}
export const current_scene = (): Scene | null => (mission_id.value ? scene_of(mission_id.value) : null);
export const current_mission = computed(() => mission_list.value.find((x) => x.mission === mission_id.value) ?? null);

/// A recorded flight on screen stands in for the live one in lists and map; the strip says REPLAY and its time, alarms stay with what is live.
export interface Replayed {
  readonly scene: Scene;
  readonly mission: m.MissionMsg;
  readonly at_s: number; ///< of the flight, at the moment that is shown
}
export const replayed = signal<Replayed | null>(null);
export const watched_scene = (): Scene | null => replayed.value?.scene ?? current_scene();
export const watched_mission = computed(() => replayed.value?.mission ?? current_mission.value);
export const watched_lost = (): boolean => replayed.value === null && link.value === 'lost';

/// Calls every time the link has come back; returns its end.
export function when_back(call: () => void): () => void {
  let away = link.peek() !== 'live';
  return effect(() => {
    const live = link.value === 'live';
    if (live && away) queueMicrotask(call);
    away = !live;
  });
}

let toasts = 0;
let toast_timer: ReturnType<typeof setTimeout> | undefined;
/// Result of the user's own action, or of a reconnect: five seconds, polite.
export function say(text: string): void {
  toast.value = { text, id: ++toasts };
  clearTimeout(toast_timer);
  toast_timer = setTimeout(() => (toast.value = null), 5000);
}

let dirty = false;
let flush_timer: ReturnType<typeof setTimeout> | null = null;
function touch(): void {
  dirty = true;
  flush_timer ??= setTimeout(flush, 250);
}
function flush(): void {
  flush_timer = null;
  if (dirty) tick.value++;
  dirty = false;
}
/// Ages move while nothing arrives, so the text looks at least once a second.
setInterval(touch, 1000);

function upsert(list: readonly m.MissionMsg[], news: readonly m.MissionMsg[]): m.MissionMsg[] {
  const by_id = new Map(list.map((x) => [x.mission, x]));
  for (const x of news) by_id.set(x.mission, x);
  return [...by_id.values()];
}

const measured = new Measured();
function measured_ms(
  row: { readonly mission: string; readonly t_us: number },
  of: TimeOf,
  whole: boolean,
  teaches = true,
): number {
  const data_age_ms = source?.data_age_ms() ?? 0,
    arrival = { t_us: row.t_us, now_ms: now_ms(), server_now_us: server_now_us(), data_age_ms, live: !whole };
  return measured.at_ms(row.mission, of, arrival, teaches);
}

type Handler = (data: unknown, whole: boolean) => void;
const handlers: Record<(typeof TOPICS)[number], Handler> & Partial<Record<TopicName, Handler>> = {
  'mission.state': (data) => {
    const news = m.all(data, m.mission);
    mission_list.value = upsert(mission_list.value, news);
    for (const x of news) scene_of(x.mission).add_state(x, now_ms());
    if (news.length) synced.value = true;
  },
  'drone.pose': (data, whole) => {
    for (const p of m.all(data, m.pose)) scene_of(p.mission).add_pose(p, measured_ms(p, 'position', whole), now_ms());
  },
  'rtk.status': (data, whole) => {
    for (const r of m.all(data, m.rtk)) scene_of(r.mission).add_rtk(r, measured_ms(r, 'position', whole));
  },
  ranges: (data, whole) => {
    for (const r of m.all(data, m.range)) scene_of(r.mission).add_range(r, measured_ms(r, 'range', whole));
  },
  'anchors.estimates': (data, whole) => {
    if (whole) for (const s of scenes.values()) s.anchors.clear();
    for (const e of m.all(data, m.estimate)) scene_of(e.mission).add_estimate(e, measured_ms(e, 'range', whole, false));
  },
  devices: (data) => (devices.value = m.all(data, m.device)),
  system: (data, whole) => {
    for (const s of m.all(data, m.system))
      system.value = { value: s, at_ms: measured_ms({ mission: '', t_us: s.t_us }, 'server', whole) };
  },
  events: (data, whole) => {
    const news = m.all(data, m.event),
      gone = news.filter(
        (e) =>
          e.code === 'mission.deleted' &&
          !news.some((x) => x.code === 'mission.restored' && x.mission === e.mission && x.t_us > e.t_us),
      );
    events.value = [...(whole ? [] : events.value), ...news].slice(-50);
    if (gone.length && !whole)
      mission_list.value = mission_list.value.filter((x) => !gone.some((e) => e.mission === x.mission));
  },
  alarms: (data) => (server_alarms.value = m.all(data, m.alarm)),
  revisions: (data) => {
    for (const r of m.all(data, m.revision)) revision.value = Math.max(revision.value ?? 0, r.revision);
  },
  procedure: (data, whole) => {
    for (const p of m.all(data, f.procedure)) scene_of(p.mission).add_procedure(p, measured_ms(p, 'server', whole));
  },
  'mission.grid': (data, whole) => {
    for (const g of m.all(data, f.grid)) scene_of(g.mission).add_grid(g, measured_ms(g, 'server', whole));
  },
  'mission.turn': (data, whole) => {
    for (const t of m.all(data, f.turn))
      scene_of(t.mission).turns.set(t.anchor, { value: t, at_ms: measured_ms(t, 'server', whole) });
  },
  'mission.height': (data, whole) => {
    for (const h of m.all(data, f.height))
      scene_of(h.mission).heights.set(h.anchor, { value: h, at_ms: measured_ms(h, 'server', whole) });
  },
  jobs: () => {
    jobs_version.value++;
  },
};

let lost_ms: number | null = null; ///< when the last thing arrived before the outage that is on
/// What an outage was, and what came back after it.
export function back_words(
  outage_ms: number | null,
  recovered: ReadonlyMap<TopicName, number>,
  resynchronised: boolean,
): string {
  const back = outage_ms === null ? 'Connected again' : `Link back after ${age(outage_ms)}`;
  if (resynchronised) return `${back}. Resynchronised with the server`;
  const what = [...recovered].map(([topic, n]) => `${n} of ${TOPIC_WORDS[topic] ?? topic.replaceAll('.', ' ')}`);
  return what.length ? `${back}, recovered messages: ${what.join(', ')}` : `${back}. Nothing was missed`;
}
const TOPIC_WORDS: Partial<Record<TopicName, string>> = {
  'mission.state': 'flights',
  'drone.pose': 'positions',
  'rtk.status': 'RTK',
  'anchors.estimates': 'anchors',
  procedure: 'the procedure',
  'mission.grid': 'next points',
  'mission.turn': 'turns',
  'mission.height': 'height searches',
  system: 'the server',
};

/// `fresh`: the stream begins, or another life of the server does, and what it does not tell must be asked for.
export function connect(live: LiveSource, refused: () => void, fresh: () => void): void {
  source = live;
  const sink: LiveSink = {
    snap: (topic, data) => {
      if (data != null) handlers[topic]?.(data, true);
      touch();
    },
    data: (topic, data) => {
      handlers[topic]?.(data, false);
      touch();
    },
    gap: () => touch(),
    restarted: () => {
      scenes.clear();
      measured.clear();
      mission_list.value = [];
      synced.value = false;
      server_alarms.value = [];
      devices.value = [];
      events.value = [];
      fresh();
      touch();
    },
    resumed: (recovered, resynchronised) => {
      say(back_words(lost_ms === null ? null : now_ms() - lost_ms, recovered, resynchronised));
      lost_ms = null;
    },
    link: (state) => {
      if (state === 'lost') lost_ms ??= now_ms() - live.data_age_ms();
      link.value = state;
      touch();
    },
    server: (name) => {
      first_server ??= name;
      newer_server.value = name !== first_server;
    },
    refused,
  };
  live.start(sink);
  fresh();
}
