/// One anchor of a calibration under review: where it is among the others, why, error budget, residuals, history.
import type { AnchorRow } from '../api/anchors';
import { geodetic_from_enu, type Geodetic } from '../map/enu';
import { MapBox } from '../map/map_box';
import { likelier } from '../state/done';
import { backdrops } from '../state/floors';
import { watched_lost } from '../state/store';
import { AnchorDetail } from './anchor_detail';

const nothing = (): void => undefined;
/// From which the metres of a calibration count: back from an anchor that has a place on the globe as well.
function origin_of(rows: readonly AnchorRow[]): Geodetic | null {
  const row = rows.find((r) => r.lon !== null && r.lat !== null && r.h_m !== null && r.enu_m !== null);
  if (!row) return null;
  const [e, n, u] = row.enu_m!;
  return { ...geodetic_from_enu(-e, -n, { lon: row.lon!, lat: row.lat!, h_m: row.h_m! }), h_m: row.h_m! - u };
}

export function ReviewAnchor({
  row,
  rows,
  pick,
}: {
  row: AnchorRow;
  rows: readonly AnchorRow[];
  pick: (anchor: string) => void;
}) {
  const origin = origin_of(rows);
  return (
    <section class="reviewed" aria-label={`Anchor ${row.anchor}`} data-testid="review-anchor">
      <MapBox
        content={() => ({
          anchors: rows.map(likelier),
          selected: row.anchor,
          scene: null,
          link_lost: watched_lost(),
          running: false,
          backdrops: backdrops(origin),
        })}
        onSelect={pick}
        label="Map of the anchors under review"
        follow={false}
        version={row}
        zero="the origin of the calibration"
      />
      <AnchorDetail row={likelier(row)} live={false} draft changed={nothing} />
    </section>
  );
}
