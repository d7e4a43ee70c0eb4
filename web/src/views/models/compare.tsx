/// Two to four runs side by side: what each was trained on, what it reaches, and their curves in one drawing.
import { useEffect, useState } from 'preact/hooks';
import { error_text, is_unknown } from '../../api/client';
import { is_bias, run_numbers, run_page, type Run, type RunNumbers, type Task } from '../../api/learning';
import { fixed } from '../../ui/format';
import { Icon } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { Unknown } from '../../ui/unknown';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';
import { run_names } from './words';

export const MOST_COMPARED = 4;
const DASHES = ['none', '9 4', '2 4', '12 4 2 4'];

interface Side {
  readonly run: Run;
  readonly numbers: RunNumbers;
}
interface Measure {
  readonly name: string;
  readonly unit: string;
  readonly better: 'less' | 'more';
  readonly of: (s: Side) => number | null;
  readonly digits: number;
}

const times = (k: number, v: number | null | undefined): number | null => (v == null ? null : v * k);
const corrected = (s: Side) =>
  s.numbers.curves.find((c) => c.method === s.run.method) ??
  s.numbers.curves.find((c) => c.method !== 'none' && c.method !== 'raw');
const NLL: Measure = {
  name: 'Negative log-likelihood, held out',
  unit: '',
  better: 'less',
  digits: 3,
  of: (s) => s.run.nll,
};
const MEASURES: Record<'class' | 'bias', readonly Measure[]> = {
  class: [
    {
      name: 'Accuracy, held-out places',
      unit: '%',
      better: 'more',
      digits: 1,
      of: (s) => times(100, s.run.test?.accuracy),
    },
    {
      name: 'False positive rate, held-out places',
      unit: '%',
      better: 'less',
      digits: 1,
      of: (s) => times(100, s.run.test?.fpr),
    },
    {
      name: 'Accuracy, cross-validated',
      unit: '%',
      better: 'more',
      digits: 1,
      of: (s) => times(100, s.run.metrics.accuracy),
    },
    {
      name: 'False positive rate, cross-validated',
      unit: '%',
      better: 'less',
      digits: 1,
      of: (s) => times(100, s.run.metrics.fpr),
    },
    { name: 'Area under the ROC', unit: '', better: 'more', digits: 3, of: (s) => s.numbers.roc?.auc ?? null },
    { name: 'Brier score', unit: '', better: 'less', digits: 3, of: (s) => s.run.metrics.brier },
    NLL,
  ],
  bias: [
    { name: 'MAE, held-out places', unit: 'mm', better: 'less', digits: 0, of: (s) => times(1000, s.run.test?.mae_m) },
    {
      name: 'MAE, no correction',
      unit: 'mm',
      better: 'less',
      digits: 0,
      of: (s) => times(1000, s.run.test?.mae_raw_m ?? s.run.metrics.mae_raw_m),
    },
    {
      name: 'MAE, cross-validated',
      unit: 'mm',
      better: 'less',
      digits: 0,
      of: (s) => times(1000, s.run.metrics.mae_m),
    },
    {
      name: '90 % of |bias| below',
      unit: 'mm',
      better: 'less',
      digits: 0,
      of: (s) => times(1000, corrected(s)?.p90_m),
    },
    NLL,
  ],
};

export function Compare({ task, runs, close }: { task: Task; runs: readonly string[]; close: () => void }) {
  const [sides, set_sides] = useState<readonly Side[] | null>(null),
    [unknown, set_unknown] = useState<readonly string[]>([]),
    [problem, set_problem] = useState('');
  const wanted = runs.join();
  useEffect(() => {
    let gone = false;
    const one = async (id: string): Promise<Side | null> => {
      const run = await run_page(id).catch((e: unknown) => {
        if (is_unknown(e)) return null;
        throw e;
      });
      return run && { run, numbers: await run_numbers(run) };
    };
    const ids = wanted ? wanted.split(',') : [];
    Promise.all(ids.map(one)).then(
      (all) => {
        if (!gone) {
          set_unknown(ids.filter((_, i) => all[i] === null));
          set_sides(all.filter((s): s is Side => s !== null));
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
  }, [wanted]);
  return (
    <section class="cell-p wide" data-testid="compare">
      <div class="hd">
        <h2>Runs side by side</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close the comparison" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      {unknown.map((id) => (
        <Unknown key={id} what="training run" id={id}>
          the others are compared.
        </Unknown>
      ))}
      <Problem text={problem} />
      {!sides && !problem && <p role="status">Loading the numbers.</p>}
      {sides && <Sides sides={sides} bias={is_bias(task)} />}
    </section>
  );
}

function Sides({ sides, bias }: { sides: readonly Side[]; bias: boolean }) {
  const one_set = new Set(sides.map((s) => s.run.dataset_id)).size === 1,
    names = run_names(sides.map((s) => s.run));
  // As shown: two figures that read alike have no winner.
  const read = (m: Measure, s: Side): number | null => {
    const v = m.of(s);
    return v === null ? null : Number(v.toFixed(m.digits));
  };
  const best = (m: Measure): number | null => {
    const all = sides.map((s) => read(m, s)).filter((v): v is number => v !== null);
    return new Set(all).size < 2 ? null : m.better === 'less' ? Math.min(...all) : Math.max(...all);
  };
  return (
    <>
      {!one_set && (
        <p class="why">
          Not trained on the same data set: the figures are from different measurements, which may explain a difference.
        </p>
      )}
      <div class="cdfbox">
        <Curves sides={sides} bias={bias} />
        <table class="tbl sides">
          <caption class="sr">Figures of each run; the best of a line is bold and marked</caption>
          <thead>
            <tr>
              <th scope="col">Figure</th>
              {sides.map((s, i) => (
                <th key={s.run.id} scope="col" class="num">
                  <svg class="key" viewBox="0 0 24 8" aria-hidden="true">
                    <path class="s main" stroke-dasharray={DASHES[i]} d="M0 4h24" />
                  </svg>
                  <a href={`#/models/runs/${s.run.id}`}>{names.get(s.run.id)}</a>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            <tr>
              <th scope="row">Data set</th>
              {sides.map((s) => (
                <td key={s.run.id} class="num">
                  {s.run.dataset}
                </td>
              ))}
            </tr>
            {MEASURES[bias ? 'bias' : 'class']
              .filter((m) => sides.some((s) => m.of(s) !== null))
              .map((m) => {
                const top = best(m);
                return (
                  <tr key={m.name}>
                    <th scope="row">
                      {m.name}
                      {m.unit && `, ${m.unit}`}
                    </th>
                    {sides.map((s) => {
                      const v = m.of(s),
                        wins = v !== null && read(m, s) === top;
                      return (
                        <td key={s.run.id} class="num">
                          {wins ? <b>{fixed(v, m.digits)} ✓</b> : fixed(v, m.digits)}
                        </td>
                      );
                    })}
                  </tr>
                );
              })}
          </tbody>
        </table>
      </div>
    </>
  );
}

/// ROC of classifiers, distribution of what is left of the bias otherwise; one dash pattern a run, that of the table's head.
function Curves({ sides, bias }: { sides: readonly Side[]; bias: boolean }) {
  const points = (s: Side): readonly (readonly [number, number])[] =>
    bias
      ? (corrected(s)?.points.map((p) => [p.value_m, p.share] as const) ?? [])
      : [...(s.numbers.roc?.points ?? [])]
          .sort((a, b) => a.fpr - b.fpr || a.tpr - b.tpr)
          .map((p) => [p.fpr, p.tpr] as const);
  const drawn = sides.map(points);
  if (!drawn.some((d) => d.length > 1)) return null;
  const top = bias ? Math.max(...sides.map((s) => corrected(s)?.p95_m ?? 0), 0.01) * 1.25 : 1;
  return (
    <Drawing
      cls="cdf"
      label={`${bias ? 'Share of ranges with |bias| below x' : 'Share of LOS kept over share of NLOS called LOS'}, one curve a run`}
      draw={(w, h) => {
        const f = { w, h, left: room(44), right: 12, top: 8, bottom: room(24) },
          x = scale([0, top], [f.left, w - f.right]),
          y = scale([0, 1], [h - f.bottom, f.top]);
        return (
          <>
            <Axes
              f={f}
              x={x}
              y={y}
              xs={ticks(0, top)}
              ys={[0, 0.5, 0.9, 1]}
              xw={(v) => (bias ? `${fixed(v * 1000, 0)} mm` : `${fixed(v * 100, 0)} %`)}
              yw={(v) => `${fixed(v * 100, 0)} %`}
            />
            {drawn.map((d, i) => (
              <path
                key={sides[i]!.run.id}
                class="s main"
                stroke-dasharray={DASHES[i]}
                d={line(d.filter((p) => p[0] <= top).map((p) => [x(p[0]), y(p[1])]))}
              />
            ))}
          </>
        );
      }}
    />
  );
}
