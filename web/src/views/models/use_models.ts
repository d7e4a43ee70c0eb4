/// What the Models view looks at: the task, its runs and models, the numbers of the chosen run, and what is compared. Follows running jobs.
import { signal } from '@preact/signals';
import { useEffect, useState } from 'preact/hooks';
import { error_text, idempotency_key, is_unknown } from '../../api/client';
import {
  models as fetch_models,
  roll_back,
  run_numbers,
  run_page,
  runs as fetch_runs,
  type Model,
  type Run,
  type RunNumbers,
  type Task,
} from '../../api/learning';
import { may } from '../../state/session';
import { jobs_version, link, say } from '../../state/store';
import { run_names } from './words';

export const task = signal<Task>('nlos_id');

interface Loaded {
  readonly task: Task;
  readonly runs: readonly Run[];
  readonly models: readonly Model[];
}

/// `path` is what stands behind `#/models/runs/`: a run, and perhaps `?compare=` with two to four of them.
export function useModels(path: string | null) {
  const [wanted, asked] = (path ?? '').split('?'),
    compared = (new URLSearchParams(asked).get('compare') ?? '').split(',').filter(Boolean);
  const [all, set_all] = useState<Loaded | null>(null),
    [page, set_page] = useState<{ run: Run; numbers: RunNumbers } | null>(null),
    [problem, set_problem] = useState(''),
    [again, set_again] = useState(0),
    [unknown, set_unknown] = useState<string | null>(null);
  const reload = (): void => set_again((n) => n + 1);
  useEffect(() => {
    document.title = 'Models - anchord';
  }, []);
  // A deep link names a run, and the run names its task.
  useEffect(() => {
    set_unknown(null);
    if (wanted)
      void run_page(wanted).then(
        (r) => {
          if (r) task.value = r.task;
          else set_unknown(wanted);
        },
        (e: unknown) => {
          if (is_unknown(e)) set_unknown(wanted);
        },
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
        if (!gone) set_problem(error_text(e));
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
        if (!gone) set_problem(error_text(e));
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
      const id = await roll_back(of, idempotency_key()),
        named = id && run_names(models).get(id);
      say(`Rolled back: ${id ? named || id : 'no model'} is active`);
      reload();
    } catch (e) {
      set_problem(error_text(e));
    }
  };
  return {
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
  };
}
