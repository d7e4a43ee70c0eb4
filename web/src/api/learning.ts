/// Training runs, models and their numbers, as the Models view shows them. Positive is LOS: fp is NLOS called LOS, the error to avoid.
import { num, obj, str, type Unchecked } from '../live/messages';
import { call, get, list, type Wire } from './contract';

export type Task = Wire<'LearningTask'>;
export const TASKS = ['nlos_id', 'los_bias', 'nlos_bias', 'bias'] as const satisfies readonly Task[];
export const is_bias = (task: Task): boolean => task !== 'nlos_id';

export type Confusion = Wire<'Confusion'>;
/// Figures of a run, a model or one of its methods, wherever the contract has them; null: it does not say.
export interface Scores {
  readonly accuracy: number | null;
  readonly fpr: number | null;
  readonly mae_m: number | null;
  readonly mae_raw_m: number | null;
  readonly brier: number | null;
  readonly confusion: Confusion | null;
}
export type MeanSd = NonNullable<Wire<'MethodResult'>['cv'][string]>;
export interface MethodResult extends Pick<Wire<'MethodResult'>, 'method' | 'name' | 'picked'> {
  readonly accuracy_cv: MeanSd | null;
  readonly cv: Scores;
  readonly test: Scores | null;
}
export type Part = Wire<'DatasetPart'>;
export interface Split {
  readonly leak: boolean;
  readonly train: Part;
  readonly test: Part;
}
type WireRun = Wire<'TrainingRun'>;
export interface Run extends Pick<WireRun, 'id' | 'state' | 'task' | 'method' | 'created_at' | 'created_by'> {
  readonly dataset: string;
  readonly dataset_id: string;
  readonly seconds: number | null;
  readonly model: string | null;
  readonly job: string | null;
  readonly worker: string; ///< empty: the server, or nobody yet
  readonly attempts: number;
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
export type Importance = Wire<'Importance'>;
export interface RocPoint {
  readonly threshold: number;
  readonly fpr: number;
  readonly tpr: number;
}
export interface Roc {
  readonly limit: Wire<'ThresholdReport'> | null; ///< the threshold that was chosen, and what it costs
  readonly points: readonly RocPoint[];
  readonly auc: number | null;
}
type WireCurve = Wire<'TrainingCdf'>['items'][number];
export type Curve = Pick<WireCurve, 'method' | 'points'> & WireCurve['read'];
export type Candidate = Wire<'TrainingGrid'>['items'][number];
export interface Model extends Pick<Wire<'Model'>, 'id' | 'task' | 'method' | 'active' | 'created_at' | 'created_by'> {
  readonly features: readonly string[];
  readonly run: string | null;
  readonly scores: Scores;
}
export type Gate = Wire<'ModelGate'>;
export interface RunNumbers {
  readonly split: Split | null;
  readonly confusion: { readonly test: Confusion | null; readonly cv: Confusion | null };
  readonly roc: Roc | null;
  readonly curves: readonly Curve[];
  readonly grid: readonly Candidate[];
}

const tail = (path: string | null): string | null => path?.split('/').pop() || null;

function confusion_of(v: Unchecked<Confusion>): Confusion | null {
  const o = obj(v),
    [tp, fp, fn, tn] = [num(o?.tp), num(o?.fp), num(o?.fn), num(o?.tn)];
  return tp === null || fp === null || fn === null || tn === null ? null : { tp, fp, fn, tn };
}
type Scored = Partial<Wire<'ModelMetrics'> & Pick<Wire<'TestResult'>, 'bias' | 'confusion'>>;
function scores_of(v: Unchecked<Scored>): Scores {
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
function run_of(o: WireRun): Run {
  const { id, state, task, method, created_at, created_by } = o,
    progress = obj(o.progress),
    begun = Date.parse(o.started_at ?? ''),
    ended = Date.parse(o.finished_at ?? '');
  return {
    id,
    state,
    task,
    method,
    created_at,
    created_by,
    dataset: o.dataset.name,
    dataset_id: o.dataset.id,
    seconds: Number.isNaN(begun) || Number.isNaN(ended) ? null : (ended - begun) / 1000,
    model: tail(o.model),
    job: tail(o.job),
    worker: o.worker ?? '',
    attempts: o.attempts,
    stage: str(progress?.stage),
    fraction: num(progress?.fraction),
    metrics: scores_of(o.metrics),
    problem: o.problem?.detail || o.problem?.title || '',
    why: o.why ?? '',
    results: (o.results ?? []).map((r) => ({
      method: r.method,
      name: r.name || r.method,
      picked: r.picked,
      accuracy_cv: r.cv.accuracy ?? null,
      cv: scores_of(r.pooled),
      test: r.test && scores_of(r.test),
    })),
    importance: o.importance ?? [],
    nll: o.nll ?? null,
    nll_constants: o.nll_constants ?? null,
    test: o.test ? scores_of(o.test) : null,
  };
}
function model_of({ id, task, method, active, created_at, created_by, ...o }: Wire<'Model'>): Model {
  return {
    id,
    task,
    method,
    active,
    created_at,
    created_by,
    features: o.features ?? [],
    run: tail(o.training_run),
    scores: scores_of(o.metrics),
  };
}

export const runs = async (task: Task): Promise<Run[]> =>
  (await list('/training-runs', { query: { task, limit: 100 } })).map(run_of);
export const models = async (task: Task): Promise<Model[]> =>
  (await list('/models', { query: { task, limit: 100 } })).map(model_of);
export const run_page = async (id: string): Promise<Run> => run_of(await get('/training-runs/{id}', { path: { id } }));
export const gate_of = (model: string): Promise<Gate> => get('/models/{id}/gate', { path: { id: model } });
export const promote = (model: string, reason: string, key: string): Promise<unknown> =>
  call('post', '/models/{id}/promote', {
    path: { id: model },
    body: reason ? { reason } : {},
    headers: { 'Idempotency-Key': key },
  });
/// The model that is active from then on; null: none.
export const roll_back = async (task: Task, key: string): Promise<string | null> =>
  (await call('post', '/models/rollback', { body: { task }, headers: { 'Idempotency-Key': key } })).body.model;
export const cancel_job = (job: string): Promise<unknown> => call('delete', '/jobs/{id}', { path: { id: job } });

/// The numbers behind one run. What it does not have is null or empty: all but the dataset before it succeeded, a ROC where it learns a bias.
export async function run_numbers(run: Run): Promise<RunNumbers> {
  const of = { path: { id: run.id } },
    none = (): null => null,
    finished = run.state === 'succeeded',
    classifies = finished && !is_bias(run.task);
  const [dataset, confusion, roc, cdf, grid] = await Promise.all([
    get('/datasets/{id}', { path: { id: run.dataset_id } }).catch(none),
    classifies ? get('/training-runs/{id}/confusion', of).catch(none) : null,
    classifies ? get('/training-runs/{id}/roc', of).catch(none) : null,
    finished ? get('/training-runs/{id}/cdf', of).catch(none) : null,
    finished ? get('/training-runs/{id}/grid', of).catch(none) : null,
  ]);
  return {
    split: dataset?.report ?? null,
    confusion: { test: confusion?.test?.confusion ?? null, cv: confusion?.cv?.confusion ?? null },
    roc: roc && {
      limit: roc.threshold,
      auc: roc.auc,
      points: roc.points.map((p) => ({ ...p, threshold: p.threshold ?? 1 })),
    },
    curves: (cdf?.items ?? []).map(({ method, points, read }) => ({ method, points, ...read })),
    grid: grid?.items ?? [],
  };
}
