/// Estimates come whole once, then as what changed of them (asyncapi: sub, params.deltas). Put together again here, so that nothing behind the
/// client knows of it. No DOM.
import { obj, str, unchecked } from './messages';
import type { Topic } from './stream';

type Obj = Readonly<Record<string, unknown>>;

/// What `changed` makes of `known`: a member that is an object in both is a change of it, an object in the place of an array one of its elements.
function merged(known: Obj, changed: Obj): Obj {
  const out: Record<string, unknown> = { ...known };
  for (const [key, value] of Object.entries(changed)) {
    const now = out[key],
      part = obj(value),
      whole = obj(now);
    if (part && whole) out[key] = merged(whole, part);
    else if (part && Array.isArray(now))
      out[key] = now.map((e: unknown, i) => {
        const element = obj(e),
          of = obj(part[i]);
        return element && of ? merged(element, of) : e;
      });
    else out[key] = value;
  }
  return out;
}

export class Whole {
  private readonly known = new Map<string, Obj>();

  snap(data: unknown): void {
    this.known.clear();
    for (const o of this.list(data)) this.known.set(this.key(o), o);
  }
  /// Every element whole; null when a part is of one that is not known, and the topic has to be asked for anew.
  data(data: unknown): Obj[] | null {
    const out: Obj[] = [];
    for (const o of this.list(data)) {
      const before = this.known.get(this.key(o));
      if (!before && unchecked<Topic<'anchors.estimates'>>(o)?.status === undefined) return null;
      const now = before ? merged(before, o) : o;
      this.known.set(this.key(o), now);
      out.push(now);
    }
    return out;
  }
  private list(data: unknown): Obj[] {
    return (Array.isArray(data) ? data : [data]).map(obj).filter((o) => o !== null);
  }
  private key(o: Obj): string {
    const of = unchecked<Topic<'anchors.estimates'>>(o);
    return `${str(of?.mission)} ${str(of?.anchor)}`;
  }
}
