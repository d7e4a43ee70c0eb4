/// How well one anchor is known over the flight, log scale, with the server's limit drawn in. uPlot comes with this chunk.
import { useEffect, useRef, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import { goal_of } from '../state/done';
import { current_mission, current_scene, replayed, tick, watched_scene } from '../state/store';
import type { HistoryPoint } from '../state/scene';
import { fixed } from '../ui/format';
import { css, ground } from '../ui/theme';
import { useStable } from '../ui/use_stable';

const asked = new Set<string>(); ///< flights whose beginning was asked for
/// The whole flight, whenever the page was opened: what it did not see itself comes from the server, once.
function ask_for_the_beginning(): void {
  const scene = current_scene(),
    m = current_mission.peek();
  if (replayed.peek() || !scene || !m || asked.has(scene.id)) return;
  const first_us = Math.min(...[...scene.history.values()].map((h) => h[0]?.t_us ?? Infinity));
  if (m.started_us === null || first_us - m.started_us < SEEN_ALL_US) return;
  asked.add(scene.id);
  const read = async () => (await import('../state/recording')).estimates_over_time(scene.id);
  read().then(
    (list) => {
      scene.add_earlier_estimates(list);
      tick.value++;
    },
    () => undefined, // the chart begins where the page was opened
  );
}
const SEEN_ALL_US = 15_000_000;

const NOTHING: HistoryPoint = { t_us: 0, sigma_h_m: null, sigma_m: null, h95_m: null, gdop: null };

export function Convergence({ anchor }: { anchor: string }) {
  const box = useRef<HTMLDivElement>(null),
    plot = useRef<uPlot | null>(null),
    [failed, set_failed] = useState('');
  tick.value;
  const scene = watched_scene(),
    history = scene?.history.get(anchor) ?? [],
    goal = goal_of(scene?.anchors.get(anchor)?.value ?? null),
    of = goal?.of ?? 'h95',
    limit_m = goal?.limit_m ?? null;
  const theme = ground.value;
  const measure = (x: HistoryPoint): number | null => (of === 'sigma' ? x.sigma_m : x.h95_m);
  const last = measure([...history].reverse().find((h) => measure(h) !== null) ?? NOTHING),
    name = of === 'sigma' ? 'σ position, 1σ' : '95 % horizontal';

  const draw = useStable((): void => {
    const h = watched_scene()?.history.get(anchor) ?? [],
      t0 = h[0]?.t_us ?? 0;
    plot.current?.setData([h.map((x) => (x.t_us - t0) / 1e6), h.map(measure)]);
  });
  useEffect(() => {
    let gone = false;
    void import('./plot').then(
      ({ make_convergence }) => {
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
          limit_m,
        );
        draw();
      },
      (e: unknown) => set_failed(e instanceof Error ? e.message : String(e)),
    );
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
  }, [anchor, theme, limit_m, of, draw]);
  const now = tick.value;
  useEffect(draw, [now, draw]);
  useEffect(ask_for_the_beginning, [scene, history.length > 0]);
  const seen = last === null ? 'not known' : `${fixed(last, 3)} m`,
    words = `${name} over ${history.length} estimates, now ${seen}${limit_m === null ? '' : `, limit at most ${limit_m} m`}`;
  return (
    <figure class="conv" data-testid="convergence">
      <figcaption>
        {name}{' '}
        <b>{last === null ? 'not known yet' : last < 1 ? `${fixed(last * 100, 1)} cm` : `${fixed(last, 1)} m`}</b>
        {limit_m !== null && <span class="mut q"> limit ≤ {fixed(limit_m * 100, 1)} cm</span>}
      </figcaption>
      {failed ? (
        <p class="why">The chart could not be drawn: {failed}</p>
      ) : (
        <div ref={box} class="plot" role="img" aria-label={words} />
      )}
    </figure>
  );
}
