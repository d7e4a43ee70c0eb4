import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { axis_m } from '../ui/format';

interface Look {
  ink: string;
  ground: string;
  text: string;
  line: string;
  ok: string;
  font: string;
  width: number;
  rem: number;
}

const decades = (min: number, max: number): number[] => {
  const out: number[] = [];
  for (let e = Math.ceil(Math.log10(min) - 1e-9); e <= Math.log10(max) + 1e-9; e++) out.push(10 ** e);
  return out;
};

export function make_convergence(box: HTMLElement, look: Look, limit_m: number | null): uPlot {
  const font = `${look.rem * 0.75}px ${look.font}`;
  return new uPlot(
    {
      width: box.clientWidth,
      height: box.clientHeight,
      legend: { show: false },
      cursor: { show: false },
      padding: [6, 20, 0, 0],
      // Room for the limit even when all values are far above it: the distance to it is the point of the chart.
      scales: {
        x: { time: false },
        y: {
          distr: 3,
          log: 10,
          range: (_u, min, max) => [
            10 ** Math.floor(Math.log10(Math.min(min || 1, (limit_m ?? Infinity) * 0.6))),
            10 ** Math.ceil(Math.log10(Math.max(max || 1, 1))),
          ],
        },
      },
      axes: [
        {
          stroke: look.text,
          font,
          size: look.rem * 1.7,
          gap: 8,
          grid: { show: false },
          ticks: { show: false },
          values: (_u, v) => v.map((x) => `${x} s`),
        },
        {
          stroke: look.text,
          font,
          size: look.rem * 3,
          gap: 4,
          splits: (_u, _i, min, max) => decades(min, max),
          grid: { stroke: look.line, width: 1 },
          ticks: { show: false },
          values: (_u, v) => v.map(axis_m),
        },
      ],
      series: [{}, { stroke: look.ink, width: look.width, points: { show: false }, spanGaps: false }],
      hooks: {
        draw: [
          (u) => {
            if (limit_m === null) return;
            const y = u.valToPos(limit_m, 'y', true),
              c = u.ctx,
              px = devicePixelRatio || 1;
            c.save();
            c.strokeStyle = c.fillStyle = look.ok;
            c.lineWidth = 1.5 * px;
            c.setLineDash([6 * px, 3 * px]);
            c.beginPath();
            c.moveTo(u.bbox.left, y);
            c.lineTo(u.bbox.left + u.bbox.width, y);
            c.stroke();
            c.font = `500 ${look.rem * 0.75 * px}px ${look.font}`;
            c.textAlign = 'right';
            c.textBaseline = 'bottom';
            c.setLineDash([]);
            c.strokeStyle = look.ground;
            c.lineWidth = 4 * px;
            c.lineJoin = 'round';
            c.strokeText(`limit ≤ ${axis_m(limit_m)}`, u.bbox.left + u.bbox.width, y - 2 * px);
            c.fillText(`limit ≤ ${axis_m(limit_m)}`, u.bbox.left + u.bbox.width, y - 2 * px);
            c.restore();
          },
        ],
      },
    },
    [[], []],
    box,
  );
}
