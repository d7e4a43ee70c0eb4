/// For a flight that would not show a wrong lever arm: whoever measured the arm says how well, and the regions then hold that.
import { useState } from 'preact/hooks';

const TAPE_MEASURE_M = 0.02;

interface Props {
  readonly withheld: number; ///< anchors of the calibration
  readonly busy: boolean;
  readonly solve: (sigma_m: number) => void;
}

export function LeverArmSigma({ withheld, busy, solve }: Props) {
  const [typed, set_typed] = useState(String(TAPE_MEASURE_M));
  const sigma_m = Number(typed.replace(',', '.')),
    good = Number.isFinite(sigma_m) && sigma_m > 0; // how much is too much the server says
  return (
    <form
      class="callout"
      data-testid="lever-arm-sigma"
      onSubmit={(e) => {
        e.preventDefault();
        if (good && !busy) solve(sigma_m);
      }}
    >
      <p>
        A wrong lever arm would not show in this flight, which withholds {withheld} anchor{withheld === 1 ? '' : 's'}.
        If the arm was measured with care, say how well; the accuracies then hold it.
      </p>
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
