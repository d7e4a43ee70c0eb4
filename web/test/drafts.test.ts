import { afterEach, describe, expect, it, vi } from 'vitest';
import { SECRETS } from '../src/api/generated/secrets';
import { draft_of, drop_draft, keep_draft, newest_draft, restored } from '../src/state/drafts';

/// As a browser's local storage behaves, `room` entries large.
function storage(room = Infinity): Storage {
  const kept = new Map<string, string>();
  return {
    get length() {
      return kept.size;
    },
    key: (i) => [...kept.keys()][i] ?? null,
    getItem: (k) => kept.get(k) ?? null,
    clear: () => kept.clear(),
    removeItem: (k) => void kept.delete(k),
    setItem: (k, v) => {
      if (kept.size >= room && !kept.has(k)) throw new DOMException('full', 'QuotaExceededError');
      kept.set(k, v);
    },
  };
}
/// The page is loaded again: what a module holds is gone, what the browser keeps is not.
async function reloaded(): Promise<typeof import('../src/state/drafts')> {
  vi.resetModules();
  return import('../src/state/drafts');
}
afterEach(() => {
  for (const key of ['plan/a', 'plan/b', 'other']) drop_draft(key);
  vi.unstubAllGlobals();
});

describe('a draft', () => {
  it('is there after the page was loaded again', async () => {
    vi.stubGlobal('localStorage', storage());
    keep_draft('plan/a', { name: 'Hall' }, 5);
    expect((await reloaded()).draft_of('plan/a')).toEqual({ key: 'plan/a', value: { name: 'Hall' }, at_ms: 5 });
  });
  it('is gone once dropped', async () => {
    vi.stubGlobal('localStorage', storage());
    keep_draft('plan/a', 1);
    drop_draft('plan/a');
    expect(draft_of('plan/a')).toBeNull();
    expect((await reloaded()).draft_of('plan/a')).toBeNull();
  });
  it('lives as long as the page where the browser is full or keeps nothing', () => {
    vi.stubGlobal('localStorage', storage(0));
    keep_draft('plan/a', 1);
    expect(draft_of('plan/a')?.value).toBe(1);
    vi.stubGlobal('localStorage', undefined);
    keep_draft('plan/b', 2);
    expect(draft_of('plan/b')?.value).toBe(2);
  });
  it('that is damaged counts as none', () => {
    const kept = storage();
    vi.stubGlobal('localStorage', kept);
    kept.setItem('anchord.draft.1.plan/a', '{"value":');
    expect(draft_of('plan/a')).toBeNull();
  });
});

describe('the newest draft', () => {
  it('is found among those of its kind, of this page and of the one before', async () => {
    vi.stubGlobal('localStorage', storage());
    keep_draft('plan/a', 1, 10);
    keep_draft('other', 3, 30);
    const again = await reloaded();
    again.keep_draft('plan/b', 2, 20);
    expect(again.newest_draft('plan/')?.key).toBe('plan/b');
    again.drop_draft('plan/b');
    expect(again.newest_draft('plan/')?.key).toBe('plan/a');
  });
  it('is none where nothing was kept', () => expect(newest_draft('plan/')).toBeNull());
});

describe('a restored form', () => {
  const start = { name: '', n: 5, los: true, ids: [] as string[] };
  it('has what was typed', () =>
    expect(restored(start, { name: 'x', ids: ['a'] })).toEqual({ name: 'x', n: 5, los: true, ids: ['a'] }));
  it('takes nothing of another kind, and no field it does not have', () =>
    expect(restored(start, { name: 3, n: 'x', ids: {}, more: 1 })).toEqual(start));
  it('is the empty one where nothing was kept', () => expect(restored(start, null)).toEqual(start));
});

describe('a draft of a form with secrets', () => {
  const typed = { kind: 'ntrip', user: 'me', password: 'hunter2', options: [{ token: 'anc_1', mount: 'NEAR' }] },
    kept_of = { kind: 'ntrip', user: 'me', options: [{ mount: 'NEAR' }] };
  it('knows them by the contract', () => expect([...SECRETS]).toEqual(expect.arrayContaining(['password', 'token'])));
  it('holds everything else, in the browser and in memory', () => {
    const kept = storage();
    vi.stubGlobal('localStorage', kept);
    keep_draft('other', typed, 5);
    expect(kept.getItem('anchord.draft.1.other')).toBe(JSON.stringify({ value: kept_of, at_ms: 5 }));
    vi.stubGlobal('localStorage', undefined);
    expect(draft_of('other')?.value).toEqual(kept_of);
  });
  it('of an earlier version of the page loses them when the page is loaded', async () => {
    const kept = storage();
    vi.stubGlobal('localStorage', kept);
    kept.setItem('anchord.draft.1.other', JSON.stringify({ value: typed, at_ms: 5 }));
    kept.setItem('of another program', JSON.stringify({ password: 'theirs' }));
    await reloaded();
    expect(kept.getItem('anchord.draft.1.other')).toBe(JSON.stringify({ value: kept_of, at_ms: 5 }));
    expect(kept.getItem('of another program')).toMatch(/theirs/);
  });
});
