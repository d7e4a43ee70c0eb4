import { signal } from '@preact/signals';
import { useLater } from './use_later';

export const help_open = signal(false);
const KEY = 'anchord.keys';
export const keys_on = signal(
  (() => {
    try {
      return localStorage.getItem(KEY) !== 'off';
    } catch {
      return true;
    }
  })(),
);

export function set_keys(on: boolean): void {
  keys_on.value = on;
  try {
    localStorage.setItem(KEY, on ? 'on' : 'off');
  } catch {
    /* not remembered */
  }
}

export const load_help = () => import('./help_sheet').then((m) => m.HelpSheet);
function Sheet() {
  const { part: HelpSheet } = useLater(load_help);
  return HelpSheet ? <HelpSheet /> : null;
}
export const Help = () => (help_open.value ? <Sheet /> : null);
