/// Live flight: the map and what it stands on at the left, flight, ranges and the selected anchor at the right.
import { useEffect } from 'preact/hooks';
import { MapBox } from '../map/map_box';
import type { Content } from '../map/picture';
import { done_count, shown_estimates } from '../state/done';
import { backdrops } from '../state/floors';
import { me } from '../state/session';
import {
  chosen_anchor,
  chosen_mission,
  current_mission,
  current_scene,
  known_until_us,
  link,
  mission_id,
  now_ms,
  ordered_missions,
  synced,
  tick,
  watched_lost,
} from '../state/store';
import { not_loaded_words } from '../ui/empty';
import { bearing, clock, fixed, grouped, millimetres, told_apart } from '../ui/format';
import { Chip, Q } from '../ui/marks';
import { useLater } from '../ui/use_later';
import { AnchorCard } from './anchor_card';
import { Events } from './events';
import { Aside, load_recording } from './flight/aside';
import './flight/field.css';
import './flight/flight.css';
import { FlightBar } from './flight/commands';
import { flight_picture, follow_plan } from './flight/picture';
import { TurnAndHeight, NextPoint, Procedure } from './flight/procedure';
import { RangeList } from './range_list';

export function content(): Content {
  const scene = current_scene(),
    m = current_mission.peek();
  return {
    anchors: shown_estimates(scene),
    selected: chosen_anchor.peek(),
    scene,
    link_lost: watched_lost(),
    running: m?.state === 'recording',
    flight: flight_picture(),
    backdrops: backdrops(m?.origin),
  };
}

export function Live() {
  tick.value;
  const mission = current_mission.value,
    step = current_scene()?.procedure?.value;
  useEffect(follow_plan, [step?.plan, step?.plan_revision]);
  useEffect(() => {
    document.title = `${mission?.name ?? 'Live'} - anchord`;
  }, [mission?.name]);
  if (!mission) return synced.value ? <NoFlight /> : <Waiting />;
  const scene = current_scene();
  // With nothing chosen, the anchor that needs attention most: ambiguous first, then the least accurate.
  const sorted = shown_estimates(scene).sort(
    (a, b) => Number(b.status === 'ambiguous') - Number(a.status === 'ambiguous') || (b.h95_m ?? 0) - (a.h95_m ?? 0),
  );
  const selected = chosen_anchor.value ?? sorted[0]?.anchor ?? null;
  return (
    <div class="live" data-testid="live">
      <h1 class="sr">Live flight</h1>
      <section class="left" aria-label="Map and flight readings">
        <MapBox
          content={() => ({ ...content(), selected })}
          onSelect={(a) => (chosen_anchor.value = a)}
          label="Live map: drone, ranges and anchors. All of it is also in the tables."
          follow
          version={`${mission.mission} ${scene?.estimates_version} ${step?.step} ${step?.waypoint} ${selected}`}
        />
        <Legend />
        <Band />
        <FlightBar />
      </section>
      <aside class="side" aria-label="Flight, ranges, selected anchor" tabIndex={0}>
        <Procedure />
        <NextPoint />
        <TurnAndHeight />
        <Progress />
        <Aside load={load_recording} mission={mission.mission} />
        <RangeList selected={selected} />
        {selected && <AnchorCard anchor={selected} />}
        <Events />
      </aside>
    </div>
  );
}

const load_first_run = () => import('./start/first_run').then((m) => m.FirstRun);
function NoFlight() {
  const { part: FirstRun } = useLater(load_first_run);
  return FirstRun ? <FirstRun /> : null;
}

function Waiting() {
  return (
    <div class="empty">
      <h1 class="sr">Live flight</h1>
      <p role="status">
        {me.value === null
          ? 'Sign in to see the flights of this server.'
          : not_loaded_words(link.value, link.value === 'late')}
      </p>
    </div>
  );
}

const RATE_STALE_MS = 5000;
function Progress() {
  tick.value;
  const m = current_mission.value!,
    scene = current_scene(),
    list = ordered_missions.value;
  const names = told_apart(list),
    running = m.state === 'recording',
    lost = link.value === 'lost';
  const { done, gave_up, total } = done_count(scene, m);
  const s =
    m.started_us === null
      ? null
      : ((scene?.pose?.value.t_us ?? (running ? known_until_us() : m.t_us)) - m.started_us) / 1e6;
  const stale = lost || now_ms() - (scene?.state_at_ms ?? 0) > 5000;
  const cls = stale && running ? 'stale' : '';
  return (
    <section class="sec-p" data-testid="progress">
      <div class="hd">
        <h2>Flight</h2>
        {lost ? (
          <span class="now">
            <Chip shape="off" tone="off" word="LAST KNOWN" />
          </span>
        ) : running ? (
          <Chip shape="ok" tone="ok" word="RECORDING" />
        ) : (
          <Chip shape="off" tone="off" word={m.state.toUpperCase()} />
        )}
      </div>
      {list.length > 1 ? (
        <label class="pick">
          <span class="sr">Flight to show</span>
          <select
            data-testid="mission-picker"
            value={mission_id.value ?? ''}
            onChange={(e) => {
              chosen_mission.value = e.currentTarget.value;
              chosen_anchor.value = null;
            }}
          >
            {list.map((x) => (
              <option key={x.mission} value={x.mission}>
                {names.get(x) || x.mission.slice(-8)}
                {x.state === 'recording' ? ' (recording)' : ''}
              </option>
            ))}
          </select>
        </label>
      ) : (
        <p class="flightname">{m.name}</p>
      )}
      <dl class="kv">
        <div>
          <dt>Anchors done</dt>
          <dd class={cls}>
            {done} of {total}
            {gave_up > 0 && <span class="u caution"> {gave_up} given up</span>}
            <Pips done={done} total={total} />
          </dd>
        </div>
        <div>
          <dt>Recorded</dt>
          <dd class={cls}>
            <span class="n">{clock(s)}</span>
          </dd>
        </div>
        <div>
          <dt>Ranges</dt>
          <dd class={cls}>
            <span class="n">{grouped(m.n_ranges)}</span>
          </dd>
        </div>
        <div>
          <dt>Rate</dt>
          <dd class={running && now_ms() - (scene?.range_at_ms ?? -Infinity) > RATE_STALE_MS ? 'stale' : cls}>
            <Q v={running ? fixed(m.range_rate_hz, 0) : '–'} u="Hz" />
          </dd>
        </div>
      </dl>
    </section>
  );
}
const Pips = ({ done, total }: { done: number; total: number }) =>
  total > 0 && total <= 16 ? (
    <span class="pips" aria-hidden="true">
      {Array.from({ length: total }, (_, i) => (
        <i key={i} class={i < done ? 'd' : ''} />
      ))}
    </span>
  ) : null;

function Band() {
  tick.value;
  const scene = current_scene(),
    p = scene?.pose?.value,
    r = scene?.rtk?.value,
    now = now_ms(),
    running = current_mission.value?.state === 'recording';
  const lost = link.value === 'lost';
  const pose_cls =
    scene?.pose && running && (lost || now - scene.pose.at_ms > 1000) ? 'v stale' : running ? 'v' : 'v ended';
  const rtk_cls =
    scene?.rtk && running && (lost || now - scene.rtk.at_ms > 2000) ? 'v stale' : running ? 'v' : 'v ended';
  const sigma = r?.sigma_m ?? p?.sigma_m;
  return (
    <dl class="band" data-testid="rtk-card">
      <div>
        <dt>Height above origin</dt>
        <dd class={pose_cls}>
          <Q v={fixed(p?.enu_m?.[2], 2)} u="m" />
        </dd>
      </div>
      <div>
        <dt>Speed</dt>
        <dd class={pose_cls}>
          <Q v={fixed(p?.speed_mps, 1)} u="m/s" />
        </dd>
      </div>
      <div>
        <dt>Heading</dt>
        <dd class={pose_cls}>
          <Q v={bearing(p?.heading_deg)} u="°" />
        </dd>
      </div>
      <div class="opt">
        <dt>East, north</dt>
        <dd class={pose_cls}>
          <Q v={p?.enu_m ? `${fixed(p.enu_m[0], 1)}, ${fixed(p.enu_m[1], 1)}` : '–'} u="m" />
        </dd>
      </div>
      <div>
        <dt>Satellites</dt>
        <dd class={rtk_cls}>
          <span class="n">{fixed(r?.satellites, 0)}</span>
        </dd>
      </div>
      <div>
        <dt>Correction age</dt>
        <dd class={rtk_cls}>
          <Q v={fixed(r?.correction_age_s, 1)} u="s" />
        </dd>
      </div>
      <div>
        <dt>σ E, N, U (1σ)</dt>
        <dd class={rtk_cls}>
          <Q v={sigma ? sigma.map((x) => millimetres(x)).join(', ') : '–'} u="mm" />
        </dd>
      </div>
    </dl>
  );
}

function Legend() {
  const line = (colour: string, dash = '', width = 2.4) => (
    <svg viewBox="0 0 30 12" aria-hidden="true">
      <path
        d="M1 6h28"
        fill="none"
        style={{
          stroke: `var(--${colour})`,
          strokeDasharray: dash,
          strokeWidth: width,
          strokeLinecap: dash.startsWith('.1') ? 'round' : 'butt',
        }}
      />
    </svg>
  );
  const ring = (colour: string, dash = '') => (
    <svg viewBox="0 0 30 12" aria-hidden="true">
      <ellipse
        cx="15"
        cy="6"
        rx="12"
        ry="5"
        style={{
          stroke: `var(--${colour})`,
          fill: `var(--${colour})`,
          fillOpacity: dash ? 0.04 : 0.13,
          strokeWidth: 1.8,
          strokeDasharray: dash,
        }}
      />
    </svg>
  );
  return (
    <div class="mapfoot" data-testid="legend">
      <b>Range</b>
      <span>{line('ok')}LOS</span>
      <span>{line('caution', '7 4')}NLOS</span>
      <span>{line('off', '1.5 4')}unclear</span>
      <em />
      <b>Trail</b>
      <span>{line('ok')}FIX</span>
      <span>{line('caution', '6 4', 3)}FLOAT</span>
      <span>{line('bad', '.1 6', 4)}SINGLE</span>
      <span class="opt">
        <em />
        <b>Anchor</b>
        {ring('info')}95 %
      </span>
      <span class="opt">{ring('caution', '3 3')}mirror</span>
    </div>
  );
}
