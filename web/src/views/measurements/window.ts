/// Rows of a list that is longer than what is kept of it: pages by keyset cursor, only those near what is looked at. No DOM.
export const PAGE_ROWS = 200,
  PAGES_KEPT = 6;

export interface Rows<T> {
  readonly cursors: readonly (string | null)[]; ///< that opens page i; the last may not have been asked for yet
  readonly sizes: readonly number[]; ///< of the pages that came; a page of a class may hold fewer than asked, or none
  readonly kept: ReadonlyMap<number, readonly T[]>;
}
export const nothing = <T>(): Rows<T> => ({ cursors: [null], sizes: [], kept: new Map() });
export const at_end = <T>(r: Rows<T>): boolean => r.cursors.length === r.sizes.length;
export const known = <T>(r: Rows<T>): number => r.sizes.reduce((a, b) => a + b, 0);

/// Page and place in it of row i; null beyond what is known.
function place<T>(r: Rows<T>, i: number): readonly [number, number] | null {
  let before = 0;
  for (const [page, size] of r.sizes.entries()) {
    if (i < before + size) return i < 0 ? null : [page, i - before];
    before += size;
  }
  return null;
}
export function row<T>(r: Rows<T>, i: number): T | undefined {
  const at = place(r, i);
  return at ? r.kept.get(at[0])?.[at[1]] : undefined;
}
export function index_of<T>(r: Rows<T>, is: (row: T) => boolean): number {
  let before = 0;
  for (const [page, size] of r.sizes.entries()) {
    const found = r.kept.get(page)?.findIndex(is) ?? -1;
    if (found >= 0) return before + found;
    before += size;
  }
  return -1;
}
/// The page to ask for next when rows first to last are to be drawn; null when all of them are here.
export function lacking<T>(r: Rows<T>, first: number, last: number): number | null {
  for (let i = Math.max(0, first); i <= last;) {
    const at = place(r, i);
    if (!at) break;
    if (!r.kept.has(at[0])) return at[0];
    i += r.sizes[at[0]]! - at[1];
  }
  return !at_end(r) && last >= known(r) - PAGE_ROWS / 4 ? r.sizes.length : null;
}
/// A page came. What is farthest from it goes.
export function arrived<T>(r: Rows<T>, page: number, rows: readonly T[], next: string | null): Rows<T> {
  const fresh = page === r.sizes.length,
    kept = new Map(r.kept).set(page, rows);
  while (kept.size > PAGES_KEPT)
    kept.delete([...kept.keys()].reduce((a, b) => (Math.abs(b - page) > Math.abs(a - page) ? b : a)));
  // A page asked for again is as long as it was: rows are never changed, and new ones come before the first or after the last.
  return {
    cursors: fresh && next !== null ? [...r.cursors, next] : r.cursors,
    sizes: fresh ? [...r.sizes, rows.length] : r.sizes,
    kept,
  };
}
