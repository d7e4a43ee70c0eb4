/// Fly again: a plan for the anchors of a flight that lack something, from the plan that was flown. No DOM.
import type { AnchorRow } from '../api/anchors';
import type { Plan, Waypoint } from '../api/plans';
import { enu_from_geodetic } from '../map/enu';

const REACH_M = 25; ///< a point that is further off adds little to what is known of an anchor
const POINTS_MAX = 12; ///< for each anchor, the nearest ones: all sides and both heights of it

/// `proposed`: a whole flight round the building. Of its points those about the anchors that lack something are measured; on the nearest
/// one of each, a turn and a height search: side and height are what is missing most often. Null where no anchor has a place.
export function again(plan: Plan, proposed: readonly Waypoint[], lacking: readonly AnchorRow[]): Plan | null {
  const placed = lacking.filter((r) => r.lon !== null && r.lat !== null),
    points = proposed.map((w, index) => ({ w, index })).filter(({ w }) => w.measure);
  if (!placed.length || !points.length) return null;
  const kept = new Set<number>(),
    sought = new Set<number>();
  for (const r of placed) {
    // Where two places fit, the points about either tell them apart.
    const places = [r, r.mirror].filter((p) => p?.lon != null && p.lat != null);
    const away = (w: Waypoint): number =>
      Math.min(
        ...places.map((p) => {
          const [e, n] = enu_from_geodetic({ lon: w.lon, lat: w.lat, h_m: 0 }, { lon: p!.lon!, lat: p!.lat!, h_m: 0 });
          return Math.hypot(e, n);
        }),
      );
    const near = points
      .map((p) => ({ index: p.index, d: away(p.w) }))
      .sort((a, b) => a.d - b.d)
      .filter(({ d }, i) => i < 4 || (i < POINTS_MAX && d <= REACH_M));
    for (const { index } of near) kept.add(index);
    sought.add(near[0]!.index);
  }
  // Ways between measured points stay: they lead round the building.
  const first = Math.min(...kept),
    last = Math.max(...kept);
  return {
    ...plan,
    id: null,
    revision: 0,
    name: `Again: ${lacking.map((r) => r.anchor).join(', ')}`.slice(0, 120),
    expected: lacking.map((r) => r.anchor),
    waypoints: proposed.flatMap((w, i): Waypoint[] =>
      i < first || i > last
        ? []
        : kept.has(i)
          ? [{ ...w, turn: w.turn || sought.has(i), height_search: w.height_search || sought.has(i) }]
          : [{ ...w, measure: false, turn: false, height_search: false }],
    ),
  };
}
