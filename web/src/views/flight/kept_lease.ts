/// The lease of this page over a reload. It lies in the storage of the tab only while no page of it is there: put in when the page goes, taken out by the
/// one that comes. A tab that is duplicated meanwhile gets none, and whether a lease that was taken out still stands is the server's answer. No DOM.
import { num, obj, str } from '../../live/messages';
import type { Held } from './control';

const KEY = 'anchord.control';
type Kept = Pick<Storage, 'getItem' | 'setItem' | 'removeItem'>;

export function put_lease(storage: Kept, held: Held | null): void {
  try {
    if (held) storage.setItem(KEY, JSON.stringify(held));
    else storage.removeItem(KEY);
  } catch {
    /* the browser keeps nothing: control is taken again */
  }
}
export function take_lease(storage: Kept): Held | null {
  try {
    const o = obj(JSON.parse(storage.getItem(KEY) ?? 'null') as unknown);
    storage.removeItem(KEY);
    const [mission, key, since_us, expires_us] = [str(o?.mission), str(o?.key), num(o?.since_us), num(o?.expires_us)];
    return mission && key && since_us !== null && expires_us !== null ? { mission, key, since_us, expires_us } : null;
  } catch {
    return null;
  }
}
