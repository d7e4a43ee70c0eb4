/// Who uses the page: its sheet comes when it is needed, the moment it is known that nobody is signed in.
import { signal } from '@preact/signals';
import { me } from '../state/session';
import { useLater } from './use_later';

const shown = signal(false);
export const open_sign_in = (): void => {
  shown.value = true;
};
export const close_sign_in = (): void => {
  shown.value = false;
};

export const load_sign_in = () => import('./sign_in_sheet').then((m) => m.SignInSheet);
function Sheet() {
  const { part: SignInSheet } = useLater(load_sign_in);
  return SignInSheet ? <SignInSheet /> : null;
}
export const SignIn = () => (me.value === null || shown.value ? <Sheet /> : null);
