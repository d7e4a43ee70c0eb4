/// What an address of the dashboard names. No DOM.

/// How many parts may be behind the name of a page; `models` has `runs/<id>`.
const PAGES = {
  live: 0,
  plan: 1,
  anchors: 1,
  measurements: 0,
  models: 2,
  replay: 1,
  system: 1,
  import: 0,
  guide: 1,
} as const;
export type Page = keyof typeof PAGES;
export interface Address {
  readonly page: Page | null; ///< null: there is none of this name
  readonly named: string | null; ///< what of the page: an anchor, a plan, a run, a flight; with its ?query
}

/// Bytes that are no text are shown as they are.
function text(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

export function address_of(hash: string): Address {
  const [path, ...asked] = hash.replace(/^#\/?/, '').split('?'),
    [name = '', ...args] = path!.split('/').filter(Boolean),
    page = name === '' ? 'live' : Object.hasOwn(PAGES, name) ? (name as Page) : null;
  if (page === null || args.length > PAGES[page]) return { page: null, named: null };
  if (page === 'models' && args.length > 0 && !(args[0] === 'runs' && args[1])) return { page: null, named: null };
  const last = args[args.length - 1];
  return { page, named: last === undefined ? null : [text(last), ...asked].join('?') };
}
