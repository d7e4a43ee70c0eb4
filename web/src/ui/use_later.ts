/// A part of the page that comes in a chunk of its own: once, again when the link has come back, since a request into a dead
/// network ends minutes later, and every few seconds while it fails, since a link may be back before its server is.
import { useEffect, useState } from 'preact/hooks';
import { when_back } from '../state/store';
import { useStable } from './use_stable';

const AGAIN_AFTER_MS = 5000;

export function useLater<T>(load: () => Promise<T>): {
  readonly part: T | null;
  readonly failed: boolean;
  readonly again: () => void;
} {
  const [part, set_part] = useState<T | null>(null),
    [failures, set_failures] = useState(0);
  const again = useStable((): void => {
    load().then(
      (v) => set_part(() => v),
      () => set_failures((n) => n + 1),
    );
  });
  useEffect(again, [again]);
  const missing = part === null;
  useEffect(() => (missing ? when_back(again) : undefined), [missing, again]);
  useEffect(() => {
    if (!missing || failures === 0) return;
    const timer = setTimeout(again, AGAIN_AFTER_MS);
    return () => clearTimeout(timer);
  }, [missing, failures, again]);
  return { part, failed: missing && failures > 0, again };
}
