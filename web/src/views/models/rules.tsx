/// Rules: what decides without any learning, per data set, beside which a learned model must show its worth (tables 5.2 and 5.3).
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import {
  datasets as fetch_datasets,
  rules_of,
  type DatasetName,
  type Rates,
  type Rules as RulesOf,
} from '../../api/rules';
import { NotLoaded, useLoad } from '../../ui/empty';
import { fixed, grouped } from '../../ui/format';
import { Q } from '../../ui/marks';

const NAMES: Record<string, string> = {
  rss: 'RSS over distance',
  kurtosis: 'Kurtosis',
  mean_excess_delay: 'Mean excess delay',
  rms_delay: 'RMS delay spread',
  rms_delay_far: 'RMS delay spread, beyond 6.5 m',
  rms_delay_95: 'RMS delay spread, 95 % threshold',
  range_sd: 'Spread of repeated ranges',
  first_path: 'RX-FP difference',
  weighted: 'Weighted vote',
};

export function Rules() {
  const [sets, set_sets] = useState<readonly DatasetName[] | null>(null),
    [wanted, set_wanted] = useState<string | null>(null),
    [rules, set_rules] = useState<{ of: string; rules: RulesOf } | null>(null),
    [problem, set_problem] = useState('');
  useLoad(() => {
    fetch_datasets().then(
      (list) => {
        set_sets(list);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  const chosen = wanted ?? sets?.[0]?.id ?? null,
    shown = rules?.of === chosen ? rules.rules : null;
  useEffect(() => {
    if (!chosen) return;
    let gone = false;
    rules_of(chosen).then(
      (r) => {
        if (!gone) {
          set_rules({ of: chosen, rules: r });
          set_problem('');
        }
      },
      (e: unknown) => {
        if (!gone) set_problem(error_text(e));
      },
    );
    return () => {
      gone = true;
    };
  }, [chosen]);
  const rate = (r: Rates | null, of: 'los' | 'nlos') => (
    <Q v={fixed(r?.[`${of}_rate`] == null ? null : r[`${of}_rate`]! * 100, 1)} u="%" />
  );
  return (
    <section class="cell-p wide" data-testid="rules">
      <div class="hd">
        <h2>Correct decisions by rule</h2>
        {sets && sets.length > 0 && (
          <select aria-label="Data set" value={chosen ?? ''} onChange={(e) => set_wanted(e.currentTarget.value)}>
            {sets.map((d) => (
              <option key={d.id} value={d.id}>
                {d.name}
              </option>
            ))}
          </select>
        )}
        {shown && (
          <span class="meta">
            {grouped(shown.los_rows)} LOS, {grouped(shown.nlos_rows)} NLOS
          </span>
        )}
      </div>
      {problem && (
        <div class="problem" role="status">
          <b>The rules could not be evaluated.</b> {problem}
        </div>
      )}
      {!sets && <NotLoaded failed={problem !== ''} />}
      {sets?.length === 0 && <p class="why">No data set is frozen yet.</p>}
      {shown && shown.rows.length === 0 && (
        <p class="why">This data set has no data for a rule: no RSS, no impulse response, no repeated ranges.</p>
      )}
      {shown && shown.rows.length > 0 && (
        <table class="tbl">
          <caption class="sr">
            Rates of right decisions; printed: thresholds of the dissertation; fitted: to the other places of the set
          </caption>
          <thead>
            <tr>
              <th scope="col">Rule</th>
              <th scope="col" class="num">
                LOS, printed
              </th>
              <th scope="col" class="num">
                NLOS, printed
              </th>
              <th scope="col" class="num">
                LOS, fitted
              </th>
              <th scope="col" class="num">
                NLOS, fitted
              </th>
              <th scope="col">Fitted to all</th>
              <th scope="col" class="num">
                Weight
              </th>
            </tr>
          </thead>
          <tbody>
            {shown.rows.map((r) => (
              <tr key={r.rule}>
                <th scope="row">{NAMES[r.rule] ?? r.rule.replaceAll('_', ' ')}</th>
                <td class="num">{rate(r.printed, 'los')}</td>
                <td class="num">{rate(r.printed, 'nlos')}</td>
                <td class="num">{rate(r.fitted, 'los')}</td>
                <td class="num">{rate(r.fitted, 'nlos')}</td>
                <td>{r.threshold}</td>
                <td class="num">{fixed(r.weight, 2)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}
