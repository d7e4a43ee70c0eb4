/// Models: one tab a task; the numbers of the selected run above, every run below. Follows running jobs without a reload.
import { signal } from '@preact/signals';
import { useEffect, useState } from 'preact/hooks';
import '../desk.css';
import './models.css';
import { idempotency_key, said } from '../../api/client';
import {
  cancel_job,
  models as fetch_models,
  roll_back,
  run_numbers,
  run_page,
  runs as fetch_runs,
  TASKS,
  type Model,
  type Run,
  type RunNumbers,
  type Task,
} from '../../api/learning';
import { may } from '../../state/session';
import { jobs_version, link, say } from '../../state/store';
import { CopyBox } from '../../ui/copy_box';
import { fixed } from '../../ui/format';
import { Chip } from '../../ui/marks';
import { BiasPanel } from './bias';
import { Compare } from './compare';
import { ConfusionPanel, ThresholdPanel } from './classification';
import { GridPanel, ImportancePanel, SplitPanel } from './evidence';
import { Promote } from './promote';
import { Rules } from './rules';
import { RunTable } from './run_table';
import { method_words, TASK_WORDS } from './words';

const task = signal<Task>('nlos_id'),
  rules_open = signal(false);

interface Loaded {
  readonly task: Task;
  readonly runs: readonly Run[];
  readonly models: readonly Model[];
}

/// `path` is what stands behind `#/models/runs/`: a run, and perhaps `?compare=` with two to four of them.
export function Models({ path }: { path: string | null }) {
  const [wanted, asked] = (path ?? '').split('?'),
    compared = (new URLSearchParams(asked).get('compare') ?? '').split(',').filter(Boolean);
  const [all, set_all] = useState<Loaded | null>(null),
    [page, set_page] = useState<{ run: Run; numbers: RunNumbers } | null>(null),
    [problem, set_problem] = useState(''),
    [dialog, set_dialog] = useState(false),
    [curl, set_curl] = useState(false),
    [again, set_again] = useState(0);
  const reload = (): void => set_again((n) => n + 1);
  useEffect(() => {
    document.title = 'Models - anchord';
  }, []);
  // A deep link names a run, and the run names its task.
  useEffect(() => {
    if (wanted)
      void run_page(wanted).then(
        (r) => {
          if (r) task.value = r.task;
        },
        () => undefined,
      );
  }, [wanted]);
  const of = task.value,
    finished = jobs_version.value,
    linked = link.value === 'live';
  useEffect(() => {
    let gone = false;
    Promise.all([fetch_runs(of), fetch_models(of)]).then(
      ([runs, models]) => {
        if (!gone) {
          set_all({ task: of, runs, models });
          set_problem('');
        }
      },
      (e: unknown) => {
        if (!gone) set_problem(said(e));
      },
    );
    return () => {
      gone = true;
    };
  }, [of, again, finished, linked]);
  const runs = all?.task === of ? all.runs : [],
    models = all?.task === of ? all.models : [];
  const active = models.find((m) => m.active),
    chosen =
      runs.find((r) => r.id === wanted) ??
      runs.find((r) => r.model === active?.id) ??
      runs.find((r) => r.state === 'succeeded') ??
      runs[0] ??
      null;
  const shown_id = chosen?.id;
  useEffect(() => {
    let gone = false;
    if (!shown_id) {
      set_page(null);
      return;
    }
    void run_page(shown_id)
      .then(async (run) => {
        if (run) {
          const numbers = await run_numbers(run);
          if (!gone) set_page({ run, numbers });
        }
      })
      .catch((e: unknown) => {
        if (!gone) set_problem(said(e));
      });
    return () => {
      gone = true;
    };
  }, [shown_id, chosen?.state, chosen?.fraction]);
  const address = (run: string, ids: readonly string[] = compared): string =>
    `#/models/runs/${run}${ids.length ? `?compare=${ids.join()}` : ''}`;
  const compare = (id: string): void => {
    location.hash = address(
      chosen?.id ?? id,
      compared.includes(id) ? compared.filter((c) => c !== id) : [...compared, id],
    );
  };
  const engineer = may('engineer'),
    shown = page && page.run.id === chosen?.id ? page : null;
  const undo = async (): Promise<void> => {
    try {
      await roll_back(of, idempotency_key());
      say('Rolled back');
      reload();
    } catch (e) {
      set_problem(said(e));
    }
  };
  return (
    <div class="desk" data-testid="models">
      <div class="toolbar">
        <div class="seg" role="group" aria-label="Task">
          {TASKS.map((t) => (
            <button
              key={t}
              class={t === of && !rules_open.value ? 'on' : ''}
              aria-pressed={t === of && !rules_open.value}
              data-testid={`task-${t}`}
              onClick={() => {
                task.value = t;
                rules_open.value = false;
                location.hash = '#/models';
              }}
            >
              {TASK_WORDS[t]}
            </button>
          ))}
          <button
            class={rules_open.value ? 'on' : ''}
            aria-pressed={rules_open.value}
            data-testid="task-rules"
            onClick={() => (rules_open.value = true)}
          >
            Rules
          </button>
        </div>
        {rules_open.value ? (
          <h1>Rules</h1>
        ) : (
          <>
            <h1>{chosen ? method_words(chosen.method) : 'Models'}</h1>
            {chosen && (
              <span class="mut">
                run {chosen.id.slice(0, 8)}, {chosen.dataset}
                {chosen.seconds === null ? '' : `, ${fixed(chosen.seconds, 0)} s`}, {chosen.created_by}
              </span>
            )}
            {chosen && <StateChip run={chosen} active={active} />}
            <span class="grow" />
            {chosen && (
              <button class="btn" aria-expanded={curl} onClick={() => set_curl(!curl)}>
                Retrain by curl
              </button>
            )}
            {engineer && chosen?.job && (chosen.state === 'running' || chosen.state === 'queued') && (
              <button
                class="btn"
                data-testid="cancel"
                onClick={() => void cancel_job(chosen.job!).then(reload, (e: unknown) => set_problem(said(e)))}
              >
                Cancel
              </button>
            )}
            {engineer && active && (
              <button class="btn" data-testid="rollback" onClick={() => void undo()}>
                Roll back
              </button>
            )}
            {engineer && (
              <button
                class="btn primary"
                data-testid="promote"
                disabled={!chosen?.model || chosen.model === active?.id}
                onClick={() => set_dialog(true)}
              >
                Promote
              </button>
            )}
          </>
        )}
      </div>
      {problem && (
        <div class="problem" role="status">
          <b>That did not work.</b> {problem}{' '}
          <button class="btn small" onClick={reload}>
            Try again
          </button>
        </div>
      )}
      {curl && chosen && (
        <div class="curl">
          <CopyBox
            label="Retrain by curl"
            text={
              'curl -fsS -H "Authorization: Bearer $T" -H "Content-Type: application/json" -H "Prefer: wait=600" -d ' +
              `'${JSON.stringify({ task: of, dataset: chosen.dataset })}' ${location.origin}/api/v1/training-runs`
            }
          />
        </div>
      )}
      <div class="page" tabIndex={0} role="region" aria-label="Numbers of the selected run">
        {rules_open.value && <Rules />}
        {!rules_open.value && (
          <>
            {!all && !problem && (
              <p class="pad" role="status">
                Loading the training runs.
              </p>
            )}
            {all?.task === of && runs.length === 0 && <Nothing />}
            {compared.length > 1 && (
              <Compare task={of} runs={compared} close={() => (location.hash = address(chosen?.id ?? '', []))} />
            )}
            {chosen && shown && <Numbers run={shown.run} numbers={shown.numbers} />}
            <section class="cell-p wide">
              {(runs.length > 0 || models.length > 0) && (
                <RunTable
                  task={of}
                  runs={runs}
                  models={models}
                  selected={chosen?.id ?? null}
                  compared={compared}
                  compare={compare}
                  address={address}
                />
              )}
              {compared.length === 1 && (
                <p class="sub" role="status">
                  Tick one more run to see them side by side.
                </p>
              )}
            </section>
          </>
        )}
      </div>
      {dialog && chosen?.model && (
        <Promote
          model={chosen.model}
          name={method_words(chosen.method)}
          close={() => set_dialog(false)}
          done={() => {
            set_dialog(false);
            reload();
          }}
        />
      )}
    </div>
  );
}

function StateChip({ run, active }: { run: Run; active: Model | undefined }) {
  if (active && run.model === active.id) return <Chip shape="ok" tone="ok" word="ACTIVE" />;
  if (run.state === 'running' || run.state === 'queued')
    return (
      <Chip shape="estimating" tone="info" word={run.state.toUpperCase()}>
        {run.stage && (
          <span class="mut">
            {' '}
            {run.stage} {run.fraction === null ? '' : `${fixed(run.fraction * 100, 0)} %`}
          </span>
        )}
      </Chip>
    );
  return (
    <Chip
      shape={run.state === 'succeeded' ? 'ok' : 'bad'}
      tone={run.state === 'succeeded' ? 'ok' : 'bad'}
      word={run.state.toUpperCase()}
    />
  );
}

function Numbers({ run, numbers }: { run: Run; numbers: RunNumbers }) {
  const confusion = numbers.confusion.test ?? numbers.confusion.cv;
  if (run.state === 'failed')
    return (
      <section class="cell-p wide">
        <div class="problem">
          <b>This run failed.</b> {run.problem}
        </div>
      </section>
    );
  return (
    <>
      {run.why && (
        <section class="cell-p wide">
          <p class="why">
            {run.why}
            {run.nll !== null &&
              `. Mean negative log-likelihood on held-out places ${fixed(run.nll, 3)}, constants ${fixed(run.nll_constants, 3)}.`}
          </p>
        </section>
      )}
      {confusion && (
        <ConfusionPanel
          confusion={confusion}
          held_out={numbers.confusion.test !== null}
          max_fpr={numbers.roc?.limit?.max_fpr ?? null}
        />
      )}
      {numbers.roc && confusion && (
        <ThresholdPanel
          key={run.id}
          roc={numbers.roc}
          los={confusion.tp + confusion.fn}
          nlos={confusion.fp + confusion.tn}
        />
      )}
      <ImportancePanel importance={run.importance} />
      {numbers.split && <SplitPanel split={numbers.split} />}
      <BiasPanel curves={numbers.curves} run={run} />
      <GridPanel grid={numbers.grid} />
    </>
  );
}

function Nothing() {
  return (
    <div class="empty small">
      <p>No model has been trained for this task yet. Ranges are used as they come until one is promoted.</p>
      <p class="mut">
        Import a campaign with ground truth, freeze a data set and post a training run; docs/cookbook.md has each step
        with curl.
      </p>
    </div>
  );
}
