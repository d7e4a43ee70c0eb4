import { useEffect, useRef, useState } from 'preact/hooks';
import { ApiError } from '../api/client';
import { me, sign_in, sign_out } from '../state/session';
import { live_source, synced } from '../state/store';
import { Icon } from './marks';
import { close_sign_in } from './sign_in_state';
import { useDialog } from './use_dialog';

/// A small sheet, no redirect: the last picture stays behind it.
export function SignInSheet() {
  const input = useRef<HTMLInputElement>(null);
  const [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(false);
  const signed_out = me.value === null;
  useEffect(() => {
    if (signed_out) input.current?.focus();
  }, [signed_out]);
  const box = useDialog<HTMLElement>(close_sign_in, 'access', !signed_out);
  const submit = async (e: Event): Promise<void> => {
    e.preventDefault();
    const token = input.current?.value.trim() ?? '';
    if (!token) return set_problem('Paste a token first.');
    set_busy(true);
    try {
      await sign_in(token);
      if (me.value === null)
        set_problem('The token was accepted, but the session was not stored: are cookies blocked?');
      else {
        set_problem('');
        close_sign_in();
        live_source()?.retryNow();
      }
    } catch (x) {
      set_problem(
        x instanceof ApiError
          ? x.problem.status === 401
            ? 'This token is unknown, or it was revoked or has expired.'
            : x.message
          : String(x),
      );
    } finally {
      set_busy(false);
    }
  };
  const who = me.value;
  return (
    <section class="sheet" {...box} aria-labelledby="sign-in-title" data-testid="sign-in">
      <div class="hd">
        <h2 id="sign-in-title">
          {signed_out ? 'Signed out' : who?.auth === 'off' ? 'Open access' : (who?.name ?? 'User')}
        </h2>
        {!signed_out && (
          <button class="btn quiet small" aria-label="Close" onClick={close_sign_in}>
            <Icon name="close" />
          </button>
        )}
      </div>
      {who ? (
        <>
          <p>
            {who.auth === 'off'
              ? 'The server runs without tokens and answers this machine only. Everything is allowed.'
              : `Roles: ${who.roles.join(', ')}.`}
          </p>
          {who.auth !== 'off' && (
            <button
              class="btn"
              onClick={() => {
                void sign_out();
                close_sign_in();
              }}
            >
              Sign out
            </button>
          )}
        </>
      ) : (
        <form onSubmit={(e) => void submit(e)}>
          <p>
            {synced.value ? 'What you see are the last values. ' : ''}Paste a token to go on;{' '}
            <code>anchord token create</code> makes one.
          </p>
          <label class="lab" for="token">
            Token
          </label>
          <input
            id="token"
            ref={input}
            type="password"
            autocomplete="current-password"
            spellcheck={false}
            placeholder="anc_…"
            data-testid="token"
            aria-describedby="token-problem"
          />
          <p id="token-problem" class="bad" role="status">
            {problem}
          </p>
          <button class="btn primary" type="submit" disabled={busy} data-testid="sign-in-submit">
            {busy ? 'Checking' : 'Sign in'}
          </button>
        </form>
      )}
    </section>
  );
}
