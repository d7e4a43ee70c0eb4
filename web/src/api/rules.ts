/// The plain rules of chapter 5 on a frozen data set: rates of right decisions, with the dissertation's thresholds and with fitted ones.
import { num, obj, str } from '../live/messages';
import { request } from './client';

export interface DatasetName {
  readonly id: string;
  readonly name: string;
}
export interface Rates {
  readonly los: number | null;
  readonly nlos: number | null;
}
export interface RuleRow {
  readonly rule: string;
  readonly printed: Rates | null;
  readonly fitted: Rates | null;
  readonly threshold: string;
  readonly weight: number | null;
}
export interface Rules {
  readonly los_rows: number | null;
  readonly nlos_rows: number | null;
  readonly rows: readonly RuleRow[];
}

export async function datasets(): Promise<DatasetName[]> {
  const items = obj(await request('GET', '/datasets?limit=200'))?.items;
  return (Array.isArray(items) ? items : [])
    .map(obj)
    .filter((o) => o !== null)
    .map((o) => ({ id: str(o.id), name: str(o.name) }));
}
const rates_of = (v: unknown): Rates | null => {
  const o = obj(v);
  return o && { los: num(o.los_rate), nlos: num(o.nlos_rate) };
};
function threshold_of(o: Record<string, unknown> | null): string {
  const [zero, slope, value] = [num(o?.at_zero_dbm), num(o?.slope_dbm_per_m), num(o?.threshold)];
  if (zero !== null && slope !== null)
    return `LOS above ${zero.toFixed(1)} ${slope < 0 ? '−' : '+'} ${Math.abs(slope).toFixed(2)} d dBm`.replace(
      '-',
      '−',
    );
  return value === null ? '' : `LOS ${o?.los_above === true ? 'above' : 'below'} ${value.toPrecision(3)}`;
}
/// RSS line fitted to the LOS rows of a data set; null where it has too few with a level.
export async function rss_line_of(
  dataset: string,
): Promise<{ readonly at_zero_dbm: number; readonly slope_dbm_per_m: number } | null> {
  const rss = obj(obj(obj(await request('GET', `/datasets/${encodeURIComponent(dataset)}/rules`))?.thresholds)?.rss),
    [zero, slope] = [num(rss?.at_zero_dbm), num(rss?.slope_dbm_per_m)];
  return zero === null || slope === null ? null : { at_zero_dbm: zero, slope_dbm_per_m: slope };
}
export async function rules_of(dataset: string): Promise<Rules> {
  const o = obj(await request('GET', `/datasets/${encodeURIComponent(dataset)}/rules`)),
    printed = obj(o?.printed) ?? {},
    fitted = obj(o?.fitted) ?? {},
    thresholds = obj(o?.thresholds) ?? {};
  const names = [...new Set([...Object.keys(printed), ...Object.keys(fitted)])];
  return {
    los_rows: num(o?.los_rows),
    nlos_rows: num(o?.nlos_rows),
    rows: names.map((rule) => ({
      rule,
      printed: rates_of(printed[rule]),
      fitted: rates_of(fitted[rule]),
      threshold: threshold_of(obj(thresholds[rule])),
      weight: num(obj(thresholds[rule])?.weight),
    })),
  };
}
