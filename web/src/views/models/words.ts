/// Names of learning as people say them. No DOM.
import { date, fixed } from '../../ui/format';
import type { Run, Task } from '../../api/learning';

export const TASK_WORDS: Record<Task, string> = {
  nlos_id: 'LOS or NLOS',
  los_bias: 'LOS bias',
  nlos_bias: 'NLOS bias',
  bias: 'Bias of all',
};
const METHODS: Record<string, string> = {
  logistic: 'Logistic regression',
  random_forest: 'Random forest',
  forest: 'Random forest',
  svm: 'Support vector machine',
  svm_linear: 'SVM, linear',
  svm_poly: 'SVM, polynomial',
  svm_sigmoid: 'SVM, sigmoid',
  svm_rbf: 'SVM, RBF',
  gbt: 'Boosted trees',
  boosted: 'Boosted trees',
  boosted_trees: 'Boosted trees',
  univariate: 'Univariate polynomial',
  multivariate: 'Multivariate polynomial',
  polynomial: 'Polynomial',
  mixture: 'Averaged logits',
  average: 'Logistic, SVM and forest averaged',
  tree_average: 'Boosted trees and forest averaged',
  least_absolute: 'Least absolute deviations',
  auto: 'Automatic',
  none: 'No correction',
  raw: 'No correction',
};
const plain_words = (m: string): string => METHODS[m] ?? m.replaceAll('_', ' ').replace(/^./, (c) => c.toUpperCase());
/// `c=3` as it is written in the field: C = 3.
const setting_words = (s: string): string => {
  const [name = '', value = ''] = s.split('=').map((x) => x.trim());
  return `${name === 'c' ? 'C' : name.replaceAll('_', ' ')}${value && ` = ${value}`}`;
};
/// A method as its run names it, with settings and features where it tells them: "logistic(c=3) on 3 features".
export function method_words(m: string | null): string {
  if (!m) return 'Automatic';
  const parts = /^(\w+)\(([^()]*)\)(?: on (\d+ features?))?$/.exec(m);
  return parts
    ? [
        plain_words(parts[1]!),
        ...(parts[2] ? parts[2].split(',').map(setting_words) : []),
        ...(parts[3] ? [parts[3]] : []),
      ].join(', ')
    : plain_words(m);
}
/// Why a run chose what it chose, with the candidate in words as well.
export const why_words = (why: string): string =>
  why.replace(/\w+\([^()]*\)(?: on \d+ features?)?/g, method_words).replace(/^./, (c) => c.toUpperCase());
interface Named {
  readonly id: string;
  readonly method: string | null;
  readonly created_at: string;
}
/// By their methods; those of one method by their time too, and of one minute by their number in it.
export function run_names(runs: readonly Named[]): ReadonlyMap<string, string> {
  const ordered = [...runs].sort((a, b) => a.created_at.localeCompare(b.created_at)),
    timed = (r: Named): string => `${method_words(r.method)}, ${date(r.created_at)}`;
  return new Map(
    runs.map((r) => {
      const same = ordered.filter((x) => method_words(x.method) === method_words(r.method)),
        together = same.filter((x) => timed(x) === timed(r));
      return [
        r.id,
        same.length < 2
          ? method_words(r.method)
          : together.length < 2
            ? timed(r)
            : `${timed(r)}, no. ${together.indexOf(r) + 1}`,
      ];
    }),
  );
}
const FEATURES: Record<string, string> = {
  distance_m: 'Distance',
  range_m: 'Distance',
  range_db: 'Distance, dB',
  rx_dbm: 'RSS',
  fp_dbm: 'First-path power',
  rx_minus_fp_db: 'RX-FP difference',
  noise_excess_db: 'Noise excess',
  fp_snr_db: 'First-path SNR',
  total_snr_db: 'SNR',
  preamble_db: 'Preamble',
  fp_shape12_db: 'First-path shape, 1 to 2',
  fp_shape32_db: 'First-path shape, 3 to 2',
  rx_free_space_db: 'RX over free space',
  fp_free_space_db: 'First path over free space',
  fp_index: 'First-path index',
  max_noise_db: 'Strongest noise',
  kurtosis: 'Kurtosis',
  mean_excess_delay_ns: 'Mean excess delay',
  rms_delay_spread_ns: 'RMS delay spread',
  early_energy: 'Early energy',
  peak_delay_ns: 'Peak delay',
  height_difference_m: 'Height',
  heading_deg: 'Heading',
  log_range_spread: 'Spread of ranges',
  log_fp_spread: 'Spread of first path',
  log_rx_minus_fp_spread: 'Spread of RX-FP',
  std_noise: 'Noise',
};
export const feature_words = (f: string): string => FEATURES[f] ?? f.replaceAll('_', ' ');

/// Where a run goes on and how it goes: "search 40 % on lab-pc/812, attempt 2".
export function course_words(run: Pick<Run, 'stage' | 'fraction' | 'worker' | 'attempts'>): string {
  const share = run.fraction === null ? '' : ` ${fixed(run.fraction * 100, 0)} %`;
  const place = run.worker && ` on ${run.worker}`;
  return `${run.stage}${share}${place}${run.attempts > 1 ? `, attempt ${run.attempts}` : ''}`;
}
