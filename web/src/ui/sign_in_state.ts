import { signal } from '@preact/signals';

/// Whether the sheet was asked for; it is also there while nobody is signed in.
export const sign_in_asked = signal(false);
export const open_sign_in = (): void => {
  sign_in_asked.value = true;
};
export const close_sign_in = (): void => {
  sign_in_asked.value = false;
};
