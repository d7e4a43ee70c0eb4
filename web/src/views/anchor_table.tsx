import { signal } from '@preact/signals';
import type { AnchorRow } from '../api/anchors';
import { chosen_anchor } from '../state/store';
import { StatusChip } from '../ui/marks';
import { VERDICT_WORDS } from '../ui/words';
import { ALL, shown_columns } from './anchor_columns';

const order = signal<{ key: string; down: boolean }>({ key: 'id', down: false });
export function sorted_rows(rows: readonly AnchorRow[]): AnchorRow[] {
  const { key, down } = order.value;
  const by = ALL.find((c) => c.key === key)?.sort ?? ((r: AnchorRow) => (key === 'status' ? r.status : r.anchor));
  return [...rows].sort((a, b) => {
    const [x, y] = [by(a), by(b)];
    return (x < y ? -1 : x > y ? 1 : a.anchor < b.anchor ? -1 : 1) * (down ? -1 : 1);
  });
}

export function AnchorTable({
  rows,
  selected,
  live,
}: {
  rows: readonly AnchorRow[];
  selected: string | null;
  live: boolean;
}) {
  const shown = shown_columns(live);
  const head = (key: string, text: string, cls: string) => {
    const on = order.value.key === key;
    return (
      <th scope="col" class={cls} aria-sort={on ? (order.value.down ? 'descending' : 'ascending') : 'none'} key={key}>
        <button onClick={() => (order.value = { key, down: on && !order.value.down })}>
          {text}
          {on && <span aria-hidden="true">{order.value.down ? ' ↓' : ' ↑'}</span>}
        </button>
      </th>
    );
  };
  return (
    <table class="tbl" data-testid="anchor-table">
      <caption class="sr">
        {live ? 'Live estimates of the anchors in this flight' : 'Published anchor positions'}
      </caption>
      <thead>
        <tr>
          {head('id', 'Anchor', '')}
          {head('status', 'Status', '')}
          {shown.map((c) => head(c.key, c.head, `num ${c.width ?? ''}`))}
        </tr>
      </thead>
      <tbody>
        {rows.map((r) => (
          <tr
            key={r.anchor}
            class={r.anchor === selected ? 'sel' : ''}
            data-testid={`row-${r.anchor}`}
            onClick={() => (chosen_anchor.value = r.anchor)}
          >
            <th scope="row">
              <button class="id" aria-pressed={r.anchor === selected} onClick={() => (chosen_anchor.value = r.anchor)}>
                {r.anchor}
              </button>
              {r.name && <span class="mut block">{r.name}</span>}
            </th>
            <td>
              <StatusChip status={r.status} />
            </td>
            {r.enu_m || r.lat !== null ? (
              shown.map((c) => (
                <td key={c.key} class={`num ${c.width ?? ''}`}>
                  {c.cell(r)}
                </td>
              ))
            ) : (
              <td class="mut" colSpan={shown.length}>
                {VERDICT_WORDS[r.verdict]}
                {r.reason && `: ${r.reason}`}
              </td>
            )}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
