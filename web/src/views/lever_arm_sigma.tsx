/// How well the lever arm was measured: what the accuracies hold of it, and another word of whoever measured it. A flight that
/// would not show a wrong arm waits for that word where its mission says nothing.
import { useState } from 'preact/hooks';
import { fixed } from '../ui/format';
import { typed_number } from '../ui/typed_number';

const TAPE_MEASURE_M = 0.02;

interface Props {
  readonly withheld: number; ///< anchors of the calibration
  readonly held_m: number | null; ///< one sigma that the calibration holds; null: nobody says
  readonly busy: boolean;
  readonly solve: (sigma_m: number) => void;
}

export function LeverArmSigma({ withheld, held_m, busy, solve }: Props) {
  const [typed, set_typed] = useState(String(held_m ?? TAPE_MEASURE_M));
  const sigma_m = typed_number(typed) ?? NaN,
    good = Number.isFinite(sigma_m) && sigma_m > 0; // how much is too much the server says
  return (
    <form
      class={held_m === null ? 'callout' : 'why'}
      data-testid="lever-arm-sigma"
      onSubmit={(e) => {
        e.preventDefault();
        if (good && !busy) solve(sigma_m);
      }}
    >
      {held_m === null ? (
        <p>
          A wrong lever arm would not show in this flight, which withholds {withheld} anchor{withheld === 1 ? '' : 's'}.
          If the arm was measured with care, say how well; the accuracies then hold it. Unchecked with the flight
          (lever_arm_sigma_m), nobody is asked.
        </p>
      ) : (
        <p>The accuracies include a lever arm measured to {fixed(held_m, 3)} m, one sigma.</p>
      )}
      <div class="one-line">
        <label for="arm-sigma">Lever arm, one sigma, m</label>
        <input
          id="arm-sigma"
          inputMode="decimal"
          value={typed}
          aria-invalid={!good}
          onInput={(e) => set_typed(e.currentTarget.value)}
        />
        <button class="btn small" disabled={busy || !good}>
          Solve again
        </button>
      </div>
    </form>
  );
}
