/// Training runs, models and their numbers, as the Models view shows them. Positive is LOS: fp is NLOS called LOS, the error to avoid.
import { num, obj, str } from '../live/messages';
import { request } from './client';

export const TASKS = ['nlos_id', 'los_bias', 'nlos_bias', 'bias'] as const;
export type Task = (typeof TASKS)[number];
export const is_bias = (task: Task): boolean => task !== 'nlos_id';

export interface Confusion {
  readonly tp: number;
  readonly fp: number;
  readonly fn: number;
  readonly tn: number;
}
export interface Scores {
  readonly accuracy: number | null;
  readonly fpr: number | null;
  readonly mae_m: number | null;
  readonly mae_raw_m: number | null;
  readonly brier: number | null;
  readonly confusion: Confusion | null;
}
export interface MethodResult {
  readonly method: string;
  readonly name: string;
  readonly picked: boolean;
  readonly accuracy_cv: MeanSd | null;
  readonly cv: Scores;
  readonly test: Scores | null;
}
export interface MeanSd {
  readonly mean: number;
  readonly sd: number;
}
export interface Part {
  readonly rows: number | null;
  readonly los: number | null;
  readonly environments: readonly string[];
  readonly campaigns: readonly string[];
}
export interface Split {
  readonly leak: boolean;
  readonly train: Part;
  readonly test: Part;
}
export interface Run {
  readonly id: string;
  readonly state: string;
  readonly task: Task;
  readonly dataset: string;
  readonly dataset_id: string;
  readonly method: string | null;
  readonly created_at: string;
  readonly created_by: string;
  readonly seconds: number | null;
  readonly model: string | null;
  readonly job: string | null;
  readonly stage: string;
  readonly fraction: number | null;
  readonly metrics: Scores;
  readonly problem: string;
  readonly why: string;
  readonly results: readonly MethodResult[];
  readonly importance: readonly Importance[];
  readonly nll: number | null;
  readonly nll_constants: number | null;
  readonly test: Scores | null;
}
export interface Importance {
  readonly feature: string;
  readonly mean: number;
  readonly sd: number;
}
export interface RocPoint {
  readonly threshold: number;
  readonly fpr: number;
  readonly tpr: number;
}
export interface Roc {
  readonly points: readonly RocPoint[];
  readonly auc: number | null;
  readonly threshold: number | null;
  readonly max_fpr: number | null;
  readonly fpr_low95: number | null;
  readonly fpr_high95: number | null;
  readonly places: number | null;
}
export interface Curve {
  readonly method: string;
  readonly p50_m: number | null;
  readonly p90_m: number | null;
  readonly p95_m: number | null;
  readonly points: readonly { readonly value_m: number; readonly share: number }[];
}
export interface Candidate {
  readonly name: string;
  readonly method: string;
  readonly settings: Readonly<Record<string, number>>;
  readonly picked: boolean;
  readonly loss: number;
  readonly loss_sd: number;
}
export interface Model {
  readonly id: string;
  readonly task: Task;
  readonly method: string;
  readonly active: boolean;
  readonly features: readonly string[];
  readonly run: string | null;
  readonly created_at: string;
  readonly created_by: string;
  readonly scores: Scores;
}
export interface Gate {
  readonly passed: boolean;
  readonly why: string;
  readonly checks: readonly {
    readonly name: string;
    readonly candidate: number | null;
    readonly current: number | null;
    readonly passed: boolean;
  }[];
}
export interface RunNumbers {
  readonly split: Split | null;
  readonly confusion: { readonly test: Confusion | null; readonly cv: Confusion | null };
  readonly roc: Roc | null;
  readonly curves: readonly Curve[];
  readonly grid: readonly Candidate[];
}

const list = <T>(v: unknown, of: (o: Record<string, unknown>) => T | null): T[] =>
  Array.isArray(v)
    ? v
        .map((x) => {
          const o = obj(x);
          return o && of(o);
        })
        .filter((x): x is T => x !== null)
    : [];
const words = (v: unknown): string[] => (Array.isArray(v) ? v.filter((x): x is string => typeof x === 'string') : []);
const tail = (path: unknown): string | null => str(path).split('/').pop() || null;
const task_of = (v: unknown): Task => ((TASKS as readonly string[]).includes(str(v)) ? (str(v) as Task) : 'nlos_id');

function confusion_of(v: unknown): Confusion | null {
  const o = obj(v),
    [tp, fp, fn, tn] = [num(o?.tp), num(o?.fp), num(o?.fn), num(o?.tn)];
  return tp === null || fp === null || fn === null || tn === null ? null : { tp, fp, fn, tn };
}
function scores_of(v: unknown): Scores {
  const o = obj(v),
    bias = obj(o?.bias);
  return {
    accuracy: num(o?.accuracy),
    fpr: num(o?.fpr),
    mae_m: num(o?.mae_m) ?? num(bias?.mae_m),
    mae_raw_m: num(o?.mae_raw_m) ?? num(bias?.mae_raw_m),
    brier: num(o?.brier),
    confusion: confusion_of(o?.confusion),
  };
}
function part_of(v: unknown): Part {
  const o = obj(v);
  return {
    rows: num(o?.rows) ?? num(v),
    los: num(o?.los),
    environments: words(o?.environments),
    campaigns: words(o?.campaigns),
  };
}
function run_of(o: Record<string, unknown>): Run | null {
  if (!str(o.id)) return null;
  const dataset = obj(o.dataset),
    progress = obj(o.progress),
    begun = Date.parse(str(o.started_at)),
    ended = Date.parse(str(o.finished_at));
  return {
    id: str(o.id),
    state: str(o.state),
    task: task_of(o.task),
    dataset: str(dataset?.name) || str(o.dataset),
    dataset_id: str(dataset?.id),
    method: str(o.method) || null,
    created_at: str(o.created_at),
    created_by: str(o.created_by),
    seconds: Number.isNaN(begun) || Number.isNaN(ended) ? null : (ended - begun) / 1000,
    model: tail(o.model),
    job: tail(o.job),
    stage: str(progress?.stage),
    fraction: num(progress?.fraction),
    metrics: scores_of(o.metrics),
    problem: str(obj(o.problem)?.detail) || str(obj(o.problem)?.title),
    why: str(o.why),
    results: list(o.results, (r) => {
      const accuracy = obj(obj(r.cv)?.accuracy);
      return {
        method: str(r.method),
        name: str(r.name) || str(r.method),
        picked: r.picked === true,
        accuracy_cv: accuracy && { mean: num(accuracy.mean) ?? 0, sd: num(accuracy.sd) ?? 0 },
        cv: scores_of(r.pooled),
        test: r.test === null ? null : scores_of(r.test),
      };
    }),
    importance: importance_of(o.importance),
    nll: num(o.nll),
    nll_constants: num(o.nll_constants),
    test: o.test == null ? null : scores_of(o.test),
  };
}
const importance_of = (v: unknown): Importance[] =>
  list(v, (i) => ({ feature: str(i.feature), mean: num(i.mean) ?? 0, sd: num(i.sd) ?? 0 }));
function model_of(o: Record<string, unknown>): Model | null {
  return str(o.id)
    ? {
        id: str(o.id),
        task: task_of(o.task),
        method: str(o.method),
        active: o.active === true,
        features: words(o.features),
        run: tail(o.training_run),
        created_at: str(o.created_at),
        created_by: str(o.created_by),
        scores: scores_of(o.metrics),
      }
    : null;
}

const items = async (path: string): Promise<unknown> => obj(await request('GET', path))?.items;
export const runs = async (task: Task): Promise<Run[]> =>
  list(await items(`/training-runs?task=${task}&limit=100`), run_of);
export const models = async (task: Task): Promise<Model[]> =>
  list(await items(`/models?task=${task}&limit=100`), model_of);
export const run_page = async (id: string): Promise<Run | null> => {
  const o = obj(await request('GET', `/training-runs/${encodeURIComponent(id)}`));
  return o && run_of(o);
};
export const gate_of = async (model: string): Promise<Gate> => {
  const o = obj(await request('GET', `/models/${encodeURIComponent(model)}/gate`));
  return {
    passed: o?.passed === true,
    why: str(o?.why),
    checks: list(o?.checks, (c) => ({
      name: str(c.name),
      candidate: num(c.candidate),
      current: num(c.current),
      passed: c.passed === true,
    })),
  };
};
export const promote = (model: string, reason: string, key: string): Promise<unknown> =>
  request('POST', `/models/${encodeURIComponent(model)}/promote`, reason ? { reason } : {}, { 'Idempotency-Key': key });
export const roll_back = (task: Task, key: string): Promise<unknown> =>
  request('POST', '/models/rollback', { task }, { 'Idempotency-Key': key });
export const cancel_job = (job: string): Promise<unknown> => request('DELETE', `/jobs/${encodeURIComponent(job)}`);

/// The numbers behind one finished run. What a task does not have (a bias has no ROC) is null or empty.
export async function run_numbers(run: Run): Promise<RunNumbers> {
  const part = (name: string): Promise<Record<string, unknown> | null> =>
    request('GET', `/training-runs/${encodeURIComponent(run.id)}/${name}`).then(obj, () => null);
  const [dataset, confusion, roc, cdf, grid] = await Promise.all([
    request('GET', `/datasets/${encodeURIComponent(run.dataset_id)}`).then(obj, () => null),
    is_bias(run.task) ? null : part('confusion'),
    is_bias(run.task) ? null : part('roc'),
    part('cdf'),
    part('grid'),
  ]);
  const limit = obj(roc?.threshold),
    report = obj(dataset?.report);
  return {
    split: report && { leak: report.leak === true, train: part_of(report.train), test: part_of(report.test) },
    confusion: { test: confusion_of(obj(confusion?.test)?.confusion), cv: confusion_of(obj(confusion?.cv)?.confusion) },
    roc: roc && {
      auc: num(roc.auc),
      threshold: num(limit?.threshold),
      max_fpr: num(limit?.max_fpr),
      fpr_low95: num(limit?.fpr_low95),
      fpr_high95: num(limit?.fpr_high95),
      places: num(limit?.places),
      points: list(roc.points, (p) => {
        const [t, x, y] = [num(p.threshold), num(p.fpr), num(p.tpr)];
        return x === null || y === null ? null : { threshold: t ?? 1, fpr: x, tpr: y };
      }),
    },
    curves: list(cdf?.items, (c) => ({
      method: str(c.method),
      p50_m: num(obj(c.read)?.p50_m),
      p90_m: num(obj(c.read)?.p90_m),
      p95_m: num(obj(c.read)?.p95_m),
      points: list(c.points, (p) => {
        const [x, y] = [num(p.value_m), num(p.share)];
        return x === null || y === null ? null : { value_m: x, share: y };
      }),
    })),
    grid: list(grid?.items, (c) => ({
      name: str(c.name),
      method: str(c.method),
      picked: c.picked === true,
      loss: num(c.loss) ?? NaN,
      loss_sd: num(c.loss_sd) ?? 0,
      settings: Object.fromEntries(
        Object.entries(obj(c.settings) ?? {}).filter((e): e is [string, number] => typeof e[1] === 'number'),
      ),
    })),
  };
}
