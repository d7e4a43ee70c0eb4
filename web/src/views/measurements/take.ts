/// One place of a campaign, taken in the field: its truth, the rows that are sent, and what they are like so far. No DOM.
import type { TruthOfRows } from '../../api/campaign';
import type { Wire } from '../../api/contract';
import { num, objects, type Unchecked } from '../../live/messages';

export interface Place {
  readonly campaign: string;
  readonly environment: string;
  readonly setting: string;
  readonly anchor: string;
  readonly los: '' | 'los' | 'nlos';
  readonly distance_m: string;
  readonly heading_deg: string;
  readonly height_difference_m: string;
  readonly material: string;
  readonly thickness_m: string;
  readonly wanted: string;
}
export const NEW_PLACE: Place = {
  campaign: '',
  environment: '',
  setting: '',
  anchor: '',
  los: '',
  distance_m: '',
  heading_deg: '',
  height_difference_m: '',
  material: '',
  thickness_m: '',
  wanted: '50',
};
export const WANTED_MAX = 1000;

/// A number as people type it; null where the field is empty, undefined where it is none.
export function typed_number(text: string): number | null | undefined {
  if (text.trim() === '') return null;
  const v = Number(text.trim().replace(',', '.'));
  return Number.isFinite(v) ? v : undefined;
}
/// What is missing or impossible, in words; empty where the place can be measured.
export function missing(p: Place): string[] {
  const out: string[] = [],
    limits: readonly (readonly [string, string, number, number])[] = [
      ['distance', p.distance_m, 0.001, 1000],
      ['heading', p.heading_deg, -360, 720],
      ['height difference', p.height_difference_m, -1000, 1000],
      ['thickness', p.thickness_m, 0, 100],
    ];
  if (!p.campaign.trim()) out.push('campaign');
  if (!p.anchor) out.push('anchor');
  if (!p.los) out.push('LOS or NLOS');
  if (!p.distance_m.trim()) out.push('true distance');
  for (const [name, text, low, high] of limits) {
    const v = typed_number(text);
    if (v === undefined || (v !== null && (v < low || v > high))) out.push(`a ${name} of ${low} to ${high}`);
  }
  const n = typed_number(p.wanted);
  if (n == null || !Number.isInteger(n) || n < 1 || n > WANTED_MAX) out.push(`1 to ${WANTED_MAX} measurements`);
  return out;
}
/// The name of a place that was given none: its truth, so that repeats of it come together and others do not.
export function setting_of(p: Place): string {
  if (p.setting.trim()) return p.setting.trim();
  const part = (text: string, unit: string): string[] => {
    const v = typed_number(text);
    return v == null ? [] : [`${v} ${unit}`];
  };
  return [
    ...part(p.distance_m, 'm'),
    ...part(p.heading_deg, '°'),
    ...part(p.height_difference_m, 'm up'),
    ...(p.material.trim() ? [p.material.trim()] : []),
    ...(p.los ? [p.los.toUpperCase()] : []),
  ].join(', ');
}
/// The truth of every row, as the import takes it beside the rows.
export function truth_query(p: Place): TruthOfRows {
  const out: TruthOfRows = {};
  for (const [name, text] of [
    ['environment', p.environment],
    ['setting', setting_of(p)],
    ['material', p.material],
  ] as const)
    if (text.trim()) out[name] = text.trim();
  for (const name of ['distance_m', 'heading_deg', 'height_difference_m', 'thickness_m'] as const) {
    const v = typed_number(p[name]);
    if (v != null) out[name] = v;
  }
  if (p.los) out.los = p.los === 'los';
  return out;
}
/// Stored ranges as lines of the import, with everything the radio told.
export function lines_of(ranges: readonly Unchecked<Wire<'Range'>>[]): string {
  return objects(ranges)
    .map((r) => {
      const t_us = num(r.t_us),
        line: Record<string, unknown> = {
          range_m: num(r.distance_m),
          t_s: t_us === null ? undefined : t_us / 1e6,
          rx_dbm: num(r.rx_dbm) ?? num(r.rss_dbm) ?? undefined,
          fp_dbm: num(r.fp_dbm) ?? undefined,
          std_noise: num(r.std_noise) ?? undefined,
          cir: r.cir,
        };
      return `${JSON.stringify(line)}\n`;
    })
    .join('');
}
export interface Spread {
  readonly n: number;
  readonly mean: number | null;
  readonly sd: number | null;
}
/// Mean and sample standard deviation.
export function spread(values: readonly number[]): Spread {
  const n = values.length,
    mean = n ? values.reduce((a, v) => a + v, 0) / n : null;
  return { n, mean, sd: n < 2 ? null : Math.sqrt(values.reduce((a, v) => a + (v - mean!) ** 2, 0) / (n - 1)) };
}
