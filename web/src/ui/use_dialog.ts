/// What every dialog owes the keyboard: it has the focus when it opens, Escape closes it (of several the newest), and the focus goes back to where
/// it came from. Its role comes from here too, so that none is made without the rest.
import type { RefObject } from 'preact';
import { useLayoutEffect, useRef } from 'preact/hooks';
import { useStable } from './use_stable';

export interface Dialog<T extends HTMLElement> {
  readonly role: 'dialog';
  readonly 'data-help': string;
  readonly tabIndex: -1;
  readonly ref: RefObject<T>;
}

const opened: { readonly help: string }[] = []; ///< newest last
/// The page of the guide for the newest dialog; undefined where none is open.
export const help_of_dialog = (): string | undefined => opened.at(-1)?.help;
/// What has the focus, or had it until it was disabled while it works, or taken away: that ends the focus too, but nobody left it. A field that was
/// left is no opener.
let focused: HTMLElement | null = null;
globalThis.addEventListener?.('focusin', (e) => {
  if (e.target instanceof HTMLElement) focused = e.target;
});
globalThis.addEventListener?.('focusout', (e) => {
  const left = e.target as HTMLElement;
  queueMicrotask(() => {
    if (focused === left && left.isConnected && !left.matches(':disabled')) focused = null;
  });
});
const nowhere = (): boolean => !document.activeElement || document.activeElement === document.body;

/// To the opener, or what has come in its place; else to the view.
function give_back(opener: HTMLElement | null): void {
  opener?.focus();
  setTimeout(() => {
    if (!nowhere()) return;
    const id = opener?.dataset.testid,
      again = id && document.querySelector<HTMLElement>(`[data-testid="${CSS.escape(id)}"]`);
    if (again) again.focus();
    if (nowhere()) document.getElementById('main')?.focus({ preventScroll: true });
  });
}

/// Attributes of the dialog's element. `help`: the page of the guide for it. `open`: of a dialog whose component stays.
export function useDialog<T extends HTMLElement>(close: () => void, help: string, open = true): Dialog<T> {
  const ref = useRef<T>(null),
    end = useStable(close);
  // With the dialog itself, not after the next picture: one that is seen is closed by Escape.
  useLayoutEffect(() => {
    if (!open) return;
    const me = { help },
      opener = nowhere() ? focused : (document.activeElement as HTMLElement),
      here = ref.current;
    opened.push(me);
    if (here && !here.contains(document.activeElement)) here.focus();
    const on_key = (e: KeyboardEvent): void => {
      if (e.key !== 'Escape' || e.defaultPrevented || opened.at(-1) !== me) return;
      e.preventDefault();
      end();
    };
    document.addEventListener('keydown', on_key);
    return () => {
      document.removeEventListener('keydown', on_key);
      opened.splice(opened.indexOf(me), 1);
      if (nowhere() || here?.contains(document.activeElement)) give_back(opener);
    };
  }, [open, end, help]);
  return { role: 'dialog', 'data-help': help, tabIndex: -1, ref };
}
