/// Who of the air has other radio settings than the others, in words. No DOM.
import type { Radio } from '../../api/devices';
import { num, obj } from '../../live/messages';

export interface Tuned {
  readonly id: string;
  readonly name: string;
  readonly radio: Radio | null;
  readonly options: Readonly<Record<string, unknown>>;
}
export interface Difference {
  readonly id: string;
  readonly title: string;
  readonly text: string;
}
const KEYS = ['channel', 'rate_kbps', 'prf_mhz', 'preamble_symbols'] as const;
type Air = Pick<Radio, (typeof KEYS)[number]>;

export const radio_words = (r: Air): string =>
  `channel ${r.channel}, ${r.rate_kbps} kbit/s, PRF ${r.prf_mhz} MHz, ${r.preamble_symbols} symbols`;
const same = (a: Air, b: Air): boolean => KEYS.every((k) => a[k] === b[k]);

const count = (n: number, t: Tuned): string => `${n} of ${t.radio!.devices.length} anchors ${n === 1 ? 'has' : 'have'}`;

export function radio_differences(tags: readonly Tuned[]): Difference[] {
  const out: Difference[] = [],
    [first, ...rest] = tags.filter((t) => t.radio !== null);
  for (const t of rest)
    if (!same(t.radio!, first!.radio!))
      out.push({
        id: t.id,
        title: 'Two tags, two radio settings.',
        text: `${t.name} is on ${radio_words(t.radio!)}; ${first!.name} on ${radio_words(first!.radio!)}. An anchor receives only one of them.`,
      });
  for (const t of tags) {
    const apart = t.radio?.devices.filter((p) => !p.done) ?? [],
      wish = obj(t.options.uwb);
    const deaf = apart.filter((p) => !p.why.startsWith('has ')),
      other = apart.filter((p) => p.why.startsWith('has ')),
      ids = (list: typeof apart): string => list.map((p) => p.network_id).join(', ');
    if (other.length)
      out.push({
        id: t.id,
        title: `${count(other.length, t)} other radio settings than ${t.name}.`,
        text: `${ids(other)}.`,
      });
    if (deaf.length)
      out.push({
        id: t.id,
        title: `${count(deaf.length, t).replace(/ ha(s|ve)$/, deaf.length === 1 ? ' does' : ' do')} not answer ${t.name}.`,
        text: `${ids(deaf)}: switched off, out of range, or on other radio settings.`,
      });
    if (t.radio && wish && KEYS.some((k) => num(wish[k]) !== null && num(wish[k]) !== t.radio![k]))
      out.push({
        id: t.id,
        title: `${t.name} is not on the settings it is set up for.`,
        text: `It is on ${radio_words(t.radio)}.`,
      });
  }
  return out;
}
