/// The tags of a table of ranges, and addresses that are tag and anchor. No DOM.
import type { Columns } from './names';
import type { Table } from './table_file';

export function tags_of(t: Table, c: Columns): readonly [readonly string[], readonly string[]] {
  const [tag, anchor, kind] = (['tag', 'anchor', 'kind'] as const).map((f) =>
      c[f] === undefined ? -1 : t.columns.indexOf(c[f]),
    ) as [number, number, number],
    tags = new Set<string>(),
    anchors = new Set<string>();
  for (const row of t.rows) {
    if (row[kind] === 'anchor_anchor') continue;
    if (row[tag]) tags.add(row[tag]);
    if (row[anchor]) anchors.add(row[anchor]);
  }
  return [[...tags], [...tags].filter((x) => anchors.has(x))];
}
