/// Whether the side elevation is beside the maps: one choice for all views, remembered. Null: not chosen, each map by its room.
import { effect, signal } from '@preact/signals';

const KEY = 'anchord.elevation';
const ROOM_PX = 520; ///< of a map that gives a third of its height away
const kept = (): boolean | null => {
  try {
    const v = localStorage.getItem(KEY);
    return v === null ? null : v === 'on';
  } catch {
    return null;
  }
};
export const elevation_shown = signal<boolean | null>(kept());
effect(() => {
  if (elevation_shown.value === null) return;
  try {
    localStorage.setItem(KEY, elevation_shown.value ? 'on' : 'off');
  } catch {
    /* private window: not remembered */
  }
});
export const elevation_on = (height_px: number): boolean => elevation_shown.value ?? height_px >= ROOM_PX;
