/// What the map draws of the procedure at a moment of a stored flight: what Live drew, or where only events were kept, the point flown to and those
/// measured at. No DOM.
import { enu_from_geodetic } from '../../map/enu';
import type { FlightPicture, Point } from '../../map/flight_layer';
import { places_at } from '../../state/moment';
import type { Recording } from '../../state/recording';
import type { Scene } from '../../state/scene';
import { picture_of } from '../flight/picture';

/// Null where no place of the globe is known of the flight, as in a local frame.
export function flown_picture({ mission, poses, marks }: Recording, t_us: number, scene: Scene): FlightPicture | null {
  const first = poses.find((p) => p.lon !== null && p.lat !== null),
    origin = mission.origin ?? (first ? { lon: first.lon!, lat: first.lat!, h_m: first.h_m ?? 0 } : null);
  if (!origin) return null;
  const at = (c: { readonly lon: number; readonly lat: number }): Point => {
    const [e, n] = enu_from_geodetic({ ...c, h_m: origin.h_m }, origin);
    return [e, n];
  };
  const shown = picture_of(scene, scene.flown, origin);
  if (shown) return shown;
  const { target, measured } = places_at(marks, t_us);
  return {
    outline: [],
    fence: [],
    no_fly: [],
    waypoints: [],
    reached: 0,
    candidates: [],
    visited: measured.map(at),
    target: target && at(target),
    heights: null,
  };
}
