/// What a LOS/NLOS run says: the confusion on places never trained on, and what another threshold would cost.
import { useState } from 'preact/hooks';
import type { Confusion, Roc } from '../../api/learning';
import { fixed, grouped } from '../../ui/format';
import { Chip, Mark, Q } from '../../ui/marks';
import { Axes, Drawing, line, scale, ticks, room } from '../chart';

const share = (part: number, whole: number): string => fixed(whole ? (part / whole) * 100 : null, 1);

export function ConfusionPanel({
  confusion,
  held_out,
  max_fpr,
}: {
  confusion: Confusion;
  held_out: boolean;
  max_fpr: number | null;
}) {
  const c = confusion,
    los = c.tp + c.fn,
    nlos = c.fp + c.tn,
    fpr = nlos ? c.fp / nlos : null;
  const cell = (n: number, of: number, cls: string, words: string) => (
    <td class={cls} style={{ '--p': `${of ? (n / of) * 100 : 0}%` }}>
      <b>{grouped(n)}</b>
      <span>
        {share(n, of)} %{words}
      </span>
      {cls === 'fp' && <Mark shape="bad" tone="bad" />}
    </td>
  );
  return (
    <section class="cell-p" data-testid="confusion">
      <h2>Confusion</h2>
      <p class="sub">
        {grouped(los + nlos)} measurements, {held_out ? 'places never trained on' : 'cross-validated by place'}
      </p>
      <table class="cm">
        <caption class="sr">Counts of true and predicted class; NLOS called LOS is the error to avoid</caption>
        <thead>
          <tr>
            <td />
            <th scope="col">predicted LOS</th>
            <th scope="col">predicted NLOS</th>
          </tr>
        </thead>
        <tbody>
          <tr>
            <th scope="row">
              <b>truly LOS</b>
              <span>{grouped(los)}</span>
            </th>
            {cell(c.tp, los, '', '')}
            {cell(c.fn, los, '', '')}
          </tr>
          <tr>
            <th scope="row">
              <b>truly NLOS</b>
              <span>{grouped(nlos)}</span>
            </th>
            {cell(c.fp, nlos, 'fp', ' false LOS')}
            {cell(c.tn, nlos, '', '')}
          </tr>
        </tbody>
      </table>
      <div class="fprb">
        <span class="big" data-testid="fpr">
          {fixed(fpr === null ? null : fpr * 100, 1)}
          <span class="u">%</span>
        </span>
        <p>
          <b>False positive rate</b>{' '}
          {max_fpr !== null && fpr !== null && (
            <Chip
              shape={fpr <= max_fpr ? 'ok' : 'bad'}
              tone={fpr <= max_fpr ? 'ok' : 'bad'}
              word={`LIMIT ≤ ${fixed(max_fpr * 100, 0)} %`}
            />
          )}
          <br />
          NLOS classified as LOS: the worst error, because its range is used with full weight.
        </p>
      </div>
    </section>
  );
}

/// ROC and slider: accuracy follows from the counts of each class at that point of the curve.
export function ThresholdPanel({ roc, los, nlos }: { roc: Roc; los: number; nlos: number }) {
  const points = roc.points,
    [threshold, set_threshold] = useState(roc.limit?.threshold ?? 0.5);
  if (points.length < 2) return null;
  // LOS is said from the threshold upwards, so the point that holds is the lowest one not below it.
  const at = points.reduce((a, b) =>
    b.threshold >= threshold && (a.threshold < threshold || b.threshold < a.threshold) ? b : a,
  );
  const accuracy = los + nlos ? (at.tpr * los + (1 - at.fpr) * nlos) / (los + nlos) : null;
  const x_max = Math.min(1, Math.max(0.1, Math.ceil(at.fpr * 12) / 10)),
    limit = roc.limit,
    max_fpr = limit?.max_fpr ?? null;
  return (
    <section class="cell-p" data-testid="threshold">
      <h2>Threshold</h2>
      <p class="sub">
        cross-validated by place, ROC up to {fixed(x_max * 100, 0)} % false positives, AUC {fixed(roc.auc, 3)}
      </p>
      <Drawing
        cls="roc"
        label={
          `ROC curve, area ${fixed(roc.auc, 3)}; at threshold ${fixed(threshold, 2)} ${fixed(at.tpr * 100, 1)} % of ` +
          `LOS kept and ${fixed(at.fpr * 100, 1)} % of NLOS classified as LOS`
        }
        draw={(w, h) => {
          const f = { w, h, left: room(44), right: 10, top: 8, bottom: room(22) },
            x = scale([0, x_max], [f.left, w - f.right]),
            y = scale([0, 1], [h - f.bottom, f.top]);
          return (
            <>
              <Axes
                f={f}
                x={x}
                y={y}
                xs={ticks(0, x_max)}
                ys={[0, 0.5, 1]}
                xw={(v) => `${fixed(v * 100, 0)} %`}
                yw={(v) => `${fixed(v * 100, 0)} %`}
              />
              {max_fpr !== null && max_fpr <= x_max && (
                <path class="goal" d={`M${x(max_fpr)} ${f.top}V${h - f.bottom}`} />
              )}
              <path
                class="s main"
                d={line(
                  [...points]
                    .sort((a, b) => a.fpr - b.fpr || a.tpr - b.tpr)
                    .filter((p) => p.fpr <= x_max)
                    .map((p) => [x(p.fpr), y(p.tpr)]),
                )}
              />
              <path class="s alt" d={`M${f.left} ${y(at.tpr)}H${x(at.fpr)}V${h - f.bottom}`} />
              <circle class="dot" cx={x(at.fpr)} cy={y(at.tpr)} r="6" />
            </>
          );
        }}
      />
      <input
        type="range"
        class="slide"
        min="0"
        max="1"
        step="0.01"
        value={threshold}
        aria-label="Threshold of P(LOS)"
        data-testid="threshold-slider"
        onInput={(e) => set_threshold(Number(e.currentTarget.value))}
      />
      <dl class="rd">
        <div>
          <dt>Threshold</dt>
          <dd>{fixed(threshold, 2)}</dd>
        </div>
        <div>
          <dt>FPR</dt>
          <dd data-testid="slider-fpr">
            <Q v={fixed(at.fpr * 100, 1)} u="%" />
          </dd>
        </div>
        <div>
          <dt>Accuracy</dt>
          <dd data-testid="slider-accuracy">
            <Q v={fixed(accuracy === null ? null : accuracy * 100, 1)} u="%" />
          </dd>
        </div>
        <div>
          <dt>LOS kept</dt>
          <dd>
            <Q v={fixed(at.tpr * 100, 1)} u="%" />
          </dd>
        </div>
      </dl>
      {limit && (
        <p class="sub">
          At the chosen {fixed(limit.threshold, 2)} the FPR lies within {fixed(limit.fpr_low95 * 100, 1)} to{' '}
          {fixed(limit.fpr_high95 * 100, 1)} % (95 %, {limit.places} places with NLOS).
        </p>
      )}
    </section>
  );
}
