/// A part of the page that comes in a chunk of its own: once, and again when the link has come back, since a request into a dead network ends minutes later.
import { useEffect, useState } from 'preact/hooks';
import { when_back } from '../state/store';
import { useStable } from './use_stable';

export function useLater<T>(load: () => Promise<T>): {
  readonly part: T | null;
  readonly failed: boolean;
  readonly again: () => void;
} {
  const [part, set_part] = useState<T | null>(null),
    [failed, set_failed] = useState(false);
  const again = useStable((): void => {
    load().then(
      (v) => {
        set_part(() => v);
        set_failed(false);
      },
      () => set_failed(true),
    );
  });
  useEffect(again, [again]);
  const missing = part === null;
  useEffect(() => (missing ? when_back(again) : undefined), [missing, again]);
  return { part, failed, again };
}
