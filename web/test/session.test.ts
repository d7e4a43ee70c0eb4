import { afterEach, describe, expect, it, vi } from 'vitest';
import { me, of_every_site, refresh_me } from '../src/state/session';

function answer(body: object): void {
  vi.stubGlobal('document', { baseURI: 'http://127.0.0.1:8420/#/system' });
  vi.stubGlobal('fetch', () =>
    Promise.resolve(new Response(JSON.stringify(body), { headers: { 'Content-Type': 'application/json' } })),
  );
}
afterEach(() => {
  vi.unstubAllGlobals();
  me.value = undefined;
});

describe('who we are', () => {
  const ours = { name: 'crew', roles: ['operator'], token_id: 't', sites: null, auth: 'on' };
  const says = (text: string, status: number): void => {
    vi.stubGlobal('fetch', () => Promise.resolve(new Response(text, { status })));
  };
  it('is kept where a guest network answers with its own page, and forgotten where the server says so', async () => {
    answer(ours);
    await refresh_me();
    for (const status of [200, 401, 403, 511]) {
      says('<html>Welcome to our guest network</html>', status);
      await refresh_me();
      expect(me.value?.name, `${status}`).toBe('crew');
    }
    says(JSON.stringify({ type: '/problems/unauthorized', title: 'Unauthorized', status: 401 }), 401);
    await refresh_me();
    expect(me.value).toBeNull();
  });
});

describe('whether the tools of the whole server are shown', () => {
  it('hides them from a token that is bound to sites, and shows them to any other', async () => {
    expect(of_every_site.value).toBe(true);
    answer({
      name: 'crew',
      roles: ['admin'],
      token_id: 't',
      sites: ['0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f'],
      auth: 'on',
    });
    await refresh_me();
    expect(of_every_site.value).toBe(false);
    answer({ name: 'crew', roles: ['admin'], token_id: 't', sites: null, auth: 'on' });
    await refresh_me();
    expect(of_every_site.value).toBe(true);
  });

  it('hides them from a token whose last site is gone', async () => {
    answer({ name: 'crew', roles: ['admin'], token_id: 't', sites: [], auth: 'on' });
    await refresh_me();
    expect(of_every_site.value).toBe(false);
  });
});
