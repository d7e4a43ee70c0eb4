/// One anchor of a calibration under review: where it is among the others, why, error budget, residuals, history.
import type { AnchorRow } from '../api/anchors';
import { MapBox } from '../map/map_box';
import { likelier } from '../state/done';
import { watched_lost } from '../state/store';
import { AnchorDetail } from './anchor_detail';

const nothing = (): void => undefined;

export function ReviewAnchor({
  row,
  rows,
  pick,
}: {
  row: AnchorRow;
  rows: readonly AnchorRow[];
  pick: (anchor: string) => void;
}) {
  return (
    <section class="reviewed" aria-label={`Anchor ${row.anchor}`} data-testid="review-anchor">
      <MapBox
        content={() => ({
          anchors: rows.map(likelier),
          selected: row.anchor,
          scene: null,
          link_lost: watched_lost(),
          running: false,
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
