/// Replay: a stored flight on the same map and lists as the live one, with its clock in the viewer's hand. No command exists here.
import { useEffect, useRef, useState } from 'preact/hooks';
import './replay.css';
import { error_text } from '../../api/client';
import { live_rows } from '../../api/anchors';
import { MapBox } from '../../map/map_box';
import { after, estimates_over_time, load_procedure, load_recording, neighbour, Player } from '../../state/recording';
import { shown_estimates } from '../../state/done';
import { backdrops } from '../../state/floors';
import { alarms_at, decision_at, procedure_at, status_of } from '../../state/moment';
import { flown_picture } from './picture';
import { Scene } from '../../state/scene';
import {
  chosen_anchor,
  mission_id,
  now_ms,
  ordered_missions,
  replayed,
  synced,
  tick,
  watched_lost,
  when_back,
  link,
} from '../../state/store';
import { may } from '../../state/session';
import { clock, fixed, grouped, told_apart } from '../../ui/format';
import { AlarmRow } from '../../ui/alarm_row';
import { Chip } from '../../ui/marks';
import { AnchorCard } from '../anchor_card';
import '../flight/flight.css';
import { NextPoint, Procedure, sentence, Stage, TurnAndHeight } from '../flight/procedure';
import { STATUS_LOOK } from '../flight/words';
import { EventRow } from '../events';
import { RangeList } from '../range_list';
import { not_loaded_words } from '../../ui/empty';
import { Unknown } from '../../ui/unknown';
import { useStable } from '../../ui/use_stable';

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16] as const;

export function Replay({ id }: { id: string | null }) {
  const [at_s] = useState(() => Number(new URLSearchParams(location.hash.split('?')[1] ?? '').get('t')) || 0);
  const [player, set_player] = useState<Player | null>(null),
    [problem, set_problem] = useState(''),
    [playing, set_playing] = useState(false),
    [attempt, set_attempt] = useState(0),
    [speed, set_speed] = useState<number>(1),
    [moment, set_moment] = useState<'asked' | 'moment' | 'whole' | 'nothing'>('asked'),
    [n_read, set_n_read] = useState(0),
    [, redraw] = useState(0);
  const wanted = (id ?? '').split('?')[0] || mission_id.value,
    mission = ordered_missions.value.find((m) => m.mission === wanted) ?? null;
  const show = useStable((p: Player): void => {
    replayed.value = {
      scene: p.scene,
      mission: { ...p.recording.mission, state: 'recording' },
      at_s: (p.t_us - p.recording.from_us) / 1e6,
    };
  });
  const begin = useStable((): (() => void) | undefined => {
    document.title = 'Replay - anchord';
    if (!mission) return;
    let gone = false;
    // From the first moment nothing here is of now: while the flight is read, its scene is empty.
    replayed.value = { scene: new Scene(mission.mission), mission: { ...mission, state: 'recording' }, at_s };
    // Nor of the flight that was played before.
    set_player(null);
    set_playing(false);
    set_moment('asked');
    set_n_read(0);
    load_recording(mission, (n_rows) => !gone && set_n_read(n_rows)).then(
      async (recording) => {
        const made = new Player(recording);
        if (gone) return;
        set_problem('');
        if (!recording.poses.length && !recording.ranges.length) return set_moment('nothing');
        made.to(recording.from_us + at_s * 1e6, now_ms());
        const shown = await load_procedure(mission.mission).catch(() => []);
        if (gone) return;
        made.learn_procedure(shown, now_ms());
        show(made);
        set_player(made);
        // Positions of the moment, else what the whole flight gave.
        const over_time = await estimates_over_time(mission.mission).catch(() => null);
        if (gone) return;
        if (over_time) made.learn(over_time, now_ms());
        else
          for (const r of await live_rows(mission.mission).catch(() => []))
            made.scene.add_estimate({ ...r, mission: mission.mission, t_us: recording.to_us }, now_ms());
        show(made);
        set_moment(over_time ? 'moment' : 'whole');
        tick.value++;
      },
      (e: unknown) => {
        if (!gone) set_problem(error_text(e));
      },
    );
    return () => {
      gone = true;
      replayed.value = null;
    };
  });
  useEffect(begin, [mission?.mission, attempt, begin]);
  const failed = problem !== '';
  useEffect(() => (failed ? when_back(() => set_attempt((n) => n + 1)) : undefined), [failed]);
  const go = useStable((t_us: number): void => {
    if (player) {
      player.to(t_us, now_ms());
      show(player);
      tick.value++;
      redraw((n) => n + 1);
    }
  });
  const latest = useRef({ player, speed, go });
  latest.current = { player, speed, go };
  useEffect(() => {
    if (!playing) {
      const hold = setInterval(() => {
        const p = latest.current.player;
        if (p) p.to(p.t_us, now_ms());
      }, 500);
      return () => clearInterval(hold);
    }
    let last = now_ms(),
      frame = 0,
      text = 0;
    const step = (): void => {
      const now = now_ms(),
        p = latest.current.player;
      if (p) {
        p.to(p.t_us + (now - last) * 1000 * latest.current.speed, now);
        if (now - text > 250) {
          text = now;
          latest.current.go(p.t_us);
        }
        if (p.t_us >= p.recording.to_us) set_playing(false);
      }
      last = now;
      frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
    return () => cancelAnimationFrame(frame);
  }, [playing, player]);
  useEffect(() => {
    const on_key = (e: KeyboardEvent): void => {
      if (
        !player ||
        (e.target instanceof HTMLElement && e.target.closest('input, select, textarea, [role="application"]')) ||
        e.ctrlKey ||
        e.metaKey
      )
        return;
      const step_us = e.altKey ? 500_000 : e.shiftKey ? 10_000 : 100_000,
        marks = player.recording.marks,
        step_to = (by: 1 | -1) => (): void => {
          const m = neighbour(marks, player.t_us, by);
          if (m) {
            set_playing(false);
            go(m.t_us);
          }
        };
      const act: Record<string, () => void> = {
        ' ': () => set_playing((x) => !x),
        ArrowRight: () => go(player.t_us + step_us),
        ArrowLeft: () => go(player.t_us - step_us),
        '.': step_to(1),
        ',': step_to(-1),
      };
      if (act[e.key]) {
        e.preventDefault();
        act[e.key]!();
      }
    };
    addEventListener('keydown', on_key);
    return () => removeEventListener('keydown', on_key);
  }, [player, go]);
  if (!mission)
    return (
      <div class="empty">
        <h1 class="sr">Replay</h1>
        {!synced.value || link.value === 'lost' ? (
          <p role="status">{not_loaded_words(link.value)}</p>
        ) : wanted ? (
          <Unknown what="flight" id={wanted}>
            or choose a flight in System.
          </Unknown>
        ) : (
          <p role="status">No flight is stored yet: the first one that is flown or imported can be replayed here.</p>
        )}
        <span class="ways">
          <a class="btn" href="#/live">
            Go to Live
          </a>
          {!wanted && may('operator') && (
            <a class="btn" href="#/import">
              Import a flight
            </a>
          )}
        </span>
      </div>
    );
  const scene = player?.scene ?? null,
    selected = chosen_anchor.value ?? [...(scene?.anchors.keys() ?? [])].sort()[0] ?? null,
    r = player?.recording,
    span = r ? r.to_us - r.from_us : 1,
    names = told_apart(ordered_missions.value);
  return (
    <div class="replay" data-testid="replay" data-positions={moment}>
      <div class="toolbar">
        <Chip shape="info" tone="info" word="REPLAY" />
        <h1>{names.get(mission) || mission.mission.slice(-8)}</h1>
        {ordered_missions.value.length > 1 && (
          <select
            aria-label="Flight to replay"
            value={mission.mission}
            onChange={(e) => (location.hash = `#/replay/${e.currentTarget.value}`)}
          >
            {ordered_missions.value.map((m) => (
              <option key={m.mission} value={m.mission}>
                {names.get(m) || m.mission.slice(-8)}
              </option>
            ))}
          </select>
        )}
        <span class="grow" />
        {r?.cut && (
          <span class="mut">Played to {clock((r.to_us - r.from_us) / 1e6)}: the flight has more rows than that.</span>
        )}
        <a class="btn" href="#/live">
          Back to live
        </a>
      </div>
      {problem && (
        <div class="problem" role="status">
          <b>The flight could not be read.</b> {problem}
        </div>
      )}
      <div class="replaybody">
        <MapBox
          content={() => ({
            anchors: shown_estimates(scene),
            selected,
            scene: player?.scene ?? null,
            link_lost: watched_lost(),
            running: true,
            flight: player && flown_picture(player.recording, player.t_us, player.scene),
            backdrops: backdrops(mission.origin),
            reach_m: player?.reach_m ?? [],
          })}
          onSelect={(a) => (chosen_anchor.value = a)}
          label="Map of the recorded flight"
          follow
          version={`${mission.mission} ${scene?.estimates_version} ${scene?.procedure?.value.step} ${selected}`}
        />
        <aside class="side" aria-label="Ranges and anchor of the recording" tabIndex={0}>
          {player && <Then player={player} />}
          {player ? (
            <RangeList selected={selected} />
          ) : moment === 'nothing' ? (
            <p class="why pad" role="status">
              This flight has no measurements: there is nothing to play.
            </p>
          ) : (
            !failed && (
              <p class="why pad" role="status">
                The flight is being read{n_read > 0 && `: ${grouped(n_read)} rows so far`}.
              </p>
            )
          )}
          {moment === 'asked' && player && (
            <p class="why pad" role="status">
              Positions of each moment are being computed from the stored ranges.
            </p>
          )}
          {moment === 'whole' && (
            <p class="why pad">Track and ranges are of the moment shown; positions are what the whole flight gave.</p>
          )}
          {selected && scene?.anchors.has(selected) && <AnchorCard anchor={selected} />}
          {player && <Marks player={player} go={go} />}
        </aside>
      </div>
      <div class="player" role="group" aria-label="Player">
        <button
          class="btn primary"
          data-testid="play"
          disabled={!player}
          onClick={() => {
            if (player && player.t_us >= player.recording.to_us) go(player.recording.from_us);
            set_playing(!playing);
          }}
        >
          {playing ? 'Pause' : 'Play'}
        </button>
        <span class="n" data-testid="replay-time">
          {player
            ? `${clock((player.t_us - player.recording.from_us) / 1e6)}.${fixed(Math.floor(((player.t_us - player.recording.from_us) / 1e5) % 10), 0)}`
            : '–'}
        </span>
        <div class="scrub">
          {r && <FixBand player={player} />}
          <input
            type="range"
            min="0"
            max={span}
            step="10000"
            value={player ? player.t_us - player.recording.from_us : 0}
            aria-label="Time in the flight"
            aria-valuetext={player ? clock((player.t_us - player.recording.from_us) / 1e6) : ''}
            data-testid="scrubber"
            onInput={(e) => {
              if (r) go(r.from_us + Number(e.currentTarget.value));
            }}
          />
        </div>
        <span class="n mut">{clock(span / 1e6)}</span>
        <label class="limit">
          Speed{' '}
          <select value={speed} data-testid="speed" onChange={(e) => set_speed(Number(e.currentTarget.value))}>
            {SPEEDS.map((s) => (
              <option key={s} value={s}>
                {s}×
              </option>
            ))}
          </select>
        </label>
      </div>
    </div>
  );
}

/// Which alarms stood at the moment shown, and where the flight stood in its procedure.
function Then({ player }: { player: Player }) {
  const alarms = alarms_at(player.recording.marks, player.t_us);
  return (
    <>
      {alarms.length > 0 && (
        <section class="sec-p" data-testid="replay-alarms">
          <h2>Alarms at this moment</h2>
          <ul class="alarmrows">
            {alarms.map((a) => (
              <AlarmRow key={a.id} a={a} stood={clock((player.t_us / 1000 - a.since_ms) / 1000, true)} />
            ))}
          </ul>
        </section>
      )}
      {player.procedure_kept ? (
        <>
          <Procedure />
          <NextPoint />
          <TurnAndHeight />
        </>
      ) : (
        <ByEvents player={player} />
      )}
    </>
  );
}

/// The procedure of a flight of which nothing but its events was kept.
function ByEvents({ player }: { player: Player }) {
  const { marks } = player.recording,
    p = procedure_at(marks, player.t_us),
    decided = decision_at(marks, player.t_us);
  const [shape, tone, word] =
    p?.step === 'done' ? (['off', 'off', 'LANDED'] as const) : STATUS_LOOK[status_of(p?.step ?? 'ready')];
  return (
    <>
      {p && (
        <section class="sec-p" data-testid="replay-procedure">
          <div class="hd">
            <h2>Procedure</h2>
            <Chip shape={shape} tone={tone} word={word} />
            <span class="meta">{p.iteration > 0 ? `iteration ${p.iteration}` : ''}</span>
          </div>
          <Stage step={p.step} in_step_s={(player.t_us - p.since_us) / 1e6} />
          {p.reason && <p class="why">{sentence(p.reason)}</p>}
          {p.reached.length > 0 && (
            <details class="notdone">
              <summary>{p.reached.length} anchors whose work was over</summary>
              <ul>
                {p.reached.map((r) => (
                  <li key={r}>{r}</li>
                ))}
              </ul>
            </details>
          )}
        </section>
      )}
      {p && p.step !== 'done' && p.step !== 'ready' && (
        <section class="sec-p" data-testid="replay-next-point">
          <h2>Next point</h2>
          {decided && (
            <p class="why">
              {sentence(decided.text)} Decided at {clock((decided.t_us - player.recording.from_us) / 1e6)}.
            </p>
          )}
          <p class="why mut">
            The point it flies to is marked on the map. The other candidates of this flight were not kept.
          </p>
        </section>
      )}
    </>
  );
}

/// What happened, in the order of the flight; the last one before the moment shown is marked.
function Marks({ player, go }: { player: Player; go: (t_us: number) => void }) {
  const { marks, from_us } = player.recording,
    here = after(marks, player.t_us) - 1;
  if (!marks.length) return null;
  return (
    <section class="sec-p events" data-testid="replay-events">
      <div class="hd">
        <h2>Events</h2>
        <span class="meta">
          {here + 1} of {marks.length} <kbd>,</kbd> <kbd>.</kbd>
        </span>
      </div>
      <ul>
        {marks.slice(Math.max(0, here - 3), here + 6).map((m, k) => {
          const i = Math.max(0, here - 3) + k;
          return (
            <EventRow key={i} e={m} here={i === here}>
              <button class="btn small" onClick={() => go(m.t_us)}>
                {clock((m.t_us - from_us) / 1e6)}
              </button>
            </EventRow>
          );
        })}
      </ul>
    </section>
  );
}

/// The fix over the whole flight, and a tick for every event: where to look.
function FixBand({ player }: { player: Player }) {
  const { recording: r } = player,
    span = r.to_us - r.from_us || 1,
    runs: { from: number; to: number; fix: string }[] = [];
  for (const p of r.poses) {
    const last = runs[runs.length - 1];
    if (last && last.fix === p.fix) last.to = p.t_us;
    else runs.push({ from: p.t_us, to: p.t_us, fix: p.fix });
  }
  const x = (t: number): number => ((t - r.from_us) / span) * 1000;
  return (
    <svg
      class="fixband"
      viewBox="0 0 1000 14"
      preserveAspectRatio="none"
      role="img"
      aria-label={`${runs.length} stretches of one fix class, ${r.marks.length} events`}
    >
      {runs.map((f, i) => (
        <rect key={i} class={`fx ${f.fix}`} x={x(f.from)} width={Math.max(1, x(f.to) - x(f.from))} y="5" height="9" />
      ))}
      {r.marks.map((m, i) => (
        <rect key={`m${i}`} class={`mk ${m.level}`} x={x(m.t_us)} width="2" y="0" height="14" />
      ))}
    </svg>
  );
}
