/// Limits of an organization as they are typed: an empty field is no limit. No DOM.
import type { Limits } from '../../api/organizations';

export const LIMITS = [
  ['sites', 'Sites'],
  ['missions', 'Flights'],
  ['measurements', 'Measurements'],
  ['anchors', 'Anchors'],
  ['requests_per_minute', 'Requests a minute'],
] as const satisfies readonly (readonly [keyof Limits, string])[];

export type Typed = Readonly<Record<keyof Limits, string>>;
export const typed_of = (limits: Limits): Typed =>
  Object.fromEntries(LIMITS.map(([key]) => [key, limits[key] === null ? '' : String(limits[key])])) as Typed;

/// The limits, or what is wrong with the first that is none. Spaces between groups of digits are read over.
export function limits_of(typed: Typed): Limits | string {
  const limits = {} as Record<keyof Limits, number | null>;
  for (const [key, words] of LIMITS) {
    const text = typed[key].replace(/[\s\u202f]/g, '');
    if (text !== '' && !/^\d{1,15}$/.test(text))
      return `${words}: “${typed[key]}” is not a whole number. Write it in digits, or leave the field empty for no limit.`;
    if (key === 'requests_per_minute' && text !== '' && (Number(text) < 1 || Number(text) > 1_000_000))
      return `${words}: 1 to 1 000 000, or empty for no limit.`;
    limits[key] = text === '' ? null : Number(text);
  }
  return limits;
}
