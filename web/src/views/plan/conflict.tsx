/// Somebody else saved meanwhile: both versions side by side, drawn to one scale and in words; the person decides.
import type { Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { useDialog } from '../../ui/use_dialog';
import { Drawing, line } from '../chart';
import { corners, to_m, type Shape } from './draft';
import { differences } from './differences';

export function Conflict({
  mine,
  theirs,
  origin,
  keep_mine,
  take_theirs,
  later,
}: {
  mine: Plan;
  theirs: Plan;
  origin: Geodetic | null;
  keep_mine: () => void;
  take_theirs: () => void;
  later: () => void; ///< the next saving asks again
}) {
  const box = useDialog<HTMLDivElement>(later, 'conflict');
  const lines = differences(mine, theirs);
  return (
    <div
      class="callout caution conflict"
      {...box}
      aria-label="The plan was changed by somebody else"
      data-testid="conflict"
    >
      <div class="first">
        <span>
          <b>Somebody else has saved this plan (revision {theirs.revision}).</b> Nothing is lost yet.
        </span>
        <span class="actions">
          <button class="btn" onClick={later}>
            Decide later
          </button>
          <button class="btn" onClick={take_theirs}>
            Take theirs
          </button>
          <button class="btn" onClick={keep_mine}>
            Keep mine, then save
          </button>
        </span>
      </div>
      {origin && (
        <div class="pair">
          {(
            [
              ['Mine', mine],
              ['Theirs', theirs],
            ] as const
          ).map(([name, p]) => (
            <figure key={name}>
              <figcaption>{name}</figcaption>
              <Small plan={p} other={p === mine ? theirs : mine} origin={origin} name={name} />
            </figure>
          ))}
        </div>
      )}
      <div class="scrollx" tabIndex={0} role="region" aria-label="What differs">
        <table class="tbl" data-testid="differences">
          <caption class="sr">What differs between the two versions</caption>
          <thead>
            <tr>
              <th scope="col">Differs in</th>
              <th scope="col">Mine</th>
              <th scope="col">Theirs</th>
            </tr>
          </thead>
          <tbody>
            {lines.length ? (
              lines.map((d) => (
                <tr key={d.name}>
                  <th scope="row">{d.name}</th>
                  <td>{d.mine}</td>
                  <td>{d.theirs}</td>
                </tr>
              ))
            ) : (
              <tr>
                <th scope="row">Nothing</th>
                <td colSpan={2}>both are the same except for their revision</td>
              </tr>
            )}
          </tbody>
        </table>
      </div>
    </div>
  );
}

export function Small({ plan, other, origin, name }: { plan: Plan; other: Plan; origin: Geodetic; name: string }) {
  const shapes = (p: Plan): Shape[] => [
      'outline',
      'fence',
      'waypoints',
      ...p.no_fly.map((_, i) => `no_fly/${i}` as Shape),
    ],
    metres = (p: Plan, s: Shape) => corners(p, s).map((c) => to_m(c, origin));
  const all = [plan, other].flatMap((p) => shapes(p).flatMap((s) => metres(p, s))),
    es = all.map(([e]) => e),
    ns = all.map(([, n]) => n);
  if (!all.length) return <p class="why">Nothing is drawn.</p>;
  const theirs = new Set(other.waypoints.map((w) => `${w.lon} ${w.lat} ${w.height_above_ground_m}`));
  return (
    <Drawing
      cls="minimap"
      label={`${name}: outline of ${plan.outline.length} corners, ${plan.waypoints.length} waypoints`}
      draw={(w, h) => {
        const [e0, e1, n0, n1] = [Math.min(...es), Math.max(...es), Math.min(...ns), Math.max(...ns)],
          k = Math.min(w / (e1 - e0 + 4), h / (n1 - n0 + 4)),
          px = ([e, n]: readonly [number, number]): [number, number] => [
            w / 2 + (e - (e0 + e1) / 2) * k,
            h / 2 - (n - (n0 + n1) / 2) * k,
          ];
        const path = (s: Shape): string =>
          `${line(metres(plan, s).map(px))}${s !== 'waypoints' && corners(plan, s).length > 2 ? 'Z' : ''}`;
        return (
          <>
            {plan.fence.length > 0 && <path class="fence" d={path('fence')} />}
            {plan.no_fly.map((_, i) => (
              <path key={i} class="nofly" d={path(`no_fly/${i}`)} />
            ))}
            <path class="outline" d={path('outline')} />
            <path class="way" d={path('waypoints')} />
            {metres(plan, 'waypoints').map((m, i) => {
              const [x, y] = px(m),
                wp = plan.waypoints[i]!,
                differs = !theirs.has(`${wp.lon} ${wp.lat} ${wp.height_above_ground_m}`);
              return <circle key={i} class={differs ? 'only' : 'same'} cx={x} cy={y} r={differs ? 5 : 3} />;
            })}
          </>
        );
      }}
    />
  );
}
