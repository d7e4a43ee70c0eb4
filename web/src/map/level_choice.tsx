/// Which floor's plan lies under the map; nothing where no plan is placed.
import { follow_floors, level_shown, levels, placed_floors, show_level } from '../state/floors';
import { useEffect } from 'preact/hooks';

export function LevelChoice() {
  useEffect(() => follow_floors(), []);
  const floors = placed_floors.value,
    shown = level_shown();
  if (!floors.length) return null;
  return (
    <select
      class="levelchoice"
      aria-label="Floor plan"
      data-testid="level"
      value={shown === null ? '' : String(shown)}
      onChange={(e) => show_level(e.currentTarget.value === '' ? null : Number(e.currentTarget.value))}
    >
      <option value="">No plan</option>
      {levels(floors).map((level) => (
        <option key={level} value={String(level)}>
          {[...new Set(floors.filter((f) => f.level === level).map((f) => f.name))].join(', ')}
        </option>
      ))}
    </select>
  );
}
