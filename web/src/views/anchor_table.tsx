import { signal } from '@preact/signals';
import type { AnchorRow } from '../api/anchors';
import { sigma_h, sigma_v } from '../map/enu';
import { chosen_anchor } from '../state/store';
import { bearing, fixed, latlon, metres } from '../ui/format';
import { StatusChip } from '../ui/marks';
import { VERDICT_WORDS } from '../ui/words';

interface Column { readonly key: string; readonly head: string; readonly cell: (r: AnchorRow) => string; readonly sort: (r: AnchorRow) => number | string; readonly width?: 'wide' | 'side-by' }   ///< wide: of large screens only; side-by: not where the detail stands beside the table
const n = (v: number | null | undefined): number => v ?? Infinity;
const ellipse_words = (r: AnchorRow): string => (r.ellipse95 ? `${fixed(r.ellipse95.major_m, 2)} × ${fixed(r.ellipse95.minor_m, 2)} m @ ${bearing(r.ellipse95.azimuth_deg)}°` : '–');

const PLACE_ENU: Column[] = [0, 1, 2].map((i) => ({ key: 'enu'[i]!, head: `${'ENU'[i]}, m`, cell: (r) => metres(r.enu_m?.[i]), sort: (r) => n(r.enu_m?.[i]) }));
const PLACE_GEO: Column[] = [
  { key: 'lat', head: 'Latitude, °', cell: (r) => latlon(r.lat), sort: (r) => n(r.lat) },
  { key: 'lon', head: 'Longitude, °', cell: (r) => latlon(r.lon), sort: (r) => n(r.lon) },
  { key: 'h', head: 'h ellips., m', cell: (r) => metres(r.h_m), sort: (r) => n(r.h_m) },
];
const QUALITY: Column[] = [
  { key: 'sh', head: 'σ h, m', cell: (r) => fixed(sigma_h(r.cov_enu_m2), 3), sort: (r) => n(sigma_h(r.cov_enu_m2)) },
  { key: 'sv', head: 'σ v, m', cell: (r) => fixed(sigma_v(r.cov_enu_m2), 3), sort: (r) => n(sigma_v(r.cov_enu_m2)) },
  { key: 'e95', head: '95 % ellipse', cell: ellipse_words, sort: (r) => n(r.ellipse95?.major_m) },
  { key: 'gdop', head: 'GDOP', cell: (r) => fixed(r.gdop, 2), sort: (r) => n(r.gdop) },
  { key: 'n', head: 'Ranges', cell: (r) => String(r.n_ranges), sort: (r) => r.n_ranges, width: 'side-by' },
  { key: 'rms', head: 'RMS, mm', cell: (r) => fixed(r.rms_residual_m === null ? null : r.rms_residual_m * 1000, 0), sort: (r) => n(r.rms_residual_m), width: 'wide' },
];
export const columns = (live: boolean): Column[] => [...(live ? PLACE_ENU : PLACE_GEO), ...QUALITY];

const order = signal<{ key: string; down: boolean }>({ key: 'id', down: false });
export function sorted_rows(rows: readonly AnchorRow[]): AnchorRow[] {
  const { key, down } = order.value;
  const by = [...PLACE_ENU, ...PLACE_GEO, ...QUALITY].find((c) => c.key === key)?.sort ?? ((r: AnchorRow) => (key === 'status' ? r.status : r.anchor));
  return [...rows].sort((a, b) => { const [x, y] = [by(a), by(b)]; return (x < y ? -1 : x > y ? 1 : a.anchor < b.anchor ? -1 : 1) * (down ? -1 : 1); });
}

export function AnchorTable({ rows, selected, live }: { rows: readonly AnchorRow[]; selected: string | null; live: boolean }) {
  const shown = columns(live);
  const head = (key: string, text: string, cls: string) => {
    const on = order.value.key === key;
    return (
      <th scope="col" class={cls} aria-sort={on ? (order.value.down ? 'descending' : 'ascending') : 'none'} key={key}>
        <button onClick={() => (order.value = { key, down: on && !order.value.down })}>{text}{on && <span aria-hidden="true">{order.value.down ? ' ↓' : ' ↑'}</span>}</button>
      </th>
    );
  };
  return (
    <table class="tbl" data-testid="anchor-table">
      <caption class="sr">{live ? 'Live estimates of the anchors in this flight' : 'Published anchor positions'}</caption>
      <thead><tr>{head('id', 'Anchor', '')}{head('status', 'Status', '')}{shown.map((c) => head(c.key, c.head, `num ${c.width ?? ''}`))}</tr></thead>
      <tbody>
        {rows.map((r) => (
          <tr key={r.anchor} class={r.anchor === selected ? 'sel' : ''} data-testid={`row-${r.anchor}`} onClick={() => (chosen_anchor.value = r.anchor)}>
            <th scope="row"><button class="id" aria-pressed={r.anchor === selected} onClick={() => (chosen_anchor.value = r.anchor)}>{r.anchor}</button>{r.name && <span class="mut block">{r.name}</span>}</th>
            <td><StatusChip status={r.status} /></td>
            {r.enu_m || r.lat !== null ? shown.map((c) => <td key={c.key} class={`num ${c.width ?? ''}`}>{c.cell(r)}</td>) : <td class="mut" colSpan={shown.length}>{VERDICT_WORDS[r.verdict]}{r.reason && `: ${r.reason}`}</td>}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
