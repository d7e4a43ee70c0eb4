import { current_map } from '../map/map_box';
import { chosen_anchor, current_scene } from '../state/store';
import { hold_now } from '../views/flight/commands';
import { by_urgency } from './alarm_rules';
import { acknowledge, alarms, mute } from './alarms';
import { help_open, keys_on } from './help_state';
import { next_theme } from './theme';

function step_anchor(by: number): void {
  const ids = [...(current_scene()?.anchors.keys() ?? [])].sort();
  if (!ids.length) return;
  const at = ids.indexOf(chosen_anchor.value ?? '');
  chosen_anchor.value = ids[(at + by + ids.length) % ids.length]!;
}
const KEYS: Record<string, () => void> = {
  1: () => (location.hash = '#/live'),
  2: () => (location.hash = '#/plan'),
  3: () => (location.hash = '#/anchors'),
  4: () => (location.hash = '#/measurements'),
  5: () => (location.hash = '#/models'),
  6: () => (location.hash = '#/replay'),
  7: () => (location.hash = '#/system'),
  t: next_theme,
  h: hold_now,
  m: mute,
  f: () => current_map.view?.mode('fit'),
  c: () => current_map.view?.mode('follow'),
  '+': () => current_map.view?.zoom(1),
  '-': () => current_map.view?.zoom(-1),
  '[': () => step_anchor(-1),
  ']': () => step_anchor(1),
  '?': () => (help_open.value = !help_open.value),
  a: () => {
    const first = [...alarms.value].sort(by_urgency).find((x) => !x.acknowledged);
    if (first) acknowledge(first.id);
  },
  '/': () => {
    if (!location.hash.startsWith('#/anchors')) location.hash = '#/anchors';
    const field = document.getElementById('filter');
    if (field) field.focus();
    else setTimeout(() => document.getElementById('filter')?.focus(), 50);
  },
};
/// Single letters never fire in fields, with modifiers, or when switched off; Escape always closes what is open.
export function on_key(e: KeyboardEvent): void {
  if (e.key === 'Escape') {
    if (document.activeElement instanceof HTMLInputElement) document.activeElement.blur();
    return; // every dialog closes itself
  }
  const field = e.target instanceof HTMLElement && e.target.closest('input, select, textarea, [contenteditable]');
  if (field || e.ctrlKey || e.metaKey || e.altKey || !keys_on.value) return;
  const act = KEYS[e.key.toLowerCase()];
  if (!act) return;
  e.preventDefault();
  act();
}
