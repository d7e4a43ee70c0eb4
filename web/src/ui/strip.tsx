/// The status strip: the same tiles in the same order on every view. A tile opens a card with the reason and the fix.
import { signal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import type { DroneMsg } from '../live/flight_messages';
import { me } from '../state/session';
import {
  replayed,
  watched_mission,
  watched_scene,
  devices,
  known_until_us,
  link,
  live_source,
  now_ms,
  system,
  tick,
  watched_lost,
} from '../state/store';
import { alarms, sound, toggle_sound } from './alarms';
import { fix_word } from './alarm_rules';
import { not_loaded_words } from './empty';
import { age, bytes, clock, fixed, millimetres } from './format';
import { Icon, Mark, type Shape, type Tone } from './marks';
import { next_theme, theme } from './theme';
import { open_sign_in } from './sign_in_state';
import { useDialog } from './use_dialog';

export const open_card = signal<string | null>(null);

interface Reading {
  tone: Tone;
  shape: Shape;
  word: string;
  extra: string;
  stale?: boolean;
  card: ComponentChildren;
}
const look = (tone: 'ok' | 'caution' | 'bad' | 'info' | 'off'): { tone: Tone; shape: Shape } => ({ tone, shape: tone });

function craft_words(craft: DroneMsg): string {
  const where = craft.in_air ? 'in the air' : craft.armed ? 'armed on the ground' : 'on the ground',
    height = craft.above_home_m === null ? '' : `, ${fixed(craft.above_home_m, 1)} m above home`;
  return `${craft.autopilot || 'The autopilot'} in mode ${craft.mode}, ${where}${height}.`;
}

type Readings = Record<'link' | 'rtk' | 'uwb' | 'drone' | 'rec' | 'alarms', Reading>;
/// With the link lost no tile but the link's own is of now: struck, with the age of what it shows.
function last_known({ link, ...others }: Readings, old: string): Readings {
  const struck = (r: Reading): Reading =>
    r.word === 'unknown'
      ? r
      : {
          ...r,
          tone: 'off',
          stale: true,
          extra: old,
          card: (
            <>
              <p>Last known, {old}.</p>
              <div class="stale">{r.card}</div>
            </>
          ),
        };
  const { rtk, uwb, drone, rec, alarms } = others;
  return { link, rtk: struck(rtk), uwb: struck(uwb), drone: struck(drone), rec: struck(rec), alarms: struck(alarms) };
}

function read(): Readings {
  tick.value;
  const now = now_ms(),
    replay = replayed.value,
    scene = watched_scene(),
    mission = watched_mission.value,
    running = mission?.state === 'recording',
    lost = watched_lost();
  const silence = live_source()?.silence_ms() ?? Infinity,
    data_age = live_source()?.data_age_ms() ?? Infinity,
    arriving = silence < 2000;
  const link_look = { connecting: look('off'), live: look('ok'), late: look('caution'), lost: look('bad') }[link.value];
  const rtk = scene?.rtk ?? null,
    rtk_age = rtk ? now - rtk.at_ms : Infinity,
    rtk_stale = !!rtk && (rtk_age > 2000 || !running);
  const r = rtk?.value,
    old = (r?.correction_age_s ?? 0) > 5;
  const rtk_look =
    !r || r.fix === 'none'
      ? look('off')
      : r.fix === 'single'
        ? look('bad')
        : r.fix === 'dgps'
          ? look('info')
          : r.fix === 'float' || old
            ? look('caution')
            : look('ok');
  const rows = scene ? [...scene.ranges.values()] : [],
    // With the link lost: of those that were in range when the last one was heard.
    in_range_at_ms = lost ? (scene?.range_at_ms ?? now) : now,
    in_range = rows.filter((x) => in_range_at_ms - x.at_ms < 2000).length;
  const all_seen = Math.max(rows.length, mission?.anchors_found ?? 0, scene?.anchors.size ?? 0),
    uwb_stale = all_seen > 0 && (lost || !running);
  const pose = scene?.pose ?? null,
    pose_stale = !!pose && (now - pose.at_ms > 1000 || !running);
  const up = pose?.value.enu_m?.[2] ?? null;
  const rec_s =
    mission?.started_us != null ? ((running ? known_until_us() : mission.t_us) - mission.started_us) / 1e6 : null;
  // A replayed flight carries old times, so its length is by measurement: newest row minus start.
  const flown_s = mission?.started_us != null && pose ? (pose.value.t_us - mission.started_us) / 1e6 : rec_s;
  const sys = system.value?.value,
    craft = scene?.procedure?.value.drone ?? null;
  const aged = (ms: number): string => (running ? `${age(ms)} old` : 'ended');
  const list = alarms.value,
    worst = list[0]?.priority;
  const readings: Readings = {
    link: replay
      ? {
          ...look('info'),
          word: 'REPLAY',
          extra: clock(replay.at_s),
          card: (
            <p>
              A stored flight is shown, {clock(replay.at_s)} after its start. The link to anchord is {link.value}; what
              happens now is under Live.
            </p>
          ),
        }
      : {
          ...link_look,
          word:
            me.value === null ? 'SIGNED OUT' : link.value === 'connecting' ? 'CONNECTING' : link.value.toUpperCase(),
          extra: link.value === 'lost' ? clock(data_age / 1000, true) : '',
          card: (
            <>
              <p>
                {
                  {
                    connecting: 'Waiting for the first answer from anchord.',
                    live: 'Heartbeats arrive every second.',
                    late: arriving
                      ? 'Data arrives more than 2 s late: the link is too slow.'
                      : 'No heartbeat for more than 2 s.',
                    lost: arriving
                      ? 'Data arrives more than 5 s late: the link is too slow. Go nearer to the access point, or close other pages.'
                      : 'No heartbeat for more than 5 s. Values are the last known; the page tries again by itself.',
                  }[link.value]
                }
              </p>
              {sys && (
                <p>
                  {fixed(sys.ws_clients, 0)} screens connected, {fixed(sys.queue_depth, 0)} rows waiting to be stored.
                </p>
              )}
            </>
          ),
        },
    rtk: {
      ...(rtk_stale ? { ...rtk_look, tone: 'off' } : rtk_look),
      stale: rtk_stale,
      word: r ? fix_word(r.fix) : 'none',
      extra: rtk_stale ? aged(rtk_age) : r?.correction_age_s == null ? '' : `${fixed(r.correction_age_s, 1)} s`,
      card: r ? (
        <>
          <p>
            {r.fix === 'fixed'
              ? old
                ? 'Fixed, but its corrections are more than 5 s old.'
                : 'Centimetre positions.'
              : r.fix === 'float'
                ? 'Decimetre positions: ranges count less until FIX returns.'
                : 'No RTK: ranges are recorded, but the positions are too inaccurate to use them.'}
          </p>
          <p>
            {fixed(r.satellites, 0)} satellites, corrections {fixed(r.correction_age_s, 1)} s old, σ E, N, U{' '}
            {r.sigma_m ? r.sigma_m.map((x) => millimetres(x)).join(', ') : '–'} mm (1σ).
          </p>
        </>
      ) : (
        <p>No position has been received for this flight.</p>
      ),
    },
    uwb: {
      ...(rows.length === 0 || uwb_stale ? look('off') : in_range === 0 ? look('bad') : look('ok')),
      stale: uwb_stale,
      word: !all_seen ? 'none' : `${running ? in_range : all_seen}/${all_seen}`,
      extra: uwb_stale ? (rows.length ? aged(now - (scene?.range_at_ms ?? 0)) : 'ended') : '',
      card: (
        <p>
          {rows.length
            ? `${in_range} of ${all_seen} anchors in range in the last 2 s, ${fixed(mission?.range_rate_hz, 0)} ranges a second.`
            : 'No range has been received for this flight.'}
          {devices.value.some((d) => d.kind === 'tag') &&
            ` Tags: ${devices.value
              .filter((d) => d.kind === 'tag')
              .map((d) => `${d.network_id} ${d.state}`)
              .join(', ')}.`}
        </p>
      ),
    },
    drone: craft
      ? {
          ...(!craft.connected ? look('bad') : craft.failsafe || craft.taken_over ? look('caution') : look('ok')),
          word: craft.battery === null ? craft.mode || 'seen' : `${fixed(craft.battery * 100, 0)} %`,
          extra: !craft.connected ? 'silent' : craft.battery === null ? '' : craft.mode,
          card: (
            <>
              <p>
                {craft.connected
                  ? craft_words(craft)
                  : 'Nothing has been received from the aircraft for 3 s. It follows its own failsafe; use the remote control.'}
              </p>
              {craft.text && <p>The autopilot reports: {craft.text}</p>}
            </>
          ),
        }
      : {
          ...(pose && !pose_stale ? look('ok') : look('off')),
          stale: pose_stale,
          word: pose ? (up === null ? 'seen' : `${fixed(up, 1)} m`) : 'none',
          extra: pose_stale
            ? aged(now - pose.at_ms)
            : pose?.value.speed_mps == null
              ? ''
              : `${fixed(pose.value.speed_mps, 1)} m/s`,
          card: (
            <p>
              {pose
                ? 'Height above the origin of this flight, and speed over ground. Battery and mode come with the aircraft ' +
                  'link, which this flight does not have.'
                : 'No position of the aircraft has been received.'}
            </p>
          ),
        },
    rec: {
      ...(replay ? look('off') : running ? (sys && !sys.recording ? look('caution') : look('ok')) : look('off')),
      word: replay ? 'stored' : running ? clock(flown_s) : 'off',
      extra: replay || running || !mission ? '' : mission.state,
      card: (
        <>
          <p>
            {replay
              ? `${replay.mission.name} is stored; nothing of it is recorded now.`
              : running
                ? `${mission.name}: ${mission.n_ranges} ranges and ${mission.n_fixes} fixes stored.`
                : 'No flight is being recorded.'}
          </p>
          {sys && (
            <p>
              Database {bytes(sys.db_bytes)}, {bytes(sys.disk_free_bytes)} free; a stored row survives{' '}
              {sys.synchronous === 'full' ? 'power loss' : 'a crash of the program'}.
            </p>
          )}
        </>
      ),
    },
    alarms: {
      ...(worst === 'critical' ? look('bad') : worst === 'warning' ? look('caution') : look('off')),
      word: list.length ? String(list.length) : lost ? 'unknown' : 'none',
      extra: '',
      card: list.length ? (
        <ul>
          {list.map((a) => (
            <li key={a.id}>
              <b>{a.title}</b> {a.priority}
              {a.acknowledged ? ', acknowledged' : ''}
            </li>
          ))}
        </ul>
      ) : (
        <p>{lost ? not_loaded_words('lost') : 'Nothing is wrong that anchord can see.'}</p>
      ),
    },
  };
  return lost ? last_known(readings, `${age(data_age)} old`) : readings;
}

const LABELS = { link: 'Link', rtk: 'RTK', uwb: 'UWB', drone: 'Drone', rec: 'Recording', alarms: 'Alarms' } as const;

function Card({ label, word, children }: { label: string; word: string; children: ComponentChildren }) {
  const close = (): void => {
      open_card.value = null;
    },
    box = useDialog<HTMLDivElement>(close, 'strip');
  return (
    <div class="card" {...box} aria-label={label}>
      <h2>
        {label}: {word}
      </h2>
      {children}
      <button class="btn small" onClick={close}>
        Close
      </button>
    </div>
  );
}

export function Strip() {
  const readings = read(),
    mission = watched_mission.value,
    replay = replayed.value,
    who = me.value;
  const open = open_card.value;
  return (
    <header class="strip">
      <a class="brand" href="#/live" aria-label="anchord">
        <svg viewBox="0 0 24 24" class="logo" aria-hidden="true">
          <path d="M12 11.5V21M7 21h10" />
          <circle cx="12" cy="8.6" r="2.5" />
          <path d="M6 14.5a8.6 8.6 0 0 1 0-11.8M18 14.5a8.6 8.6 0 0 0 0-11.8" />
        </svg>
        <span>anchord</span>
      </a>
      <div class="site">
        <b title={mission?.name ?? ''}>{mission?.name || 'No flight'}</b>
        <span class={watched_lost() ? 'stale' : ''}>
          {replay
            ? 'replay'
            : mission
              ? { recording: 'recording', finished: 'finished', planned: 'planned' }[mission.state]
              : 'nothing recorded yet'}
        </span>
      </div>
      {(Object.keys(LABELS) as (keyof typeof LABELS)[]).map((k) => {
        const r = readings[k];
        return (
          <div class="tilebox" key={k}>
            <button
              class={`tile ${k}${r.stale ? ' stale' : ''}${r.extra === 'ended' ? ' over' : ''}`}
              data-tone={r.tone}
              data-testid={`status-${k}`}
              aria-expanded={open === k}
              onClick={() => (open_card.value = open === k ? null : k)}
            >
              <span class="tl">{LABELS[k]}</span>
              <span class="tv">
                <Mark shape={r.shape} />
                <b title={r.word}>{r.word}</b>
              </span>
              <span class="te">{r.extra}</span>
            </button>
            {open === k && (
              <Card label={LABELS[k]} word={r.word}>
                {r.card}
              </Card>
            )}
          </div>
        );
      })}
      <span class="grow" />
      {who && (
        <div class="who">
          <b>{who.auth === 'off' ? 'Open access' : who.name}</b>
          <span>{who.auth === 'off' ? 'this machine only' : who.roles.join(', ')}</span>
        </div>
      )}
      <button
        class="ib"
        data-testid="theme"
        aria-label={`Theme: ${theme.value}. Change`}
        title={`Theme: ${theme.value}`}
        onClick={next_theme}
      >
        <Icon name={theme.value} />
      </button>
      <button
        class="ib opt"
        data-testid="sound"
        aria-label={
          {
            off: 'Sound off. Tap to enable',
            on: 'Sound on. Mute 2 minutes',
            muted: 'Muted. Tap to unmute',
            blocked: 'The browser plays no sound. Tap to try again',
          }[sound.value]
        }
        onClick={toggle_sound}
      >
        <Icon name={sound.value === 'on' ? 'sound' : 'mute'} />
      </button>
      <button class="ib opt" data-testid="user" aria-label={who ? 'User' : 'Sign in'} onClick={open_sign_in}>
        <Icon name="user" />
      </button>
    </header>
  );
}
