/// The plan to fly again from: the one that was flown, else one of this building; proposed anew, and cut to the anchors that lack something.
import type { AnchorRow } from '../api/anchors';
import { get } from '../api/contract';
import { generate, plans, read, type Plan } from '../api/plans';
import { enu_from_geodetic } from '../map/enu';
import { again } from './fly_again';

const OF_THIS_BUILDING_M = 300;

async function flown_plan(mission: string, lacking: readonly AnchorRow[]): Promise<Plan | null> {
  const flown = await get('/missions/{id}/procedure', { path: { id: mission } }).then(
    (p) => p.plan ?? null,
    () => null, // a flight without a procedure: flown by hand, or imported
  );
  if (flown) {
    const plan = await read(flown).catch(() => null);
    if (plan) return plan;
  }
  const near = (p: Plan): boolean =>
    p.outline.length > 2 &&
    lacking.some((r) => {
      if (r.lon === null || r.lat === null) return false;
      const [e, n] = enu_from_geodetic({ ...p.outline[0]!, h_m: 0 }, { lon: r.lon, lat: r.lat, h_m: 0 });
      return Math.hypot(e, n) < OF_THIS_BUILDING_M;
    });
  return (await plans()).find(near) ?? null;
}

export async function plan_again(mission: string, lacking: readonly AnchorRow[]): Promise<Plan> {
  const plan = await flown_plan(mission, lacking);
  if (!plan) throw new Error('There is no plan with an outline of this building: draw one in Plan first.');
  const proposed = plan.outline.length > 2 ? (await generate(plan)).plan.waypoints : plan.waypoints,
    made = again(plan, proposed, lacking);
  if (!made)
    throw new Error('None of these anchors has a position yet: fly the whole plan again, nearer to the anchors.');
  return made;
}
