/// Where the flight stands in its procedure and why; where it goes next and what that is worth; the turn and the height search while they run. Of a
/// flight that is on, or of a moment of a stored one.
import type { ComponentChildren } from 'preact';
import '../desk.css';
import type { GridMsg, ProcedureMsg, ProfileMsg, Step } from '../../live/flight_messages';
import { done_count } from '../../state/done';
import { now_ms, replayed, tick, watched_lost, watched_mission, watched_scene } from '../../state/store';
import { bearing, clock, fixed } from '../../ui/format';
import { Chip, Mark, Q } from '../../ui/marks';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';
import { Aside, load_flight_time } from './aside';
import {
  flying,
  grid_measure,
  grid_outcome,
  next_step,
  stage_of,
  STATUS_LOOK,
  STEP_WORDS,
  missed_words,
  TRACK,
  value_words,
  turn_runs,
} from './words';

/// A reason of the server as a sentence: its words for refusals carry underscores.
export const sentence = (reason: string): string =>
  `${reason[0]!.toUpperCase()}${reason.slice(1).replaceAll('_', ' ')}${/[.!?]$/.test(reason) ? '' : '.'}`;

export function Procedure() {
  tick.value;
  const scene = watched_scene(),
    stored = replayed.value !== null,
    latest = scene?.procedure;
  if (!latest) return null;
  const p = latest.value,
    stale = watched_lost() || (!stored && now_ms() - latest.at_ms > 5000),
    counted = done_count(scene, watched_mission.value),
    missed = missed_words(p.status, counted),
    [shape, tone, word] = missed ? (['caution', 'caution', STATUS_LOOK[p.status][2]] as const) : STATUS_LOOK[p.status],
    next = next_step(p.step);
  const since =
    p.in_step_s === null || !flying(p) ? null : p.in_step_s + (stale ? 0 : (now_ms() - latest.at_ms) / 1000);
  return (
    <section class="sec-p" data-testid="procedure">
      <div class="hd">
        <h2>Procedure</h2>
        {stale && flying(p) ? (
          <span class="now">
            <Chip shape="off" tone="off" word="LAST KNOWN" />
          </span>
        ) : (
          <Chip shape={shape} tone={tone} word={word} />
        )}
        <span class="meta">{p.iteration > 0 ? `iteration ${p.iteration}` : p.plan_name}</span>
      </div>
      <Stage
        step={p.step}
        part={p.step === 'step_to_waypoint' && p.k > 0 ? ` (${p.part} of ${p.k})` : ''}
        in_step_s={since}
        stale={stale}
      >
        {next && flying(p) && (
          <>
            <Mark shape="off" tone="off" />
            <span>{STEP_WORDS[next]}</span>
            <span class="t says">
              {p.step_limit_s !== null && since !== null && p.step_limit_s > since
                ? `within ${fixed(p.step_limit_s - since, 0)} s`
                : ''}
            </span>
          </>
        )}
      </Stage>
      {p.status === 'aborted' ? (
        <div class="callout bad" role="alert" data-testid="flight-aborted">
          <b>The flight ended before its plan was flown.</b> {sentence(p.ended || p.reason)}
        </div>
      ) : (
        p.reason && <p class="why says">{sentence(p.reason)}</p>
      )}
      {missed && (
        <p class="callout caution says" data-testid="flight-missed">
          {missed}
        </p>
      )}
      {(p.status === 'done' || p.status === 'aborted') && <Aside load={load_flight_time} mission={p.mission} />}
      {p.ended && flying(p) && p.ended !== p.reason && <p class="why says">Why it returns: {p.ended}.</p>}
      {p.drone?.taken_over && (
        <div class="callout caution">
          <b>The pilot has taken over by remote control.</b> No target is sent until the flight is started or resumed
          again.
        </div>
      )}
      {p.mode === 'manual' && p.target && flying(p) && (
        <div class="callout says">
          <b>
            Fly by hand: {fixed(p.distance_m, 1)} m to go
            {p.target.height_m === null ? '' : `, to ${fixed(p.target.height_m, 1)} m above ground`}
            {p.target.heading_deg === null ? '' : `, nose ${bearing(p.target.heading_deg)}°`}.
          </b>{' '}
          The flight continues automatically when RTK shows that you are there.
        </div>
      )}
      <NotDone p={p} gave_up={counted.gave_up} />
    </section>
  );
}

/// Step and time in it, and how far the flight is; of a flight that is on, or of a moment of a stored one.
export const Stage = ({
  step,
  part = '',
  in_step_s,
  stale = false,
  children,
}: {
  step: Step;
  part?: string;
  in_step_s: number | null;
  stale?: boolean;
  children?: ComponentChildren;
}) => (
  <>
    <Track step={step} />
    <div class="steps">
      <Mark shape="estimating" tone="ink" />
      <span class="cur">
        {STEP_WORDS[step]}
        {part}
      </span>
      <span class={`t cur ${stale ? 'stale' : ''}`}>
        {in_step_s === null ? '' : in_step_s < 90 ? <Q v={fixed(in_step_s, 0)} u="s" /> : clock(in_step_s, true)}
      </span>
      {children}
    </div>
  </>
);
/// How far the flight is in its eleven stages.
function Track({ step }: { step: Step }) {
  const at = stage_of(step);
  return at < 0 ? null : (
    <div class="track" role="img" aria-label={`Stage ${at + 1} of ${TRACK.length}`}>
      {TRACK.map((_, i) => (
        <i key={i} class={i < at ? 'd' : i === at ? 'c' : ''} />
      ))}
    </div>
  );
}

/// What the procedure still works for; what it gave up is not among it, and is not done either.
function NotDone({ p, gave_up }: { p: ProcedureMsg; gave_up: number }) {
  const open = p.anchors.filter((a) => !a.done && a.why);
  if (!open.length) return null;
  return (
    <details class="notdone says">
      <summary>
        {open.length} of {p.anchors.length} anchors still open{gave_up > 0 && `, ${gave_up} given up`}
      </summary>
      <ul>
        {open.map((a) => (
          <li key={a.anchor}>
            <b>{a.anchor}</b> {a.why}
            {a.at_edge && <span class="sub"> Its height is at an end of the height search, and may be beyond it.</span>}
            {a.no_lobe && (
              <span class="sub">
                {' '}
                The turn found no direction to it from this distance: no height search until the aircraft is nearer.
              </span>
            )}
          </li>
        ))}
      </ul>
    </details>
  );
}

export function NextPoint() {
  tick.value;
  const scene = watched_scene(),
    g = scene?.grid?.value,
    p = scene?.procedure?.value;
  if (!g || !p || !flying(p)) return null;
  const chosen = g.chosen === null ? null : g.candidates[g.chosen];
  const outcome = grid_outcome(g),
    measure = grid_measure(g),
    fly = chosen?.plan_m && p.target && outcome.flown ? p.distance_m : null;
  return (
    <section class="sec-p" data-testid="next-point">
      <div class="hd">
        <h2 class="says">Next point, P{g.iteration + 1}</h2>
        <Chip shape={outcome.shape} tone={outcome.tone} word={outcome.word} />
      </div>
      <dl class="kv np2">
        <div>
          <dt>Fly</dt>
          <dd>{fly === null ? '–' : <Q v={fixed(fly, 1)} u="m" />}</dd>
        </div>
        <div>
          <dt>{measure}</dt>
          <dd>
            {value_words(g, g.value_before)} → {value_words(g, g.predicted ?? chosen?.value ?? null)}
          </dd>
        </div>
        {g.reached !== null && (
          <div>
            <dt>Reached at the last point</dt>
            <dd>{value_words(g, g.reached)}</dd>
          </div>
        )}
      </dl>
      {outcome.why && <p class="why says">{sentence(outcome.why)}</p>}
      {g.reason && <p class="why says">{sentence(g.reason)}</p>}
      <Ramp g={g} />
      <details class="candidates">
        <summary class="says">{g.candidates.length} candidates</summary>
        <table class="tbl">
          <caption class="sr">Candidates of the last decision, best first</caption>
          <thead>
            <tr>
              <th scope="col">No.</th>
              <th scope="col" class="num">
                {measure}
              </th>
              <th scope="col" class="num">
                Height above ground, m
              </th>
              <th scope="col">Rejected</th>
            </tr>
          </thead>
          <tbody>
            {g.candidates
              .map((c, i) => ({ c, i }))
              .sort((a, b) => (a.c.value ?? Infinity) - (b.c.value ?? Infinity))
              .slice(0, 40)
              .map(({ c, i }) => (
                <tr key={i} class={i === g.chosen ? 'sel' : ''}>
                  <th scope="row">{i + 1}</th>
                  <td class="num">{value_words(g, c.value)}</td>
                  <td class="num">{fixed(c.height_m, 1)}</td>
                  <td>{c.refused?.replaceAll('_', ' ') ?? ''}</td>
                </tr>
              ))}
          </tbody>
        </table>
      </details>
    </section>
  );
}
function Ramp({ g }: { g: GridMsg }) {
  const values = g.candidates.flatMap((c) => (c.value === null || c.refused ? [] : [c.value]));
  if (values.length < 2) return null;
  return (
    <div class="ramp says">
      <span>{value_words(g, Math.min(...values))} lowest</span>
      <span class="sw" aria-hidden="true">
        {[0, 1, 2, 3, 4, 5].map((i) => (
          <i key={i} class={`g${i}`} />
        ))}
      </span>
      <span>{value_words(g, Math.max(...values))}</span>
    </div>
  );
}

export function TurnAndHeight() {
  tick.value;
  const scene = watched_scene(),
    step = scene?.procedure?.value.step;
  const turns = step === 'turn' ? [...(scene?.turns.values() ?? [])].map((t) => t.value) : [],
    heights = step === 'height_search' ? [...(scene?.heights.values() ?? [])].map((t) => t.value) : [];
  return (
    <>
      {turns
        .filter((t) => t.samples.length > 2)
        .slice(0, 2)
        .map((t) => (
          <TurnPolar key={t.anchor} t={t} />
        ))}
      {heights
        .filter((h) => h.samples.length > 1)
        .slice(0, 2)
        .map((h) => (
          <HeightProfile key={h.anchor} h={h} />
        ))}
    </>
  );
}

/// RSS round the compass, north up; the spoke is the bearing taken, with its sigma as a wedge.
function TurnPolar({ t }: { t: ProfileMsg }) {
  const rss = t.samples.map(([, r]) => r),
    lo = Math.min(...rss) - 3,
    hi = Math.max(...rss) + 1;
  return (
    <section class="sec-p" data-testid="turn-polar">
      <div class="hd">
        <h2>Turn, {t.anchor}</h2>
        <span class="meta">
          {t.best === null ? 'no bearing yet' : `bearing ${bearing(t.best)}° ± ${fixed(t.sigma, 0)}°`}
        </span>
      </div>
      <Drawing
        cls="scatter"
        label={`RSS over heading for ${t.anchor}, ${t.samples.length} samples${t.best === null ? '' : `; bearing ${fixed(t.best, 0)} degrees`}`}
        draw={(w, h) => {
          const cx = w / 2,
            cy = h / 2,
            r = Math.max(0, Math.min(w, h) / 2 - 18),
            at = (deg: number, v: number): [number, number] => {
              const d = (r * Math.max(0, v - lo)) / (hi - lo),
                a = (deg * Math.PI) / 180;
              return [cx + d * Math.sin(a), cy - d * Math.cos(a)];
            };
          return (
            <>
              {[0.33, 0.66, 1].map((f) => (
                <circle key={f} class="ringl" cx={cx} cy={cy} r={r * f} />
              ))}
              {(['N', 'E', 'S', 'W'] as const).map((name, i) => {
                const [x, y] = at(i * 90, hi + (hi - lo) * 0.09);
                return (
                  <text key={name} class="ticktext" x={x} y={y + 4} text-anchor="middle">
                    {name}
                  </text>
                );
              })}
              {turn_runs(t.samples).map((run, i) => (
                <path key={i} class="s main" d={line(run.map(([deg, v]) => at(deg, v)))} />
              ))}
              {t.best !== null && t.sigma !== null && (
                <path
                  class="wedge"
                  d={`M${cx} ${cy}L${at(t.best - t.sigma, hi).join(' ')}A${r} ${r} 0 0 1 ${at(t.best + t.sigma, hi).join(' ')}Z`}
                />
              )}
              {t.best !== null && <path class="goal" d={`M${cx} ${cy}L${at(t.best, hi).join(' ')}`} />}
            </>
          );
        }}
      />
    </section>
  );
}

function HeightProfile({ h: p }: { h: ProfileMsg }) {
  const heights = p.samples.map(([z]) => z),
    rss = p.samples.map(([, r]) => r),
    lo = Math.min(...heights) - 0.3,
    hi = Math.max(...heights) + 0.3,
    [r0, r1] = [Math.min(...rss) - 1, Math.max(...rss) + 1];
  return (
    <section class="sec-p" data-testid="height-profile">
      <div class="hd">
        <h2>Height, {p.anchor}</h2>
        <span class="meta">
          {p.best === null ? 'no height yet' : `${fixed(p.best, 1)} m above ground ± ${fixed(p.sigma, 1)} m`}
        </span>
      </div>
      <Drawing
        cls="roc"
        label={`RSS over height for ${p.anchor}${p.best === null ? '' : `; peak at ${fixed(p.best, 1)} m`}`}
        draw={(w, h) => {
          const f = { w, h, left: room(44), right: 10, top: 8, bottom: room(22) },
            x = scale([r0, r1], [f.left, w - f.right]),
            y = scale([lo, hi], [h - f.bottom, f.top]);
          return (
            <>
              <Axes
                f={f}
                x={x}
                y={y}
                xs={ticks(r0, r1, 4)}
                ys={ticks(lo, hi, 3)}
                xw={(v) => `${fixed(v, 0)} dBm`}
                yw={(v) => `${fixed(v, 1)} m`}
              />
              {p.samples.map(([z, r], i) => (
                <circle key={i} class="dot" cx={x(r)} cy={y(z)} r="3" />
              ))}
              {p.best !== null && <path class="goal" d={`M${f.left} ${y(p.best)}H${w - f.right}`} />}
            </>
          );
        }}
      />
    </section>
  );
}
