// A plan changed while it is flown, by the page: the real server, the simulated aircraft at the other end of MAVLink. What is saved waits; the
// difference is shown, refused where it is not safe, flown once confirmed, undone.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text, violations } from './browser.mjs';
import { eventually } from './server.mjs';
import { serverWithAircraft, startFlight } from './simulated_aircraft.mjs';

let server, aircraft, browser, mission, plan;
const get = async (path) => (await server.fetch(path)).json();
const procedure = () => get(`/api/v1/missions/${mission}/procedure`);
/** Somebody else saves the plan: its next revision. */
async function save(edit) {
  const answer = await server.fetch(`/api/v1/plans/${plan}`),
    body = await answer.json();
  edit(body);
  const saved = await server.fetch(`/api/v1/plans/${plan}`, {
    method: 'PUT',
    headers: { 'content-type': 'application/json', 'if-match': answer.headers.get('etag') },
    body: JSON.stringify(body),
  });
  assert.equal(saved.status, 200, await saved.clone().text());
}
/** A square about a place, as a GeoJSON polygon. */
function square({ lon, lat }, half_m) {
  const [e, n] = [half_m / (111_195 * Math.cos((lat * Math.PI) / 180)), half_m / 111_195];
  const ring = [
    [-e, -n],
    [e, -n],
    [e, n],
    [-e, n],
    [-e, -n],
  ];
  return { type: 'Polygon', coordinates: [ring.map(([x, y]) => [lon + x, lat + y])] };
}
async function hold(page, button) {
  await button.scrollIntoViewIfNeeded();
  const box = await button.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await new Promise((done) => setTimeout(done, 1200)); // as a gloved finger does
  await page.mouse.up();
}

before(async () => {
  ({ server, aircraft, mission } = await serverWithAircraft());
  plan = await startFlight(server, mission);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

test('a saved revision waits, is shown as a difference, flown once confirmed, and undone', async () => {
  const { page, id } = await openPage(browser, server);
  await id('take-control').click();
  await id('control').getByText('You have control').waitFor();
  const { n_waypoints: n, waypoint } = await procedure();
  await save((p) => p.waypoints.pop());
  await id('plan-review').waitFor();
  await opensByKeys(page, id('plan-review'), id('plan-change')); // its button is gone meanwhile
  await id('plan-review').click();
  await eventually('the difference', async () =>
    (await text(id('plan-lines'))).includes(`Waypoint ${n} of the flown plan removed`),
  );
  assert.match(await text(id('plan-forecast')), /\d\d:\d\d to \d\d:\d\d/);
  assert.match(await text(id('plan-next')), new RegExp(`of ${n - 1} on`));
  assert.equal((await procedure()).plan_revision, 1, 'looking changes nothing');
  assert.deepEqual(await violations(page, { sizes: true }), []);
  await picture(page, 'plan-change');
  await hold(page, id('plan-take'));
  await eventually('revision 2 is flown', async () => (await procedure()).plan_revision === 2);
  const now = await procedure();
  assert.equal(now.n_waypoints, n - 1);
  assert.ok(now.waypoint >= waypoint, 'it goes on where it was');
  await id('plan-change').waitFor({ state: 'detached' });

  await id('plan-undo').click();
  await eventually('the way back', async () => (await text(id('plan-lines'))).includes(`Waypoint ${n} added`));
  await hold(page, id('plan-take'));
  await eventually('revision 1 is flown again', async () => (await procedure()).plan_revision === 1);
  assert.equal((await procedure()).n_waypoints, n);
  const { items } = await get(`/api/v1/missions/${mission}/events?limit=200`);
  assert.equal(items.filter((e) => e.code === 'procedure.plan_changed').length, 2);
  await page.close();
});

test('a no-fly area over the aircraft is refused with its reason, and the plan before flies on', async () => {
  const { page, id } = await openPage(browser, server, { width: 390, height: 844 });
  const { drone, plan_revision } = await procedure();
  await save((p) => p.no_fly.push(square(drone, 15)));
  await id('plan-review').click();
  await eventually('the reason', async () =>
    /would be at a position that is not allowed|way home would be blocked/.test(await text(id('plan-refused'))),
  );
  assert.ok(await id('plan-take').isDisabled());
  assert.ok(await id('cmd-hold').isVisible(), 'Hold stays in reach');
  assert.deepEqual(await violations(page), []);
  await picture(page, 'plan-change-refused');
  assert.equal((await procedure()).plan_revision, plan_revision);
  await page.close();
});
