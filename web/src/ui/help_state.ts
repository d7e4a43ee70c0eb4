import { signal } from '@preact/signals';

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
