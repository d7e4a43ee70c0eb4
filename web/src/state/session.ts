import { computed, signal } from '@preact/signals';
import { ApiError } from '../api/client';
import { call, get, type Wire } from '../api/contract';
import { obj, str, texts, type Unchecked } from '../live/messages';

export interface Me {
  readonly name: string;
  readonly roles: readonly string[];
  readonly auth: string;
  readonly sites: readonly string[] | null; ///< that the token is bound to; null: every site
}
/// undefined: not asked yet; null: signed out.
export const me = signal<Me | null | undefined>(undefined);

export const may = (...roles: string[]): boolean =>
  !!me.value && (me.value.auth === 'off' || me.value.roles.some((r) => r === 'admin' || roles.includes(r)));
/// What is of the whole server (devices, models, tokens) is refused to a token that is bound to sites.
export const of_every_site = computed(() => !me.value?.sites);
export const may_publish = computed(() => may('engineer', 'operator', 'op'));

function me_of(answer: Unchecked<Wire<'Me'>>): Me | null {
  const o = obj(answer);
  return (
    o && {
      name: str(o.name),
      roles: texts(o.roles),
      sites: Array.isArray(o.sites) ? texts(o.sites) : null,
      auth: str(o.auth) || (str(o.token_id) === 'local' ? 'off' : 'on'),
    }
  );
}
/// Asks who we are; signed out where the server itself says 401. Other trouble leaves what is known: a lost link, or somebody else who answers on
/// the way, is not a lost session.
export async function refresh_me(): Promise<void> {
  try {
    me.value = me_of(await get('/me'));
  } catch (e) {
    if (e instanceof ApiError && e.problem.type && [401, 403].includes(e.problem.status)) me.value = null;
  }
}
export async function sign_in(token: string): Promise<void> {
  await call('post', '/session', { body: { token } });
  await refresh_me();
}
export async function sign_out(): Promise<void> {
  await call('delete', '/session');
  me.value = null;
}
