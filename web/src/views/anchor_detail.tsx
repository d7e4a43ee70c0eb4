import { over_goal_words, type AnchorRow, type Budget } from '../api/anchors';
import { age, accuracy, bearing, date, dms, fixed, latlon, metres, percent, plain } from '../ui/format';
import { CopyBox } from '../ui/copy_box';
import { Mark, Q, StatusChip } from '../ui/marks';
import { gate_limit, gate_sentence, gate_value } from '../ui/gates';
import { sentence, why_not_done, SOURCE_WORDS } from '../ui/words';
import { choice } from './anchor_columns';
import { AnchorPast } from './anchor_past';
import { AnchorResiduals } from './anchor_residuals';
import { Convergence } from './convergence';
import { FacilityPanel } from './facility';
import { Covariance, Loupe } from './loupe';
import type { EstimateMsg } from '../live/messages';
import { enu_from_geodetic } from '../map/enu';
import { shown_estimate, task_reason } from '../state/done';
import { current_mission, current_scene, now_ms, tick } from '../state/store';

function ErrorBudget({ budget }: { budget: Budget }) {
  return (
    <section class="sec-p" data-testid="error-budget">
      <h3>Error budget</h3>
      <dl class="kv s">
        {budget.shares.map((s) => (
          <div key={s.source}>
            <dt>{SOURCE_WORDS[s.source] ?? s.source.replaceAll('_', ' ')}</dt>
            <dd>{percent(s.share)} %</dd>
          </div>
        ))}
      </dl>
      <p class="mut says">What would help most: {budget.help}.</p>
    </section>
  );
}

/// `draft`: of a calibration that is not published: it has no facility data yet.
export function AnchorDetail({
  row: r,
  live,
  draft = false,
  changed,
}: {
  row: AnchorRow;
  live: boolean;
  draft?: boolean;
  changed: () => void;
}) {
  tick.value;
  const why = why_not_done(r, live ? task_reason(current_scene()?.procedure?.value, r.anchor) : ''),
    latest = live ? current_scene()?.anchors.get(r.anchor) : undefined;
  const geo = r.lat !== null && r.lon !== null;
  return (
    <div data-testid="anchor-detail">
      <section class="sec-p">
        <div class="hd big">
          <h2>{r.anchor}</h2>
          {r.name && <span class="meta">{r.name}</span>}
          <StatusChip status={r.status} />
          <span class="grow" />
          {latest && <span class="meta">{updated_words(latest.value, latest.at_ms)}</span>}
        </div>
        {why && (
          <div
            class={`callout says ${r.status === 'ambiguous' || r.status === 'gave_up' ? 'caution' : r.status === 'moved' ? 'bad' : 'info'}`}
            data-testid="why"
          >
            <b>{why.title}</b>
            <p>{why.text}</p>
          </div>
        )}
        <dl class="kv pos">
          {geo && (
            <div>
              <dt>Latitude</dt>
              <dd data-testid="latitude">
                <Degrees v={r.lat} axis="lat" />
              </dd>
            </div>
          )}
          {geo && (
            <div>
              <dt>Longitude</dt>
              <dd data-testid="longitude">
                <Degrees v={r.lon} axis="lon" />
              </dd>
            </div>
          )}
          {geo && (
            <div>
              <dt>Height above ellipsoid</dt>
              <dd>
                <Q v={metres(r.h_m)} u="m" />
              </dd>
            </div>
          )}
          {r.enu_m && (live || !geo) && (
            <div>
              <dt>{geo ? 'E, N, U' : 'x, y, z'}</dt>
              <dd>
                <Q v={r.enu_m.map((x) => metres(x)).join(', ')} u="m" />
              </dd>
            </div>
          )}
        </dl>
        <dl class="kv s">
          <div>
            <dt>Relative to the base, 95 %</dt>
            <dd>{accuracy(r.h95_m)}</dd>
          </div>
          <div>
            <dt>Vertical, 95 %</dt>
            <dd>{accuracy(r.v95_m)}</dd>
          </div>
          <div>
            <dt>Absolute, 95 %</dt>
            <dd>{r.absolute_h95_m === null ? <span class="mut">base not stated</span> : accuracy(r.absolute_h95_m)}</dd>
          </div>
          {r.calibrated_at && (
            <div>
              <dt>Calibrated</dt>
              <dd>{date(r.calibrated_at)}</dd>
            </div>
          )}
          {r.crs && (
            <div>
              <dt>Frame</dt>
              <dd>{r.crs}</dd>
            </div>
          )}
        </dl>
        {geo && (
          <CopyBox
            label="Copy latitude, longitude, height"
            text={`${plain(r.lat, 9)}, ${plain(r.lon, 9)}, ${plain(r.h_m, 3)}`}
          />
        )}
        {r.mirror && <Twin r={r} />}
      </section>
      {!live && <Running published={r} draft={draft} />}
      {r.budget && r.budget.shares.length > 0 && <ErrorBudget budget={r.budget} />}
      <div class="two">
        <Gates r={r} />
        <section class="sec-p">
          {r.ellipse95 && (
            <>
              <h3>
                95 % ellipse{' '}
                <span class="mut says">
                  {fixed(r.ellipse95.major_m, 3)} × {fixed(r.ellipse95.minor_m, 3)} m @{' '}
                  {bearing(r.ellipse95.azimuth_deg)}°
                </span>
              </h3>
              <Loupe e={r} size={170} />
            </>
          )}
          {r.cov_enu_m2 && <Covariance c={r.cov_enu_m2} />}
        </section>
      </div>
      <AnchorResiduals row={r} mission={live ? r.mission || null : null} />
      {!draft && <FacilityPanel anchor={r.anchor} changed={changed} />}
      {!live && <AnchorPast anchor={r.anchor} />}
      {live && (
        <section class="sec-p">
          <Convergence anchor={r.anchor} />
        </section>
      )}
    </div>
  );
}

/// Of a flight that is over an estimate is as old as its data, whenever this page came to know of it.
function updated_words(e: EstimateMsg, at_ms: number): string {
  const m = current_mission.value;
  if (m?.state === 'recording') return `updated ${age(now_ms() - at_ms)} ago`;
  return e.t_us > 0 ? `of ${date(new Date(e.t_us / 1000).toISOString())}, flight ended` : 'flight ended';
}

/// What the flight that is shown makes of it now, beside what is published: how far apart, and how well either is known.
function Running({ published: p, draft }: { published: AnchorRow; draft: boolean }) {
  const scene = current_scene(),
    e = shown_estimate(scene, p.anchor),
    heard = scene?.anchors.get(p.anchor);
  if (!e || !heard) return null;
  const apart =
    e.lat !== null && e.lon !== null && p.lat !== null && p.lon !== null
      ? enu_from_geodetic({ lon: e.lon, lat: e.lat, h_m: e.h_m ?? 0 }, { lon: p.lon, lat: p.lat, h_m: p.h_m ?? 0 })
      : null;
  return (
    <section class="sec-p" data-testid="running-estimate">
      <div class="hd">
        <h3>Running estimate</h3>
        <StatusChip status={e.status} />
        <span class="meta">
          {current_mission.value?.name}, {updated_words(e, heard.at_ms)}
        </span>
      </div>
      <dl class="kv s">
        {apart && (
          <div>
            <dt>From {draft ? 'the calibration' : 'published'}, horizontal</dt>
            <dd>
              <Q v={fixed(Math.hypot(apart[0], apart[1]), 3)} u="m" />
            </dd>
          </div>
        )}
        {apart && (
          <div>
            <dt>Vertical</dt>
            <dd>
              <Q v={fixed(apart[2], 3)} u="m" />
            </dd>
          </div>
        )}
        <div>
          <dt>95 % horizontal</dt>
          <dd>{accuracy(e.h95_m)}</dd>
        </div>
        <div>
          <dt>95 % vertical</dt>
          <dd>{accuracy(e.v95_m)}</dd>
        </div>
      </dl>
    </section>
  );
}

const Degrees = ({ v, axis }: { v: number | null; axis: 'lat' | 'lon' }) =>
  choice.value.dms ? <span class="q n">{dms(v, axis)}</span> : <Q v={latlon(v)} u="°" />;

function Twin({ r }: { r: AnchorRow }) {
  const m = r.mirror!;
  return (
    <p class="why says" data-testid="mirror">
      <Mark shape="half" tone="caution" /> Mirror solution
      {m.probability === null ? '' : `, ${percent(m.probability)} %`}:{' '}
      <span class="n">
        {m.lat !== null ? `${latlon(m.lat)}°, ${latlon(m.lon)}°` : (m.enu_m?.map((x) => metres(x)).join(', ') ?? '–')}
      </span>
      . Odds {percent(r.probability)} % to {percent(m.probability)} %.
    </p>
  );
}

/// What the server held the position against, with its limits: the same for a running estimate and for a calibration.
function Gates({ r }: { r: AnchorRow }) {
  const passed = r.gates.filter((g) => g.passed).length;
  return (
    <section class="sec-p">
      {r.gates.length === 0 ? (
        <p class="why" data-testid="gates">
          No acceptance gate has been run for this position yet.
        </p>
      ) : (
        <table class="gates" data-testid="gates">
          <caption>
            Acceptance gates{' '}
            <span class="mut says">
              {passed} of {r.gates.length} pass
            </span>
          </caption>
          <thead class="sr">
            <tr>
              <th scope="col">Pass</th>
              <th scope="col">What</th>
              <th scope="col">Value</th>
              <th scope="col">Limit</th>
            </tr>
          </thead>
          <tbody>
            {r.gates.map((g) => (
              <tr key={g.name} title={g.why}>
                <td>
                  <Mark shape={g.passed ? 'ok' : 'bad'} tone={g.passed ? 'ok' : 'bad'} />
                  <span class="sr">{g.passed ? 'passes' : 'fails'}</span>
                </td>
                <th scope="row">
                  {gate_sentence(g)}
                  {!g.passed && g.why && <span class="mut block">{g.why}</span>}
                </th>
                <td class={`num ${g.passed ? '' : 'bad'}`}>{gate_value(g)}</td>
                <td class="num mut">{gate_limit(g)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {r.goal && (
        <p class="why" data-testid="goal">
          <Mark shape={r.goal.reached ? 'ok' : 'caution'} tone={r.goal.reached ? 'ok' : 'caution'} />{' '}
          {r.goal.reached ? `Within the ${r.goal.words}.` : sentence(over_goal_words(r))}
        </p>
      )}
      {r.override && (
        <p class="why" data-testid="override">
          <Mark shape="caution" tone="caution" /> Published by a person although a gate failed: {r.override}
        </p>
      )}
    </section>
  );
}
