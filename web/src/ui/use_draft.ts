import { useState } from 'preact/hooks';
import { draft_of, drop_draft, keep_draft, restored } from '../state/drafts';

/// A form that survives a reload: [values, change, forget]. `forget` once it was sent or thrown away.
export function useDraft<T extends object>(
  key: string,
  start: T,
): readonly [T, (part: Partial<T>) => void, () => void] {
  const [held, set] = useState<{ readonly key: string; readonly value: T } | null>(null);
  const value = held?.key === key ? held.value : restored(start, draft_of(key)?.value);
  const change = (part: Partial<T>): void => {
    const now = { ...value, ...part };
    keep_draft(key, now);
    set({ key, value: now });
  };
  return [
    value,
    change,
    () => {
      drop_draft(key);
      set({ key, value: start });
    },
  ];
}
