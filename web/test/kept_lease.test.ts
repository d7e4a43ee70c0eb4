import { describe, expect, it } from 'vitest';
import { put_lease, take_lease } from '../src/views/flight/kept_lease';

function storage(): Pick<Storage, 'getItem' | 'setItem' | 'removeItem'> & { readonly kept: Map<string, string> } {
  const kept = new Map<string, string>();
  return {
    kept,
    getItem: (k) => kept.get(k) ?? null,
    setItem: (k, v) => void kept.set(k, v),
    removeItem: (k) => void kept.delete(k),
  };
}
const held = { mission: 'm', key: 'k', since_us: 1, expires_us: 2 };

describe('control over a reload', () => {
  it('is had by the page that comes after, and by no second one', () => {
    const tab = storage();
    put_lease(tab, held);
    expect(take_lease(tab)).toEqual(held);
    expect(take_lease(tab)).toBeNull();
    expect(tab.kept.size).toBe(0);
  });
  it('is not kept of a page that had none', () => {
    const tab = storage();
    put_lease(tab, held);
    put_lease(tab, null);
    expect(take_lease(tab)).toBeNull();
  });
  it('is none where what is kept is no lease, or the browser keeps nothing', () => {
    const tab = storage();
    for (const text of ['', 'x', '[]', '{"mission":"m"}', '{"mission":"m","key":"k","since_us":"1","expires_us":2}']) {
      tab.setItem('anchord.control', text);
      expect(take_lease(tab), text).toBeNull();
    }
    const closed = (): never => {
      throw new Error('denied');
    };
    const none = { getItem: closed, setItem: closed, removeItem: closed };
    expect(take_lease(none)).toBeNull();
    expect(() => put_lease(none, held)).not.toThrow();
  });
});
