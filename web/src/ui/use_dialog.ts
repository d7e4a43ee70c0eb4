/// What every dialog owes the keyboard: it has the focus when it opens, Escape closes it, and the focus goes back to where it came from.
import type { RefObject } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { useStable } from './use_stable';

export function useDialog<T extends HTMLElement>(open: boolean, close: () => void): RefObject<T> {
  const box = useRef<T>(null),
    end = useStable(close);
  useEffect(() => {
    if (!open) return;
    const before = document.activeElement,
      here = box.current;
    if (here && !here.contains(before)) here.focus();
    const on_key = (e: KeyboardEvent): void => {
      if (e.key === 'Escape' && !e.defaultPrevented) end();
    };
    document.addEventListener('keydown', on_key);
    return () => {
      document.removeEventListener('keydown', on_key);
      const now = document.activeElement;
      if (before instanceof HTMLElement && before.isConnected && (!now || now === document.body || here?.contains(now)))
        before.focus();
    };
  }, [open, end]);
  return box;
}
