/// What a person typed and has not sent: kept on this device until it is sent or thrown away, so that a reload or an empty battery loses nothing.
/// Local storage rather than IndexedDB: it is written before the event ends, and plans and forms are a few kB. Where the browser keeps nothing, memory. No DOM.
/// Never a secret: fields that the contract only has written (passwords, tokens) are left out of every draft, wherever in it they are.
import { SECRETS } from '../api/generated/secrets';
import { obj } from '../live/messages';

const PREFIX = 'anchord.draft.1.'; ///< 1: the form of what is kept; another form is another prefix
const memory = new Map<string, string>();
export interface Draft {
  readonly key: string;
  readonly value: unknown;
  readonly at_ms: number;
}

const without_secrets = (name: string, value: unknown): unknown => (SECRETS.has(name) ? undefined : value);

function stored(): Storage | null {
  try {
    return globalThis.localStorage ?? null;
  } catch {
    return null;
  }
}
function draft_from(key: string, text: string | null | undefined): Draft | null {
  try {
    const o = obj(JSON.parse(text ?? 'null', without_secrets));
    return o && typeof o.at_ms === 'number' ? { key, value: o.value, at_ms: o.at_ms } : null;
  } catch {
    return null;
  }
}

export function keep_draft(key: string, value: unknown, at_ms = Date.now()): void {
  const text = JSON.stringify({ value, at_ms }, without_secrets);
  memory.set(key, text);
  try {
    stored()?.setItem(PREFIX + key, text);
  } catch {
    /* full or forbidden: it lives as long as the page */
  }
}
export function drop_draft(key: string): void {
  memory.delete(key);
  try {
    stored()?.removeItem(PREFIX + key);
  } catch {
    /* nothing was kept there */
  }
}
export const draft_of = (key: string): Draft | null => draft_from(key, memory.get(key) ?? read(key));
function read(key: string): string | null {
  try {
    return stored()?.getItem(PREFIX + key) ?? null;
  } catch {
    return null;
  }
}
/// The newest whose key begins so.
export function newest_draft(prefix: string): Draft | null {
  const keys = new Set(memory.keys());
  try {
    const kept = stored();
    for (let i = 0; kept && i < kept.length; i++) {
      const k = kept.key(i);
      if (k?.startsWith(PREFIX)) keys.add(k.slice(PREFIX.length));
    }
  } catch {
    /* memory alone */
  }
  return [...keys]
    .filter((k) => k.startsWith(prefix))
    .map(draft_of)
    .reduce<Draft | null>((best, d) => (d && (!best || d.at_ms > best.at_ms) ? d : best), null);
}

/// What an earlier version of the page kept of secrets is taken out of this browser.
function forget_secrets(): void {
  try {
    const kept = stored();
    for (let i = 0; kept && i < kept.length; i++) {
      const key = kept.key(i),
        before = key?.startsWith(PREFIX) ? kept.getItem(key) : null,
        draft = before === null ? null : draft_from(key!, before),
        after = draft && JSON.stringify({ value: draft.value, at_ms: draft.at_ms });
      if (key && after && after !== before) kept.setItem(key, after);
    }
  } catch {
    /* nothing is kept here */
  }
}
forget_secrets();

/// A form as it was left: of what is kept, the fields that the form has and that are of its kind.
export function restored<T extends object>(start: T, kept: unknown): T {
  const o = obj(kept),
    out: Record<string, unknown> = { ...(start as Readonly<Record<string, unknown>>) };
  for (const [name, value] of Object.entries(start))
    if (o && name in o && typeof o[name] === typeof value && Array.isArray(o[name]) === Array.isArray(value))
      out[name] = o[name];
  return out as T;
}
