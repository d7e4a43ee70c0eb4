/// Why to believe a run: which features carry it, what the grid search saw, and that no place stands on both sides of the split.
import type { Candidate, Importance, Split } from '../../api/learning';
import { fixed, grouped } from '../../ui/format';
import { Chip } from '../../ui/marks';
import { feature_words, method_words } from './words';

export function ImportancePanel({ importance }: { importance: readonly Importance[] }) {
  const top = Math.max(...importance.map((i) => i.mean + i.sd), 1e-9),
    sorted = [...importance].sort((a, b) => b.mean - a.mean);
  return (
    <section class="cell-p" data-testid="importance">
      <h2>Feature importance</h2>
      <p class="sub">{importance.length ? 'loss when permuted, ± 1 sd' : 'not computed in this run'}</p>
      {importance.length > 0 && (
        <table class="bars">
          <caption class="sr">Loss when a feature is permuted</caption>
          <tbody>
            {sorted.map((i) => (
              <tr key={i.feature}>
                <th scope="row">{feature_words(i.feature)}</th>
                <td class="bar">
                  <i style={{ width: `${Math.max(0, i.mean / top) * 100}%` }} />
                  <em
                    style={{
                      left: `${Math.max(0, (i.mean - i.sd) / top) * 100}%`,
                      width: `${((2 * i.sd) / top) * 100}%`,
                    }}
                  />
                </td>
                <td class="num">{fixed(i.mean, 3)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}

export function SplitPanel({ split }: { split: Split }) {
  const { train, test } = split,
    los = (p: Split['train']): string => (p.rows && p.los !== null ? `${fixed((p.los / p.rows) * 100, 0)} %` : '–');
  const row = (name: string, a: string, b: string) => (
    <tr>
      <th scope="row">{name}</th>
      <td>{a}</td>
      <td>{b}</td>
    </tr>
  );
  return (
    <section class="cell-p" data-testid="split">
      <div class="hd">
        <h2>Split</h2>
        {split.leak ? <Chip shape="bad" tone="bad" word="LEAK" /> : <Chip shape="ok" tone="ok" word="NO LEAK" />}
      </div>
      <table class="split">
        <caption class="sr">Train and test parts</caption>
        <thead>
          <tr>
            <td />
            <th scope="col">Train</th>
            <th scope="col">Test</th>
          </tr>
        </thead>
        <tbody>
          {row('Rows', grouped(train.rows), grouped(test.rows))}
          {row('Places', train.environments.join(', ') || '–', test.environments.join(', ') || '–')}
          {row('Campaigns', train.campaigns.join(', ') || '–', test.campaigns.join(', ') || '–')}
          {row('LOS share', los(train), los(test))}
        </tbody>
      </table>
    </section>
  );
}

/// Two settings make a map, one a row; more are told in the list below it. Darker is a smaller loss.
export function GridPanel({ grid }: { grid: readonly Candidate[] }) {
  const varies = (m: string): boolean =>
      new Set(grid.filter((c) => c.method === m).map((c) => JSON.stringify(c.settings))).size > 1,
    methods = [...new Set(grid.map((c) => c.method))].filter(varies);
  if (!methods.length) return null;
  return (
    <section class="cell-p wide" data-testid="grid">
      <h2>Grid search</h2>
      <p class="sub">cross-validated loss of each setting, darker is better, the selected one is framed</p>
      <div class="grids">
        {methods.map((m) => (
          <Heat key={m} method={m} all={grid.filter((c) => c.method === m)} />
        ))}
      </div>
    </section>
  );
}
function Heat({ method, all }: { method: string; all: readonly Candidate[] }) {
  const names = [...new Set(all.flatMap((c) => Object.keys(c.settings)))].filter(
    (n) => new Set(all.map((c) => c.settings[n])).size > 1,
  );
  const [across, down] = [names[0], names[1]],
    values = (n: string | undefined): (number | null)[] =>
      n ? [...new Set(all.map((c) => c.settings[n] ?? null))].sort((a, b) => (a ?? 0) - (b ?? 0)) : [null];
  const losses = all.map((c) => c.loss).filter(Number.isFinite),
    lo = Math.min(...losses),
    hi = Math.max(...losses);
  const best = (x: number | null, y: number | null): Candidate | undefined =>
    all
      .filter((c) => (!across || (c.settings[across] ?? null) === x) && (!down || (c.settings[down] ?? null) === y))
      .sort((a, b) => a.loss - b.loss)[0];
  return (
    <table class="heat">
      <caption>
        {method_words(method)}
        {across && `: ${across.replaceAll('_', ' ')} across`}
        {down && `, ${down.replaceAll('_', ' ')} down`}
      </caption>
      <thead>
        <tr>
          <td />
          {values(across).map((x) => (
            <th scope="col" key={String(x)}>
              {x ?? ''}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {values(down).map((y) => (
          <tr key={String(y)}>
            <th scope="row">{y ?? ''}</th>
            {values(across).map((x) => {
              const c = best(x, y);
              return (
                <td
                  key={String(x)}
                  class={c?.picked ? 'picked' : ''}
                  style={{ '--p': `${c && hi > lo ? ((hi - c.loss) / (hi - lo)) * 100 : 50}%` }}
                >
                  {fixed(c?.loss, 3)}
                </td>
              );
            })}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
