/// Aircraft or rover, its track and the base on the plan's map; a corner where the rover is, and an outline walked with it.
import { useEffect, useState } from 'preact/hooks';
import { devices } from '../../api/devices';
import type { Plan } from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { current_scene, now_ms, say, tick, watched_lost } from '../../state/store';
import { age, fixed } from '../../ui/format';
import { added, corners, from_m, to_m, with_corners, type Shape } from './draft';
import { corners_of_walk, no_corner, rover_of, walked } from './ground';
import type { Point } from './tools';

const BASE_EVERY_MS = 30_000; ///< it does not move; a caster may send its place late
const TRAIL_US = 120_000_000;
const FIX_WORDS = { none: 'NO FIX', single: 'SINGLE', dgps: 'DGPS', float: 'FLOAT', fixed: 'FIX' } as const;

/// Where corrections come from, as the caster says.
export function useBase(origin: Geodetic | null): Point | null {
  const [at, set_at] = useState<{ readonly lon: number; readonly lat: number } | null>(null);
  useEffect(() => {
    const look = (): void => {
      devices().then(
        (all) => {
          const base = all.find((d) => d.base)?.base;
          if (base)
            set_at((a) => (a && a.lon === base.lon && a.lat === base.lat ? a : { lon: base.lon, lat: base.lat }));
        },
        () => undefined,
      );
    };
    look();
    const timer = setInterval(look, BASE_EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  return at && origin && to_m(at, origin);
}

export function OnGround({
  origin,
  base,
  walk,
  px,
}: {
  origin: Geodetic;
  base: Point | null;
  walk: number | null; ///< since when, by the clock of the flight
  px: (m: Point) => [number, number];
}) {
  tick.value;
  const scene = current_scene(),
    lost = watched_lost(),
    rover = rover_of(scene, origin, now_ms(), lost),
    pose = scene?.pose?.value,
    path = (points: readonly Point[]): string =>
      points
        .map(
          (m, i) =>
            `${i ? 'L' : 'M'}${px(m)
              .map((v) => v.toFixed(1))
              .join(' ')}`,
        )
        .join('');
  const trail = scene && pose ? walked(scene, pose.t_us - TRAIL_US, origin) : [],
    way = scene && walk !== null ? walked(scene, walk, origin) : [];
  return (
    <g class="onground">
      {trail.length > 1 && <path class="track" d={path(trail)} />}
      {way.length > 1 && <path class="walk" d={path(way)} data-testid="walk" />}
      {base && <Base at={px(base)} lost={lost} />}
      {rover && (
        <g
          class={rover.fresh ? 'rover' : 'rover old'}
          transform={`translate(${px(rover.m).join(' ')})`}
          data-testid="plan-rover"
        >
          <path
            transform={rover.heading_deg === null ? '' : `rotate(${rover.heading_deg})`}
            d={rover.heading_deg === null ? 'M0 -12L12 0L0 12L-12 0z' : 'M0 -16L12 14L0 7L-12 14z'}
          />
          <text class="halo" x="16" y="4">
            {rover.flies ? 'aircraft' : 'rover'}{' '}
            <tspan class={rover.fresh ? '' : 'stale'}>{FIX_WORDS[rover.fix]}</tspan>
            {rover.fresh ? '' : ` ${age(rover.age_ms)} old`}
          </text>
        </g>
      )}
    </g>
  );
}
const Base = ({ at: [x, y], lost }: { at: [number, number]; lost: boolean }) => (
  <g class={lost ? 'base old' : 'base'} data-testid="plan-base" transform={`translate(${x} ${y})`}>
    <path d="M0 -10L9 7H-9zM0 -10V-16M-5 -14A6 6 0 0 1 5 -14" />
    <text class="halo" x="14" y="4">
      <tspan class={lost ? 'stale' : ''}>base</tspan>
      {lost ? ' last known' : ''}
    </text>
  </g>
);

/// Draws with the rover instead of a finger.
export function RoverTools({
  plan,
  origin,
  drawing,
  change,
  walk,
  set_walk,
}: {
  plan: Plan;
  origin: Geodetic;
  drawing: Shape;
  change: (p: Plan) => void;
  walk: number | null;
  set_walk: (since_us: number | null) => void;
}) {
  tick.value;
  const scene = current_scene(),
    rover = rover_of(scene, origin, now_ms(), watched_lost()),
    missing = no_corner(rover),
    ring = drawing !== 'waypoints';
  const way = walk === null ? [] : walked(scene, walk, origin);
  if (!rover && walk === null) return null;
  const here = (): void => {
    if (!rover || missing) return;
    change(added(plan, drawing, rover.at));
    say(
      `${ring ? 'Corner' : 'Waypoint'} ${corners(plan, drawing).length + 1} set at the rover, ${FIX_WORDS[rover.fix]}` +
        (rover.sigma_h_m === null ? '' : `, σ ${fixed(rover.sigma_h_m, 2)} m`),
    );
  };
  const stop = (): void => {
    const found = corners_of_walk(way);
    set_walk(null);
    if (found.length < 3) {
      say(`Nothing drawn: a walk needs three corners, this one has ${found.length}`);
      return;
    }
    change(
      with_corners(
        plan,
        drawing,
        found.map(([e, n]) => from_m(e, n, origin)),
      ),
    );
    say(`${found.length} corners from the walk; move, add or undo them`);
  };
  const length_m = way.reduce(
    (sum, m, i, all) => (i ? sum + Math.hypot(m[0] - all[i - 1]![0], m[1] - all[i - 1]![1]) : 0),
    0,
  );
  return (
    <div class="rovertools" role="group" aria-label="Draw with the rover">
      <button
        class="btn"
        data-testid="corner-here"
        disabled={missing !== ''}
        title={missing || 'At the position of the rover, as good as it is now'}
        onClick={here}
      >
        {ring ? 'Corner here' : 'Waypoint here'}
      </button>
      {ring && (
        <button
          class="btn"
          data-testid="walk-outline"
          aria-pressed={walk !== null}
          disabled={walk === null && missing !== ''}
          title={missing || 'Carry the rover once round the building, then stop: the corners are found'}
          onClick={() => (walk === null ? set_walk(scene?.pose?.value.t_us ?? 0) : stop())}
        >
          {walk !== null ? `Stop walking (${fixed(length_m, 0)} m)` : 'Walk it'}
        </button>
      )}
      {missing && <span class="mut">{missing}</span>}
    </div>
  );
}
