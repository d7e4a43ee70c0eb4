/// What the map draws of the procedure at a moment of a stored flight: the point flown to, those measured at, and the candidates where they were
/// kept. No DOM.
import { enu_from_geodetic } from '../../map/enu';
import type { FlightPicture, Point } from '../../map/flight_layer';
import { places_at } from '../../state/moment';
import type { Recording } from '../../state/recording';
import type { Scene } from '../../state/scene';
import { decision_picture } from '../flight/picture';
import { flying } from '../flight/words';

/// Null where no place of the globe is known of the flight, as in a local frame.
export function flown_picture(
  { mission, poses, marks }: Recording,
  t_us: number,
  scene: Pick<Scene, 'procedure' | 'grid'>,
): FlightPicture | null {
  const first = poses.find((p) => p.lon !== null && p.lat !== null),
    origin = mission.origin ?? (first ? { lon: first.lon!, lat: first.lat!, h_m: first.h_m ?? 0 } : null);
  if (!origin) return null;
  const at = (c: { readonly lon: number; readonly lat: number }): Point => {
    const [e, n] = enu_from_geodetic({ ...c, h_m: origin.h_m }, origin);
    return [e, n];
  };
  const { target, measured } = places_at(marks, t_us),
    procedure = scene.procedure?.value,
    grid = procedure && flying(procedure) ? scene.grid?.value : null;
  return {
    outline: [],
    fence: [],
    no_fly: [],
    waypoints: [],
    reached: 0,
    candidates: grid ? decision_picture(grid, at).candidates : [],
    visited: measured.map(at),
    target: target && at(target),
    heights: null,
  };
}
