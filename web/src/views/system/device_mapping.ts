/// The mapping of an mqtt or ndjson device as it is typed: JSON, and what can be told of it before the server reads it. No DOM.
import { obj } from '../../live/messages';

/// What a file may have before it is read into the form; a mapping with white space and long names is far below.
export const MOST_FILE_BYTES = 100_000;
const LENGTHS = ['m', 'cm', 'mm', 'ft'];

type Json = Readonly<Record<string, unknown>>;
export const mapping_text = (mapping: unknown): string => (mapping == null ? '' : JSON.stringify(mapping, null, 2));
/// null: it is no JSON object, and `mapping_fault` tells why.
export function mapping_of(text: string): Json | null {
  try {
    const parsed: unknown = JSON.parse(text);
    return Array.isArray(parsed) ? null : obj(parsed);
  } catch {
    return null;
  }
}

/// Line and column of what JSON.parse rejected, where the browser tells; each has its own words.
function place_of(text: string, words: string): string {
  const named = /line (\d+) column (\d+)/.exec(words);
  if (named) return ` at line ${named[1]}, column ${named[2]}`;
  const position = /position (\d+)/.exec(words);
  if (!position) return '';
  const lines = text.slice(0, Number(position[1])).split('\n');
  return ` at line ${lines.length}, column ${lines.at(-1)!.length + 1}`;
}
function syntax_fault(text: string): string {
  if (!/^\s*[{[]/.test(text) && /^\s*[\w.-]+\s*=/m.test(text))
    return 'Mapping: this looks like TOML. Write it as JSON, or set the device up with: anchord devices add ... mapping_file=FILE.toml';
  try {
    JSON.parse(text);
    return 'Mapping: must be a JSON object. Paste all of it, from { to }.';
  } catch (e) {
    return `Mapping: not valid JSON${place_of(text, String(e))}. Correct it there: names in double quotes, a comma between members, none at the end.`;
  }
}

export const bytes_of = (text: string): number => new TextEncoder().encode(text).length;
/// Section 4.7 of MQTT 3.1.1, as the server reads it; empty where it is a filter.
export function topic_fault(filter: string): string {
  const levels = filter.split('/'),
    wrong = levels.find(
      (l, i) => (l.includes('+') && l !== '+') || (l.includes('#') && (l !== '#' || i + 1 < levels.length)),
    );
  if (bytes_of(filter) > 1000) return 'Topic: longer than 1000 bytes. Shorten it with + or #.';
  return wrong === undefined
    ? ''
    : `Topic: "${wrong}" cannot be a level. + is a whole level, # the whole last one, like uwb/+/ranges.`;
}

/// `topic`: the one of the form, which goes before that of the mapping; null: the link has no topics. The rest of a mapping is checked by the
/// server, which names every fault.
export function mapping_fault(text: string, topic: string | null): string {
  if (!text.trim()) return 'Mapping: missing. Paste the JSON object, or choose its file.';
  const mapping = mapping_of(text);
  if (!mapping) return syntax_fault(text);
  const lacks = ['tag', 'anchor'].find((key) => !(key in mapping));
  if (lacks) return `Mapping: "${lacks}" is missing. Add where the id is, like "${lacks}": "/${lacks}".`;
  const unit = obj(mapping.distance)?.unit;
  if (typeof unit !== 'string' || !LENGTHS.includes(unit))
    return `Mapping: "distance" needs a pointer and a unit (${LENGTHS.join(', ')}), like {"pointer": "/mm", "unit": "mm"}.`;
  if (topic === null)
    return 'topic' in mapping ? 'Mapping: "topic" is only for MQTT; lines have no topic. Remove it.' : '';
  return topic.trim() || mapping.topic
    ? ''
    : 'Topic: missing. Type it, like uwb/+/ranges, or add "topic" to the mapping.';
}
