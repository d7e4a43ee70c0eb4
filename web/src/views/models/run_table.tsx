/// All runs of a task, newest first, with what is active, what no correction would give, and what the dissertation reached.
import { is_bias, type Model, type Run, type Task } from '../../api/learning';
import { date, fixed } from '../../ui/format';
import { Chip, Q, type Shape, type Tone } from '../../ui/marks';
import { MOST_COMPARED } from './compare';
import { course_words, method_words, run_names } from './words';

const pc = (v: number | null) => <Q v={fixed(v === null ? null : v * 100, 1)} u="%" />,
  mm = (v: number | null) => <Q v={fixed(v === null ? null : v * 1000, 0)} u="mm" />;
const gain = (raw: number | null, corrected: number | null): string =>
  raw && corrected !== null ? `${fixed((corrected / raw - 1) * 100, 0)} %` : '–';
const LOOK: Record<string, [Shape, Tone]> = {
  succeeded: ['ring', 'ok'],
  running: ['estimating', 'info'],
  queued: ['off', 'off'],
  failed: ['bad', 'bad'],
  canceled: ['off', 'off'],
};

/// Chapter 6 of the dissertation: the best and the worst of its methods on places never trained on.
const REFERENCES: Record<Task, readonly { name: string; accuracy?: number; fpr?: number; mae_m?: number }[]> = {
  nlos_id: [
    { name: 'Dissertation, SVM', accuracy: 0.942, fpr: 0.095 },
    { name: 'Dissertation, logistic', accuracy: 0.896, fpr: 0.013 },
  ],
  los_bias: [
    { name: 'Dissertation, best', mae_m: 0.037 },
    { name: 'Dissertation, worst', mae_m: 0.063 },
  ],
  nlos_bias: [
    { name: 'Dissertation, best', mae_m: 0.174 },
    { name: 'Dissertation, worst', mae_m: 0.189 },
  ],
  bias: [],
};

export function RunTable({
  task,
  runs,
  models,
  selected,
  compared,
  compare,
  address,
}: {
  task: Task;
  runs: readonly Run[];
  models: readonly Model[];
  selected: string | null;
  compared: readonly string[];
  compare: (run: string) => void;
  address: (run: string) => string;
}) {
  const bias = is_bias(task),
    active = models.find((m) => m.active),
    raw = runs.map((r) => r.test?.mae_raw_m ?? r.metrics.mae_raw_m).find((v) => v != null) ?? null;
  const state = (r: Run) =>
    active && r.model === active.id ? (
      <Chip shape="ok" tone="ok" word="ACTIVE" />
    ) : (
      <Chip
        shape={LOOK[r.state]?.[0] ?? 'off'}
        tone={LOOK[r.state]?.[1] ?? 'off'}
        word={r.state === 'succeeded' ? 'CANDIDATE' : r.state.toUpperCase()}
      />
    );
  const names = run_names(runs),
    uploaded = models.filter((m) => !m.run);
  return (
    <table class="tbl" data-testid="runs">
      <caption class="sr">Training runs of this task</caption>
      <thead>
        <tr>
          <th scope="col">Compare</th>
          <th scope="col">Run</th>
          <th scope="col">State</th>
          <th scope="col">Data set</th>
          {bias ? (
            <>
              <th scope="col" class="num">
                MAE, by place
              </th>
              <th scope="col" class="num">
                MAE raw
              </th>
              <th scope="col" class="num">
                Against raw
              </th>
            </>
          ) : (
            <>
              <th scope="col" class="num">
                Accuracy, by place
              </th>
              <th scope="col" class="num">
                FPR
              </th>
              <th scope="col" class="num">
                Brier
              </th>
            </>
          )}
          <th scope="col" class="num">
            Trained
          </th>
        </tr>
      </thead>
      <tbody>
        {runs.map((r) => (
          <tr
            key={r.id}
            class={r.id === selected ? 'sel' : ''}
            data-testid={`run-${r.id}`}
            onClick={() => (location.hash = address(r.id))}
          >
            <td>
              <label class="pick" onClick={(e) => e.stopPropagation()}>
                <input
                  type="checkbox"
                  data-testid={`compare-${r.id}`}
                  aria-label={`Compare ${method_words(r.method)} of ${date(r.created_at)}`}
                  checked={compared.includes(r.id)}
                  disabled={r.state !== 'succeeded' || (compared.length >= MOST_COMPARED && !compared.includes(r.id))}
                  onChange={() => compare(r.id)}
                />
              </label>
            </td>
            <th scope="row">
              <a href={address(r.id)}>{names.get(r.id)}</a>
            </th>
            <td>
              {state(r)}
              {r.state === 'running' && <span class="mut"> {course_words(r)}</span>}
            </td>
            <td class="runset">{r.dataset}</td>
            {bias ? (
              <>
                <td class="num">{mm(r.metrics.mae_m)}</td>
                <td class="num">{mm(r.metrics.mae_raw_m)}</td>
                <td class="num">{gain(r.metrics.mae_raw_m, r.metrics.mae_m)}</td>
              </>
            ) : (
              <>
                <td class="num">{pc(r.metrics.accuracy)}</td>
                <td class="num">{pc(r.metrics.fpr)}</td>
                <td class="num">{fixed(r.metrics.brier, 3)}</td>
              </>
            )}
            <td class="num mut">{date(r.created_at)}</td>
          </tr>
        ))}
        {uploaded.map((m) => (
          <tr key={m.id}>
            <td />
            <th scope="row">{method_words(m.method)}, uploaded</th>
            <td>
              {m.active ? (
                <Chip shape="ok" tone="ok" word="ACTIVE" />
              ) : (
                <Chip shape="ring" tone="ok" word="CANDIDATE" />
              )}
            </td>
            <td>–</td>
            {bias ? (
              <>
                <td class="num">{mm(m.scores.mae_m)}</td>
                <td class="num">{mm(m.scores.mae_raw_m)}</td>
                <td class="num">{gain(m.scores.mae_raw_m, m.scores.mae_m)}</td>
              </>
            ) : (
              <>
                <td class="num">{pc(m.scores.accuracy)}</td>
                <td class="num">{pc(m.scores.fpr)}</td>
                <td class="num">–</td>
              </>
            )}
            <td class="num mut">{date(m.created_at)}</td>
          </tr>
        ))}
        {bias && (
          <tr>
            <td />
            <th scope="row">No correction</th>
            <td>
              <Chip shape="off" tone="off" word="BASELINE" />
            </td>
            <td>–</td>
            <td class="num">{mm(raw)}</td>
            <td class="num">{mm(raw)}</td>
            <td class="num">0 %</td>
            <td class="num mut">–</td>
          </tr>
        )}
        {REFERENCES[task].map((r) => (
          <tr key={r.name} class="ref">
            <td />
            <th scope="row">{r.name}</th>
            <td>
              <Chip shape="off" tone="off" word="REFERENCE" />
            </td>
            <td>its own</td>
            {bias ? (
              <>
                <td class="num">{mm(r.mae_m ?? null)}</td>
                <td class="num">–</td>
                <td class="num">–</td>
              </>
            ) : (
              <>
                <td class="num">{pc(r.accuracy ?? null)}</td>
                <td class="num">{pc(r.fpr ?? null)}</td>
                <td class="num">–</td>
              </>
            )}
            <td class="num mut">2018</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
