import type { EstimateMsg } from '../live/messages';
import { length_words, round_length } from '../map/enu';
import { status_tone } from './tones';
import { fixed, grouped } from '../ui/format';

/// The 95 % ellipse at its own true scale, with a bar to read it by.
export function Loupe({ e, size = 118 }: { e: EstimateMsg; size?: number }) {
  const el = e.ellipse95!;
  const ppm = (size * 0.36) / Math.max(el.major_m, 1e-4),
    bar = round_length((size * 0.4) / ppm),
    c = size / 2;
  const words = `95 % ellipse ${fixed(el.major_m, 3)} × ${fixed(el.minor_m, 3)} m at ${fixed(el.azimuth_deg, 0)}°`;
  const lines = Array.from({ length: 5 }, (_, i) => `M${(i * size) / 4} 0V${size}M0 ${(i * size) / 4}H${size}`).join(
    '',
  );
  return (
    <svg
      class="loupe"
      width={size}
      height={size}
      viewBox={`0 0 ${size} ${size}`}
      role="img"
      aria-label={words}
      data-testid="loupe"
    >
      <path class="gridl" d={lines} />
      <g class={status_tone(e.status)}>
        <ellipse
          class="ell"
          cx={c}
          cy={c}
          rx={el.major_m * ppm}
          ry={el.minor_m * ppm}
          transform={`rotate(${el.azimuth_deg - 90} ${c} ${c})`}
        />
        <path class="plus" d={`M${c - 5} ${c}h10M${c} ${c - 5}v10`} />
      </g>
      <path class="sbar" d={`M6 ${size - 6}h${bar * ppm}`} />
      <text class="ticktext" x="6" y={size - 11}>
        {length_words(bar)}
      </text>
    </svg>
  );
}

export function Covariance({ c }: { c: readonly number[] }) {
  const [ee, en, eu, nn, nu, uu] = c as [number, number, number, number, number, number];
  const wide = Math.max(...c.map(Math.abs)) >= 1; // a position that is metres wide is not written in nine digits
  const rows: [string, number[]][] = [
    ['E', [ee, en, eu]],
    ['N', [en, nn, nu]],
    ['U', [eu, nu, uu]],
  ];
  return (
    <table class="cov" data-testid="covariance">
      <caption>
        Covariance <span class="mut">{wide ? 'm²' : 'mm²'}, E N U</span>
      </caption>
      <thead>
        <tr>
          <th scope="col">
            <span class="sr">Axis</span>
          </th>
          <th scope="col">E</th>
          <th scope="col">N</th>
          <th scope="col">U</th>
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, values], i) => (
          <tr key={name}>
            <th scope="row">{name}</th>
            {values.map((v, j) => (
              <td key={j} class={i === j ? 'diag' : ''}>
                {wide ? fixed(v, 2) : grouped(v * 1e6)}
              </td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
