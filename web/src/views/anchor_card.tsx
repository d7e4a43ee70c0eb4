/// The selected anchor beside the map: state, why it is not done, its curve, its ellipse at true scale, its covariance.
import type { EstimateMsg } from '../live/messages';
import { sigma_h, sigma_v } from '../map/enu';
import { shown_estimate, task_of, task_reason } from '../state/done';
import { replayed, watched_mission, watched_scene, now_ms, tick, watched_lost } from '../state/store';
import { accuracy, age, fixed, metres, percent } from '../ui/format';
import { Chip, Q, StatusChip } from '../ui/marks';
import { useLater } from '../ui/use_later';
import { why_not_done } from '../ui/words';
import { HoldButton } from './flight/hold_button';
import { lease, order } from './flight/lease';
import { flying } from './flight/words';
import { Covariance, Loupe } from './loupe';

const load_convergence = () => import('./convergence').then((m) => m.Convergence);

export function AnchorCard({ anchor }: { anchor: string }) {
  tick.value;
  const { part: Convergence } = useLater(load_convergence);
  const scene = watched_scene(),
    latest = scene?.anchors.get(anchor);
  if (!latest)
    return (
      <section class="sec-p">
        <div class="hd">
          <h2>{anchor}</h2>
          <Chip shape="off" tone="off" word="UNSEEN" />
        </div>
        <p class="why">Ranges arrive, an estimate has not been made yet.</p>
      </section>
    );
  const e = shown_estimate(scene, anchor)!,
    old_ms = now_ms() - latest.at_ms,
    stale = watched_mission.value?.state === 'recording' && (watched_lost() || old_ms > 10_000);
  const why = why_not_done(e, task_reason(scene?.procedure?.value, anchor));
  return (
    <section class="sec-p" data-testid="anchor-card">
      <div class="hd">
        <h2>
          <a href={`#/anchors/${anchor}`}>{anchor}</a>
        </h2>
        {stale && <span class="age">{age(old_ms)} old</span>}
        <StatusChip status={e.status} />
      </div>
      {why && (
        <div
          class={`callout says ${e.status === 'ambiguous' || e.status === 'gave_up' ? 'caution' : e.status === 'moved' ? 'bad' : 'info'}`}
        >
          <b>{why.title}</b>
          <p>{why.text}</p>
        </div>
      )}
      {e.enu_m && <Figures e={e} stale={stale} />}
      {!replayed.value && <WorkInFlight e={e} />}
      <div class="pair detail">
        {Convergence ? <Convergence anchor={anchor} /> : <figure class="conv" />}
        {e.ellipse95 && <Loupe e={e} />}
      </div>
      <div class="detail">{e.cov_enu_m2 && <Covariance c={e.cov_enu_m2} />}</div>
    </section>
  );
}

/// A person may be content with an anchor before the procedure is, or give it up: nothing more is flown for it. Only a position that is determined
/// can be accepted.
function WorkInFlight({ e }: { e: EstimateMsg }) {
  const p = watched_scene()?.procedure?.value,
    task = task_of(p, e.anchor),
    off = watched_lost() || lease.value?.mission !== e.mission;
  if (!p || !task || !flying(p)) return null;
  if (task.ended_by)
    return (
      <p class="why" data-testid="work-ended">
        {task.accepted ? 'Accepted' : 'Given up'} by {task.ended_by}: nothing more is flown for it.{' '}
        {!off && (
          <button class="btn small" onClick={() => void order(e.mission, e.anchor, 'reopen')}>
            Work on it again
          </button>
        )}
      </p>
    );
  if (task.done || off) return null;
  const accepts = e.verdict === 'ok' && e.enu_m !== null;
  return (
    <p class="accept">
      <HoldButton
        key={`${e.anchor} ${accepts}`} // what comes under the finger meanwhile is not done
        testid={accepts ? 'accept-anchor' : 'give-up-anchor'}
        disabled={false}
        note="hold 1 s"
        onConfirm={() => void order(e.mission, e.anchor, accepts ? 'accept' : 'give_up')}
      >
        {accepts ? `Accept ${e.anchor} as it is` : `Give up ${e.anchor}`}
      </HoldButton>
    </p>
  );
}

export function Figures({ e, stale }: { e: EstimateMsg; stale: boolean }) {
  const cls = stale ? 'stale' : '';
  return (
    <dl class="kv s">
      <div>
        <dt>E, N, U</dt>
        <dd class={cls}>
          <Q v={e.enu_m ? e.enu_m.map((x) => metres(x)).join(', ') : '–'} u="m" />
        </dd>
      </div>
      <div>
        <dt>95 % horizontal</dt>
        <dd class={cls}>{accuracy(e.h95_m)}</dd>
      </div>
      <div>
        <dt>95 % vertical</dt>
        <dd class={cls}>{accuracy(e.v95_m)}</dd>
      </div>
      <div>
        <dt>σ h, v (1σ)</dt>
        <dd class={cls}>
          <Q v={`${fixed(sigma_h(e.cov_enu_m2), 3)}, ${fixed(sigma_v(e.cov_enu_m2), 3)}`} u="m" />
        </dd>
      </div>
      <div title={`root of the trace; eq 8.5 of the dissertation, the trace itself, is ${fixed(e.gdop_trace, 2)}`}>
        <dt>GDOP</dt>
        <dd class={cls}>{fixed(e.gdop, 2)}</dd>
      </div>
      <div>
        <dt>Ranges</dt>
        <dd class={cls}>
          {e.n_ranges}
          {e.n_refused > 0 && <span class="u"> {e.n_refused} rejected</span>}
        </dd>
      </div>
      {e.mirror && (
        <div>
          <dt>Odds, here to mirror</dt>
          <dd class={cls}>
            {percent(e.probability)} % to {percent(e.mirror.probability)} %
          </dd>
        </div>
      )}
    </dl>
  );
}
