import { computed, effect, signal } from '@preact/signals';
import {
  current_mission,
  current_scene,
  events,
  link,
  live_source,
  mission_list,
  now_ms,
  server_alarms,
  server_now_us,
  tick,
} from '../state/store';
import { AlarmLimiter, Conditions, merged, newest_refusal, type Alarm } from './alarm_rules';

const conditions = new Conditions();
const limiter = new AlarmLimiter();
const acknowledged = signal<ReadonlySet<string>>(new Set());
const wanted = signal<'off' | 'on' | 'muted'>('off'),
  audible = signal(true);
/// Blocked: it was turned on, and the browser plays nothing: not allowed, no output, or taken away (a call, a locked screen).
export const sound = computed(() => (wanted.value === 'on' && !audible.value ? 'blocked' : wanted.value));

export const alarms = computed<readonly Alarm[]>(() => {
  tick.value;
  const scene = current_scene(),
    mission = current_mission.value,
    now = now_ms();
  const own = conditions.standing({
    now_ms: now,
    link: link.value,
    silence_ms: live_source()?.silence_ms() ?? 0,
    data_age_ms: live_source()?.data_age_ms() ?? 0,
    slow: live_source()?.slow() ?? false,
    recording: mission?.state === 'recording',
    fix: scene?.rtk?.value.fix ?? scene?.pose?.value.fix ?? null,
    correction_age_s: scene?.rtk?.value.correction_age_s ?? null,
    range_silence_ms: scene ? now - scene.range_at_ms : Infinity,
    refused: newest_refusal(events.value, mission?.mission ?? null, server_now_us()),
  });
  const screen = {
    mission: mission?.mission ?? null,
    name: (id: string): string => mission_list.value.find((m) => m.mission === id)?.name || id.slice(-8),
  };
  return merged(own, server_alarms.value, server_now_us(), now, link.value === 'lost', screen).map((a) =>
    acknowledged.value.has(a.id) ? { ...a, acknowledged: true } : a,
  );
});
effect(() => {
  // what cleared may be acknowledged anew when it returns
  const standing = new Set(alarms.value.map((a) => a.id));
  const kept = [...acknowledged.peek()].filter((id) => standing.has(id));
  if (kept.length !== acknowledged.peek().size) acknowledged.value = new Set(kept);
});
/// For this page; it stays listed, quiet.
export const acknowledge = (id: string): void => {
  acknowledged.value = new Set([...acknowledged.value, id]);
};

let audio: AudioContext | null = null;
const AUDIBLE_AFTER_MS = 1000; ///< a browser that may play does so well before
const heard = (): void => void (audible.value = audio?.state === 'running');
/// A promise that never settles, or is refused, is the browser's way to say that it may not.
function resume(): void {
  if (audio?.state !== 'running') audio?.resume().catch(() => undefined);
}
function make_audio(): AudioContext | null {
  if (!('AudioContext' in window)) return null;
  const made = new AudioContext();
  made.addEventListener('statechange', heard);
  return made;
}
/// Browsers need a tap before they sound: the button in the strip is that tap.
export function toggle_sound(): void {
  audio ??= make_audio();
  resume();
  setTimeout(heard, AUDIBLE_AFTER_MS);
  wanted.value = sound.value === 'on' ? 'muted' : 'on';
  if (wanted.value === 'muted') mute();
  else {
    limiter.unmute();
    tones('warning');
  }
}
let unmute_timer: ReturnType<typeof setTimeout> | undefined;
export function mute(): void {
  limiter.mute(now_ms() + 120_000);
  if (wanted.value === 'on') wanted.value = 'muted';
  clearTimeout(unmute_timer); // of an earlier time: its two minutes are not this one's
  unmute_timer = setTimeout(() => {
    if (wanted.value === 'muted') wanted.value = 'on';
  }, 120_000);
}
/// Critical: three fast high tones; warning: two low ones.
function tones(priority: Alarm['priority']): void {
  if (!audio) return;
  resume();
  const [n, hz, gap_s] = priority === 'critical' ? [3, 1320, 0.16] : [2, 520, 0.28];
  for (let i = 0; i < n; i++) {
    const [o, g] = [audio.createOscillator(), audio.createGain()],
      at = audio.currentTime + i * gap_s;
    o.frequency.value = hz;
    g.gain.setValueAtTime(0.2, at);
    g.gain.exponentialRampToValueAtTime(0.001, at + gap_s * 0.8);
    o.connect(g).connect(audio.destination);
    o.start(at);
    o.stop(at + gap_s);
  }
}
effect(() => {
  const due = limiter.due(alarms.value, now_ms());
  if (due && wanted.peek() !== 'off') tones(due.priority);
});
