import type { AnchorRow, Budget } from '../api/anchors';
import { age, accuracy, bearing, date, dms, fixed, latlon, metres, percent, plain } from '../ui/format';
import { CopyBox } from '../ui/copy_box';
import { Mark, Q, StatusChip } from '../ui/marks';
import { GATES, gate_words, why_not_done, SOURCE_WORDS, VERDICT_WORDS } from '../ui/words';
import { choice } from './anchor_columns';
import { AnchorPast } from './anchor_past';
import { AnchorResiduals } from './anchor_residuals';
import { Convergence } from './convergence';
import { FacilityPanel } from './facility';
import { Covariance, Loupe } from './loupe';
import { current_scene, now_ms, tick } from '../state/store';

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
      <p class="mut">What would help most: {budget.help}.</p>
    </section>
  );
}

export function AnchorDetail({ row: r, live, changed }: { row: AnchorRow; live: boolean; changed: () => void }) {
  tick.value;
  const why = why_not_done(r),
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
          {latest && <span class="meta">updated {age(now_ms() - latest.at_ms)} ago</span>}
        </div>
        {why && (
          <div
            class={`callout ${r.status === 'ambiguous' ? 'caution' : r.status === 'moved' ? 'bad' : 'info'}`}
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
              <dt>Ellipsoidal h</dt>
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
      {r.budget && r.budget.shares.length > 0 && <ErrorBudget budget={r.budget} />}
      <div class="two">
        <Gates r={r} />
        <section class="sec-p">
          {r.ellipse95 && (
            <>
              <h3>
                95 % ellipse{' '}
                <span class="mut">
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
      <FacilityPanel anchor={r.anchor} changed={changed} />
      {!live && <AnchorPast anchor={r.anchor} />}
      {live && (
        <section class="sec-p">
          <Convergence anchor={r.anchor} />
        </section>
      )}
    </div>
  );
}

const Degrees = ({ v, axis }: { v: number | null; axis: 'lat' | 'lon' }) =>
  choice.value.dms ? <span class="q n">{dms(v, axis)}</span> : <Q v={latlon(v)} u="°" />;

function Twin({ r }: { r: AnchorRow }) {
  const m = r.mirror!;
  return (
    <p class="why" data-testid="mirror">
      <Mark shape="half" tone="caution" /> Mirror solution
      {m.probability === null ? '' : `, ${percent(m.probability)} %`}:{' '}
      <span class="n">
        {m.lat !== null ? `${latlon(m.lat)}°, ${latlon(m.lon)}°` : (m.enu_m?.map((x) => metres(x)).join(', ') ?? '–')}
      </span>
      . Odds {percent(r.probability)} to {percent(m.probability)}.
    </p>
  );
}

/// The gates of the server where it ran them; on a running estimate, what the page can hold against a limit itself. The verdict is always the server's.
function Gates({ r }: { r: AnchorRow }) {
  const list = r.gates.length ? run_gates(r) : running_gates(r),
    passed = list.filter((g) => g.ok === true).length;
  return (
    <section class="sec-p">
      <table class="gates" data-testid="gates">
        <caption>
          {r.gates.length ? 'Acceptance gates' : 'Quality'}{' '}
          <span class="mut">
            {passed} of {list.length} pass
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
          {list.map(({ name, value, limit, ok, why }) => (
            <tr key={name} title={why}>
              <td>
                <Mark shape={ok === null ? 'off' : ok ? 'ok' : 'bad'} tone={ok === null ? 'off' : ok ? 'ok' : 'bad'} />
                <span class="sr">{ok === null ? 'not known' : ok ? 'passes' : 'fails'}</span>
              </td>
              <th scope="row">
                {name}
                {ok === false && why && <span class="mut block">{why}</span>}
              </th>
              <td class={`num ${ok === false ? 'bad' : ''}`}>{value}</td>
              <td class="num mut">{limit}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {r.override && (
        <p class="why" data-testid="override">
          <Mark shape="caution" tone="caution" /> Published by a person although a gate failed: {r.override}
        </p>
      )}
    </section>
  );
}
interface Line {
  readonly name: string;
  readonly value: string;
  readonly limit: string;
  readonly ok: boolean | null;
  readonly why: string;
}
const brief = (v: number | null): string => (v === null ? '–' : fixed(v, Math.abs(v) < 10 ? 2 : 0));
const run_gates = (r: AnchorRow): Line[] =>
  r.gates.map((g) => ({
    name: gate_words(g.name),
    value: brief(g.value),
    limit: brief(g.limit),
    ok: g.passed,
    why: g.why,
  }));
function running_gates(r: AnchorRow): Line[] {
  const at_most = (name: string, v: number | null, limit: number, value: string, shown: string): Line => ({
    name,
    value,
    limit: `≤ ${shown}`,
    ok: v === null ? null : v <= limit,
    why: '',
  });
  return [
    { name: 'Verdict', value: VERDICT_WORDS[r.verdict], limit: '', ok: r.verdict === 'ok', why: '' },
    at_most('95 % horizontal', r.h95_m, GATES.h95_m, `${fixed(r.h95_m, 2)} m`, fixed(GATES.h95_m, 2)),
    at_most('95 % vertical', r.v95_m, GATES.v95_m, `${fixed(r.v95_m, 2)} m`, fixed(GATES.v95_m, 2)),
    at_most('GDOP', r.gdop, GATES.gdop, fixed(r.gdop, 2), fixed(GATES.gdop, 1)),
    {
      name: 'Ranges used',
      value: String(r.n_ranges),
      limit: `≥ ${GATES.n_ranges}`,
      ok: r.n_ranges >= GATES.n_ranges,
      why: '',
    },
    at_most(
      'Residual RMS',
      r.rms_residual_m,
      GATES.rms_residual_m,
      `${fixed(r.rms_residual_m === null ? null : r.rms_residual_m * 1000, 0)} mm`,
      String(GATES.rms_residual_m * 1000),
    ),
    at_most(
      'Mirror odds',
      r.mirror ? (r.mirror.probability ?? 1) : 0,
      GATES.mirror,
      r.mirror ? `${percent(r.mirror.probability)} %` : 'no mirror solution',
      String(GATES.mirror * 100),
    ),
  ];
}
