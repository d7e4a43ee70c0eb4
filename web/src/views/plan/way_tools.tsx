/// Tools that set many waypoints at once.
import { useState } from 'preact/hooks';
import type { Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { say } from '../../state/store';
import type { Picked } from './draft';
import { denser, with_even_spacing } from './tools';

export function WayTools({ plan, origin, picked, change }: { plan: Plan; origin: Geodetic | null; picked: Picked | null; change: (p: Plan) => void }) {
  const [text, set_text] = useState('5'), spacing_m = Number(text.replace(',', '.')), good = Number.isFinite(spacing_m) && spacing_m >= 0.5 && spacing_m <= 100, here = picked?.shape === 'waypoints' ? picked.index : null;
  const space = (): void => {
    const made = with_even_spacing(plan, origin!, spacing_m);
    change(made.plan);
    say(`${made.plan.waypoints.length} waypoints along the outline${made.left_out ? `; ${made.left_out} left out in no-fly areas or outside of the fence` : ''}`);
  };
  return (
    <div class="waytools">
      <form onSubmit={(e) => { e.preventDefault(); if (good) space(); }}><button class="btn" data-testid="space-evenly" disabled={!good || !origin || plan.outline.length < 3}>Space evenly along outline</button><label>at <input class="cell" inputMode="decimal" aria-label="Spacing along the outline, metres" data-testid="spacing" value={text} onInput={(e) => set_text(e.currentTarget.value)} /> m</label></form>
      <button class="btn" data-testid="denser" disabled={here === null || !origin || plan.waypoints.length < 2} title={here === null ? 'Pick a waypoint first' : ''} onClick={() => { const made = denser(plan, here!, origin!); change(made); say(`${made.waypoints.length - plan.waypoints.length} waypoints added about waypoint ${here! + 1}`); }}>{here === null ? 'Denser here (pick a waypoint)' : `Denser about ${here + 1}`}</button>
    </div>
  );
}
