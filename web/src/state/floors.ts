/// The plans of floors under the maps: which there are, which level is shown, and their pictures. Asked for once, when a map is first shown.
import { signal } from '@preact/signals';
import { bytes, list, type Wire } from '../api/contract';
import { enu_from_geodetic, geodetic_from_enu, type Geodetic } from '../map/enu';

export type Floor = Wire<'Floor'>;
/// A picture that is north up, by its corners in metres about the origin of the map.
export interface Backdrop {
  readonly floor: Floor;
  readonly image: HTMLImageElement;
  readonly low: readonly [number, number];
  readonly high: readonly [number, number];
}

const KEY = 'anchord.level';
const stored = (): number | 'none' | null => {
  try {
    const text = localStorage.getItem(KEY);
    return text === 'none' ? 'none' : text === null || !Number.isFinite(Number(text)) ? null : Number(text);
  } catch {
    return null;
  }
};
const chosen = signal<number | 'none' | null>(stored());
/// Floors whose plan is placed.
export const placed_floors = signal<readonly Floor[]>([]);
/// Changes when something else is to be drawn.
export const backdrop_version = signal(0);

export const levels = (floors: readonly Floor[]): number[] =>
  [...new Set(floors.map((f) => f.level))].sort((a, b) => a - b);
/// The level on the map: what was chosen, else the one nearest to the ground; null: none.
export function level_shown(): number | null {
  const there = levels(placed_floors.value),
    wish = chosen.value;
  if (wish === 'none' || !there.length) return null;
  if (wish !== null && there.includes(wish)) return wish;
  return there.reduce((a, b) => (Math.abs(b) < Math.abs(a) ? b : a));
}
export function show_level(level: number | null): void {
  chosen.value = level ?? 'none';
  try {
    localStorage.setItem(KEY, String(level ?? 'none'));
  } catch {
    /* a private window keeps nothing */
  }
  backdrop_version.value++;
}

let asked = false;
/// `again`: something was changed here.
export function follow_floors(again = false): void {
  if (asked && !again) return;
  asked = true;
  list('/floors', { query: { limit: 1000 } }).then(
    (all) => {
      placed_floors.value = all.filter((f) => f.backdrop);
      backdrop_version.value++;
    },
    () => (asked = false),
  );
}

const pictures = new Map<string, HTMLImageElement>();
function picture(floor: Floor): HTMLImageElement | null {
  const sha = floor.backdrop!.sha256,
    known = pictures.get(sha);
  if (known) return known.complete && known.naturalWidth ? known : null;
  const image = new Image();
  pictures.set(sha, image);
  bytes('/floors/{id}/plan/backdrop', { path: { id: floor.id } })
    .then((r) => (r.ok ? r.blob() : Promise.reject(new Error(String(r.status)))))
    .then((blob) => {
      image.onload = () => backdrop_version.value++;
      image.src = URL.createObjectURL(blob);
    })
    .catch(() => pictures.delete(sha));
  return null;
}

/// Corners of a floor's backdrop in metres about another origin: both are tangent planes of one site.
export function corners_about(
  backdrop: NonNullable<Floor['backdrop']>,
  origin: Geodetic,
): Pick<Backdrop, 'low' | 'high'> {
  const at = (e: number, n: number): [number, number] => {
    const g = geodetic_from_enu(e, n, backdrop.origin),
      m = enu_from_geodetic({ ...g, h_m: origin.h_m }, origin);
    return [m[0], m[1]];
  };
  const [west, south, east, north] = backdrop.extent_m as [number, number, number, number];
  return { low: at(west, south), high: at(east, north) };
}

/// What lies under a map whose metres are about this origin.
export function backdrops(origin: Geodetic | null | undefined): readonly Backdrop[] {
  const level = level_shown();
  if (!origin || level === null) return [];
  return placed_floors.value
    .filter((f) => f.level === level)
    .flatMap((f) => {
      const image = picture(f);
      return image ? [{ floor: f, image, ...corners_about(f.backdrop!, origin) }] : [];
    });
}
