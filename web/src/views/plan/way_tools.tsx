/// Tools that set many waypoints at once.
import { useState } from 'preact/hooks';
import type { Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { say } from '../../state/store';
import { typed_number } from '../../ui/typed_number';
import type { Picked } from './draft';
import { denser, typed_heights, usual_heights, with_even_spacing } from './tools';

export function WayTools({
  plan,
  origin,
  picked,
  change,
}: {
  plan: Plan;
  origin: Geodetic | null;
  picked: Picked | null;
  change: (p: Plan) => void;
}) {
  const [text, set_text] = useState('5'),
    [heights_text, set_heights] = useState(''),
    usual = usual_heights(plan),
    heights = heights_text.trim() ? typed_heights(heights_text) : usual,
    spacing_m = typed_number(text) ?? NaN,
    good = Number.isFinite(spacing_m) && spacing_m >= 0.5 && spacing_m <= 100,
    here = picked?.shape === 'waypoints' ? picked.index : null;
  const space = (): void => {
    const made = with_even_spacing(plan, origin!, spacing_m, heights!);
    change(made.plan);
    say(
      `${made.plan.waypoints.filter((w) => w.measure).length} measuring points along the ` +
        `outline${made.left_out ? `; ${made.left_out} left out in no-fly areas or outside of the fence` : ''}`,
    );
  };
  return (
    <div class="waytools">
      <form
        onSubmit={(e) => {
          e.preventDefault();
          if (good && heights) space();
        }}
      >
        <button
          class="btn"
          data-testid="space-evenly"
          disabled={!good || !heights || !origin || plan.outline.length < 3}
        >
          Space evenly along outline
        </button>
        <label>
          at{' '}
          <input
            class="cell"
            inputMode="decimal"
            aria-label="Spacing along the outline, metres"
            data-testid="spacing"
            value={text}
            onInput={(e) => set_text(e.currentTarget.value)}
          />{' '}
          m,
        </label>
        <label>
          heights{' '}
          <input
            class="cell list"
            aria-label="Heights in turn, metres"
            data-testid="spacing-heights"
            placeholder={usual.map((h) => String(Number(h.toFixed(1)))).join(', ')}
            value={heights_text}
            onInput={(e) => set_heights(e.currentTarget.value)}
          />{' '}
          m
        </label>
      </form>
      <button
        class="btn"
        data-testid="denser"
        disabled={here === null || !origin || plan.waypoints.length < 2}
        title={here === null ? 'Pick a waypoint first' : ''}
        onClick={() => {
          const made = denser(plan, here!, origin!);
          change(made);
          say(`${made.waypoints.length - plan.waypoints.length} waypoints added about waypoint ${here! + 1}`);
        }}
      >
        {here === null ? 'Denser here (pick a waypoint)' : `Denser about ${here + 1}`}
      </button>
    </div>
  );
}
