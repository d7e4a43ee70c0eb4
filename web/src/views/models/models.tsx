/// Models: one tab a task; the numbers of the selected run above, every run below.
import { signal } from '@preact/signals';
import { useState } from 'preact/hooks';
import '../desk.css';
import './models.css';
import { error_text } from '../../api/client';
import { cancel_job, TASKS, type Model, type Run, type RunNumbers } from '../../api/learning';
import { CopyBox } from '../../ui/copy_box';
import { fixed } from '../../ui/format';
import { NotLoaded } from '../../ui/empty';
import { Chip } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { Unknown } from '../../ui/unknown';
import { BiasPanel } from './bias';
import { Compare } from './compare';
import { ConfusionPanel, ThresholdPanel } from './classification';
import { GridPanel, ImportancePanel, SplitPanel } from './evidence';
import { Promote } from './promote';
import { Rules } from './rules';
import { RunTable } from './run_table';
import { task, useModels } from './use_models';
import { course_words, method_words, TASK_WORDS, why_words } from './words';

const rules_open = signal(false);

export function Models({ path }: { path: string | null }) {
  const desk = useModels(path),
    [dialog, set_dialog] = useState(false),
    [curl, set_curl] = useState(false);
  const {
    of,
    runs,
    models,
    active,
    chosen,
    shown,
    compared,
    compare,
    address,
    engineer,
    unknown,
    problem,
    set_problem,
    reload,
    undo,
    all,
  } = desk;
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
                run {chosen.id.slice(-8)} on data set {chosen.dataset},{' '}
                {chosen.seconds === null
                  ? 'begun'
                  : `trained in ${chosen.seconds < 1 ? 'less than 1' : fixed(chosen.seconds, 0)} s`}{' '}
                by {chosen.created_by}
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
                onClick={() => void cancel_job(chosen.job!).then(reload, (e: unknown) => set_problem(error_text(e)))}
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
      {unknown && (
        <Unknown what="training run" id={unknown}>
          another run is shown.
        </Unknown>
      )}
      <Problem text={problem}>
        {' '}
        <button class="btn small" onClick={reload}>
          Try again
        </button>
      </Problem>
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
            {all?.task !== of && <NotLoaded cls="pad" failed={problem !== ''} />}
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
        {run.stage && <span class="mut"> {course_words(run)}</span>}
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
            {why_words(run.why)}
            {run.nll !== null &&
              `. Mean negative log-likelihood on held-out places ${fixed(run.nll, 3)}, of a constant prediction ${fixed(run.nll_constants, 3)}.`}
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
      <p>No model has been trained for this task yet. Ranges are used uncorrected until one is promoted.</p>
      <p class="mut">
        Record ranges with known truth first: Measure, Label in the field. An engineer then makes a data set of them and
        trains by curl; docs/cookbook.md has each step.
      </p>
      <span class="ways">
        <a class="btn" href="#/measurements">
          Go to Measure
        </a>
        <a class="btn" href="#/guide/campaign">
          How to label
        </a>
      </span>
    </div>
  );
}
