/// Horizontal sigma of one anchor over the flight, log scale, with the limit drawn in. uPlot comes with this chunk.
import { useEffect, useRef } from 'preact/hooks';
import type uPlot from 'uplot';
import { watched_scene, tick } from '../state/store';
import { fixed } from '../ui/format';
import { css, ground } from '../ui/theme';
import { useStable } from '../ui/use_stable';

/// The goal the design draws: 5 cm, 1 sigma, horizontal. Whether an anchor converged is the server's word.
export const DONE_SIGMA_M = 0.05;

export function Convergence({ anchor }: { anchor: string }) {
  const box = useRef<HTMLDivElement>(null),
    plot = useRef<uPlot | null>(null);
  tick.value;
  const history = watched_scene()?.history.get(anchor) ?? [];
  const theme = ground.value;
  const last = [...history].reverse().find((h) => h.sigma_h_m !== null)?.sigma_h_m ?? null;

  const draw = useStable((): void => {
    const h = watched_scene()?.history.get(anchor) ?? [],
      t0 = h[0]?.t_us ?? 0;
    plot.current?.setData([h.map((x) => (x.t_us - t0) / 1e6), h.map((x) => x.sigma_h_m)]);
  });
  useEffect(() => {
    let gone = false;
    void import('./plot').then(({ make_convergence }) => {
      if (gone || !box.current) return;
      plot.current = make_convergence(
        box.current,
        {
          ink: css('--ink'),
          ground: css('--panel'),
          text: css('--ink-3'),
          line: css('--line'),
          ok: css('--ok'),
          font: css('--font'),
          width: Number(css('--lw-data')) || 2,
          rem: parseFloat(getComputedStyle(document.documentElement).fontSize),
        },
        DONE_SIGMA_M,
      );
      draw();
    });
    const resize = new ResizeObserver(() => {
      if (box.current && plot.current)
        plot.current.setSize({ width: box.current.clientWidth, height: box.current.clientHeight });
    });
    if (box.current) resize.observe(box.current);
    return () => {
      gone = true;
      resize.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [anchor, theme, draw]);
  const now = tick.value;
  useEffect(draw, [now, draw]);
  return (
    <figure class="conv" data-testid="convergence">
      <figcaption>
        σ horizontal, 1σ{' '}
        <b>{last === null ? 'not known yet' : last < 1 ? `${fixed(last * 100, 1)} cm` : `${fixed(last, 1)} m`}</b>
      </figcaption>
      <div
        ref={box}
        class="plot"
        role="img"
        aria-label={`Horizontal sigma over ${history.length} estimates, now ${last === null ? 'not known' : `${fixed(last, 3)} m`}; goal ${DONE_SIGMA_M} m`}
      />
    </figure>
  );
}
