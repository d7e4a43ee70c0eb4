/// Who uses the page: its sheet comes when it is needed, the moment it is known that nobody is signed in.
import { me } from '../state/session';
import { sign_in_asked } from './sign_in_state';
import { useLater } from './use_later';

export const load_sign_in = () => import('./sign_in_sheet').then((m) => m.SignInSheet);
function Sheet() {
  const { part: SignInSheet } = useLater(load_sign_in);
  return SignInSheet ? <SignInSheet /> : null;
}
export const SignIn = () => (me.value === null || sign_in_asked.value ? <Sheet /> : null);
