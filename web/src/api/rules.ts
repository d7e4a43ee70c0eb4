/// The plain rules of chapter 5 on a frozen data set: rates of right decisions, with the dissertation's thresholds and with fitted ones.
import { get, list, type Wire } from './contract';

export type DatasetName = Pick<Wire<'DatasetSummary'>, 'id' | 'name'>;
export type Rates = Wire<'RuleRates'>;
type Threshold = Wire<'DatasetRules'>['thresholds'][string];
export interface RuleRow {
  readonly rule: string;
  readonly printed: Rates | null;
  readonly fitted: Rates | null;
  readonly threshold: string;
  readonly weight: number | null;
}
export interface Rules extends Pick<Wire<'DatasetRules'>, 'los_rows' | 'nlos_rows'> {
  readonly rows: readonly RuleRow[];
}

export const datasets = (): Promise<DatasetName[]> => list('/datasets', { query: { limit: 200 } });
function threshold_of({ at_zero_dbm: zero, slope_dbm_per_m: slope, threshold, los_above }: Partial<Threshold>): string {
  if (zero !== undefined && slope !== undefined)
    return `LOS above ${zero.toFixed(1)} ${slope < 0 ? '−' : '+'} ${Math.abs(slope).toFixed(2)} d dBm`.replace(
      '-',
      '−',
    );
  return threshold === undefined ? '' : `LOS ${los_above ? 'above' : 'below'} ${threshold.toPrecision(3)}`;
}
const fetch_rules = (dataset: string): Promise<Wire<'DatasetRules'>> =>
  get('/datasets/{id}/rules', { path: { id: dataset } });
/// RSS line fitted to the LOS rows of a data set; null where it has too few with a level.
export async function rss_line_of(
  dataset: string,
): Promise<{ readonly at_zero_dbm: number; readonly slope_dbm_per_m: number } | null> {
  const { at_zero_dbm, slope_dbm_per_m } = (await fetch_rules(dataset)).thresholds.rss ?? {};
  return at_zero_dbm === undefined || slope_dbm_per_m === undefined ? null : { at_zero_dbm, slope_dbm_per_m };
}
export async function rules_of(dataset: string): Promise<Rules> {
  const { los_rows, nlos_rows, printed, fitted, thresholds } = await fetch_rules(dataset);
  return {
    los_rows,
    nlos_rows,
    rows: [...new Set([...Object.keys(printed), ...Object.keys(fitted)])].map((rule) => ({
      rule,
      printed: printed[rule] ?? null,
      fitted: fitted[rule] ?? null,
      threshold: threshold_of(thresholds[rule] ?? {}),
      weight: thresholds[rule]?.weight ?? null,
    })),
  };
}
