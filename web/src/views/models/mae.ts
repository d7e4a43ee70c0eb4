/// Mean absolute error beside each curve of |bias|. No DOM.
import type { Curve, Run } from '../../api/learning';

export const is_raw = (c: Pick<Curve, 'method'>): boolean => c.method === 'none' || c.method === 'raw';
/// Of the uncorrected ranges what the run says of them: the candidates of a bias run carry no method of their own, so a search for `none` would find
/// one of those.
export function curve_mae(c: Pick<Curve, 'method'>, run: Pick<Run, 'results' | 'test' | 'metrics'>): number | null {
  if (is_raw(c)) return run.test?.mae_raw_m ?? run.metrics.mae_raw_m;
  const r =
    run.results.find((x) => x.name === c.method) ??
    run.results.find((x) => x.method === c.method && x.method !== 'none' && x.method !== 'raw');
  return r?.test?.mae_m ?? r?.cv.mae_m ?? run.test?.mae_m ?? run.metrics.mae_m;
}
