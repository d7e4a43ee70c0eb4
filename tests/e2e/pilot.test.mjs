// The operator in the browser flies: plan drawn and generated, checklist, start, anchors found, hold, resume, land, report. Real server, the
// simulated aircraft at the other end of MAVLink, its tag and rover through REST; in real time, so only the beginning of a flight.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually } from './server.mjs';
import { serverWithAircraft } from './simulated_aircraft.mjs';

let server, aircraft, browser, mission;
const get = async (path) => (await server.fetch(path)).json();
const procedure = () => get(`/api/v1/missions/${mission}/procedure`);

before(async () => {
  ({ server, aircraft, mission } = await serverWithAircraft());
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

/** Held for a second, as a gloved finger does. */
async function hold(page, button) {
  await button.scrollIntoViewIfNeeded();
  const box = await button.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await new Promise((done) => setTimeout(done, 1200));
  await page.mouse.up();
}

/** Corner by corner with the mouse, as a person draws: metres east and north of the map's middle. */
async function draw(id, shape, corners) {
  await id(`draw-${shape}`).click();
  const { width, height } = await id('plan-map').boundingBox();
  for (const [e, n] of corners)
    await id('plan-map').click({ position: { x: width / 2 + e * PX_PER_M, y: height / 2 - n * PX_PER_M } });
}
const PX_PER_M = 8; // of an empty map

test('a person draws outline and fence on the map, presses generate, saves', async () => {
  const { page, seen, id } = await openPage(browser, server);
  await page.getByText('Simulated drone').first().waitFor();
  // The map lies where the aircraft stands, 9 m outside the corner, once its first good fix has come.
  await eventually(
    'the map of the plan lies at the aircraft',
    async () => {
      await page.getByRole('link', { name: /^Plan/ }).click();
      if (
        await id('plan-map')
          .waitFor({ timeout: 3000 })
          .then(
            () => true,
            () => false,
          )
      )
        return true;
      await page.getByRole('link', { name: /^Live/ }).click();
      return false;
    },
    30_000,
  );
  const [e0, n0] = [9, 9];
  await id('plan-name').fill('Hall, drawn');
  await draw(id, 'outline', [
    [e0, n0],
    [e0 + 30, n0],
    [e0 + 30, n0 + 20],
    [e0, n0 + 20],
  ]);
  await draw(id, 'fence', [
    [e0 - 14, n0 - 14],
    [e0 + 41, n0 - 14],
    [e0 + 41, n0 + 31],
    [e0 - 14, n0 + 31],
  ]);
  await id('generate').click();
  await id('waypoints').locator('tbody tr').nth(3).waitFor({ timeout: 30_000 });
  await picture(page, 'plan-drawn-light');
  await id('save').click();
  await id('plan').getByText('revision 1').waitFor();
  const plan = (await get('/api/v1/plans')).items[0];
  assert.equal(plan.name, 'Hall, drawn');
  const { outline, fence } = await get(`/api/v1/plans/${plan.id}`),
    west = Math.min(...outline.coordinates[0].map(([lon]) => lon)),
    east = Math.max(...outline.coordinates[0].map(([lon]) => lon));
  // 30 m at 51 degrees north, 70.1 km a degree.
  assert.ok(Math.abs((east - west) * 70_100 - 30) < 0.5, `${(east - west) * 70_100} m wide`);
  assert.equal(fence.coordinates[0].length, 5);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a plan drawn in a map program is imported, and a wrong one is refused', async () => {
  const { page, id } = await openPage(browser, server, { hash: '#/plan' });
  await id('plan').getByText('revision 1').waitFor();
  await page.getByRole('button', { name: 'New', exact: true }).click();
  const kml = (inside) => ({
    name: 'site.kml',
    mimeType: 'application/vnd.google-earth.kml+xml',
    buffer: Buffer.from(
      `<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>Hall</name>${inside}</Placemark></kml>`,
    ),
  });
  await page.getByLabel('Plan file').setInputFiles(kml('<Point><coordinates>3.7131,51.0231</coordinates></Point>'));
  await id('plan').getByText('That did not work').waitFor();
  await page
    .getByLabel('Plan file')
    .setInputFiles(
      kml(
        '<Polygon><outerBoundaryIs><LinearRing><coordinates>3.7131,51.0231 3.7135275,51.0231 3.7135275,51.0232799 ' +
          '3.7131,51.0231</coordinates></LinearRing></outerBoundaryIs></Polygon>',
      ),
    );
  await eventually('the outline is there', async () => id('generate').isEnabled());
  await page.close();
});

test('start is blocked until the checklist is green; then the aircraft flies, holds at one press, goes on, and lands', async () => {
  const { page, seen, id } = await openPage(browser, server);
  await id('open-checklist').click({ timeout: 20_000 });
  await id('check-props').waitFor();
  // Alarms sound only after a tap: the checklist offers it, and does not wait for it.
  await id('check-sound').getByRole('button').click();
  await id('check-sound').waitFor({ state: 'detached' });
  assert.equal(await id('cmd-start').isEnabled(), false);
  await eventually(
    'RTK has been fixed for 10 s',
    async () => /ok|green/.test(await text(id('check-rtk').locator('.sr'))),
    60_000,
    500,
  );
  await eventually(
    'the aircraft keeps the fence that was drawn',
    async () => /green/.test(await text(id('check-fence').locator('.sr'))),
    20_000,
    250,
  );
  const { items } = await get(`/api/v1/missions/${mission}/checklist?plan=${(await get('/api/v1/plans')).items[0].id}`);
  for (const item of items.filter((i) => i.manual))
    await id(`check-${item.id}`).getByRole('button', { name: 'Confirm' }).click();
  for (const item of items.filter((i) => i.state === 'failed')) {
    await id(`check-${item.id}`).getByRole('button', { name: 'Override' }).click();
    await id(`check-${item.id}`).getByRole('textbox').fill('a test on the ground');
    await id(`check-${item.id}`).getByRole('button', { name: 'Override' }).click();
  }
  assert.deepEqual(await violations(page), []);
  await picture(page, 'checklist-light');
  await eventually('start is free', async () => id('cmd-start').isEnabled());
  // A Start that is refused says why where it was pressed.
  const why = 'take-off point is 2.1 m inside the building outline (clearance 4 m)';
  await page.route(
    '**/actions',
    (route) =>
      route.fulfill({
        status: 409,
        contentType: 'application/problem+json',
        body: JSON.stringify({ type: 'about:blank', title: 'Refused', status: 409, detail: why }),
      }),
    { times: 1 },
  );
  await hold(page, id('cmd-start'));
  await id('start-refused').waitFor();
  assert.ok((await text(id('start-refused'))).includes(why));
  assert.ok(await id('checklist').isVisible());
  assert.deepEqual(await violations(page), [], 'a refused start');
  seen.errors.length = 0; // the refusal itself
  await hold(page, id('cmd-start'));
  await id('procedure').getByText('RUNNING', { exact: true }).waitFor({ timeout: 20_000 });
  await eventually('anchors are heard', async () => (await procedure()).anchors.length > 3, 60_000, 250);
  // The anchor that the page shows, as the person reads it: its region of 95 % shrinks while it is flown round.
  const seen_m = async () => {
    const found = /95 % horizontal\s*±\s*([\d.]+)\s*(mm|cm|m)\b/.exec(
      await id('anchor-card')
        .first()
        .innerText({ timeout: 5000 })
        .catch(() => ''),
    );
    return found && Number(found[1]) * { mm: 0.001, cm: 0.01, m: 1 }[found[2]];
  };
  const first_m = await eventually('the page tells how well an anchor is known', seen_m, 60_000, 100);
  await eventually('it is at work at a point', async () => (await procedure()).iteration > 0, 60_000, 250);
  await picture(page, 'flight-light');
  assert.deepEqual(await violations(page), []);
  await eventually(
    'the anchor converges: half as wide as at first',
    async () => {
      const now_m = await seen_m();
      return now_m !== null && now_m < first_m / 2;
    },
    120_000,
    250,
  );
  for (const [width, height] of [
    [1024, 768],
    [768, 1024],
    [390, 844],
    [640, 512], // text of 200 % on 1280 x 1024
  ]) {
    await page.setViewportSize({ width, height });
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const where = `${width} x ${height}`,
      box = (name) => id(name).boundingBox(),
      [map, hold] = [await box('map'), await box('cmd-hold')];
    await picture(page, `flight-${width}`);
    if (height > width) assert.ok(map.height >= 0.4 * height, `map of ${map.height} px at ${where}`);
    for (const name of ['cmd-hold', 'cmd-skip', 'cmd-return', 'cmd-land']) {
      const b = await box(name);
      assert.ok(
        b.y >= 0 && b.y + b.height <= height && b.x >= 0 && b.x + b.width <= width && b.height >= 44 && b.width >= 44,
        `${name} in reach at ${where}: ${JSON.stringify(b)}`,
      );
      assert.ok(Math.abs(b.y - hold.y) < 1, `the commands are one row at ${where}`);
    }
    assert.deepEqual(await violations(page), [], where);
  }
  await page.setViewportSize({ width: 1440, height: 900 });
  const done_shown = (name) =>
    id(name)
      .innerText()
      .then((t) => /Anchors done\s*(\d+ of \d+)/.exec(t)?.[1]);
  await eventually(
    'one number of done anchors, in the flight bar and beside the map',
    async () => {
      const [bar, side] = await Promise.all([done_shown('flight-progress'), done_shown('progress')]);
      return bar !== undefined && bar === side;
    },
    10_000,
    100,
  );
  await page.keyboard.press('h');
  await id('procedure').getByText('HOLD', { exact: true }).waitFor({ timeout: 10_000 });
  await eventually('the autopilot holds', async () => (await procedure()).drone.mode === 'BRAKE', 10_000);
  await hold(page, id('cmd-resume'));
  await id('procedure').getByText('RUNNING', { exact: true }).waitFor({ timeout: 10_000 });
  // A short tap asks, a second one confirms: nothing needs a steady finger.
  await id('cmd-land').click();
  await id('cmd-land').getByText('tap again').waitFor();
  await id('cmd-land').click();
  await id('procedure').getByText('ABORTED', { exact: true }).waitFor({ timeout: 60_000 });
  assert.match(await text(id('flight-aborted')), /ended before its plan was flown.*Commanded to land: by /);
  // What the flight took stands still once it is over, and what is done is counted alike everywhere: no more than the procedure reached.
  const landed_ms = Date.now(),
    flown = await text(id('flown'));
  await eventually('three seconds pass', () => Date.now() > landed_ms + 3000, 5000, 200);
  assert.equal(await text(id('flown')), flown, 'flown counts on after landing');
  const reached = (await procedure()).anchors.filter((a) => a.reached).length,
    [bar, side] = await Promise.all([done_shown('flight-progress'), done_shown('progress')]);
  assert.equal(bar, side);
  assert.ok(Number(bar.split(' ')[0]) <= reached, `${bar} done, ${reached} reached`);
  await page.getByRole('link', { name: /^Anchors/ }).click();
  await id('anchor-table').waitFor();
  assert.equal(await id('anchor-table').locator('.chip.ok').count(), Number(bar.split(' ')[0]), 'green in the table');
  assert.match(await text(id('review')), new RegExp(`, ${bar}$`));
  await picture(page, 'given-up');
  // The flight is solved by itself after landing, and waits for review.
  await page.getByRole('link', { name: /^Live/ }).click();
  await id('after-landing').getByText('The flight is calibrated.').waitFor({ timeout: 60_000 });
  const solved = (await get('/api/v1/calibrations')).items;
  assert.equal(solved.length, 1);
  await picture(page, 'after-landing-light');
  await id('review-landed').click();
  await id('draft').locator('tbody tr').nth(3).waitFor({ timeout: 10_000 });
  assert.equal(
    (await get('/api/v1/calibrations')).items.length,
    1,
    'the review shows what is there, and solves nothing anew',
  );
  assert.deepEqual((await get('/api/v1/revisions')).items, []);
  await picture(page, 'landed-light');
  const [report] = await Promise.all([browser.context.waitForEvent('page'), id('report').click()]);
  await report.waitForLoadState();
  assert.match(await report.locator('h1').first().textContent(), /alibration/);
  const [{ id: made }] = (await get('/api/v1/calibrations')).items,
    { anchors, provenance } = await get(`/api/v1/calibrations/${made}`);
  for (const { network_id } of anchors) assert.ok(await report.getByText(network_id).count(), network_id);
  assert.ok(provenance.n_priors > 0, 'what the turn and the height search told went into it');
  // One limit for "accurate enough": the target of the plan that was flown, in the calibration, the report and the review.
  for (const { network_id, goal, quality } of anchors) {
    assert.equal(goal.source, 'plan_target', network_id);
    const row = await text(id('draft').locator('tbody tr', { hasText: network_id }));
    assert.equal(row.includes(`over the ${goal.words}`), quality.acceptable && !goal.reached, row);
  }
  assert.ok(await report.getByText(anchors[0].goal.words, { exact: true }).count(), 'the report names the goal');
  await picture(report, 'report-light');
  // It fits the page to print on, and a phone.
  const widest = () =>
    report.evaluate(() => {
      const { right } = document.querySelector('.sheet').getBoundingClientRect();
      return Math.max(
        document.documentElement.scrollWidth - innerWidth,
        ...[...document.querySelectorAll('.sheet > *')].map((x) => x.getBoundingClientRect().right - right),
      );
    });
  await report.setViewportSize({ width: 390, height: 844 });
  assert.ok((await widest()) <= 1, `phone: ${await widest()} px too wide`);
  await picture(report, 'report-phone');
  await report.setViewportSize({ width: 680, height: 1000 }); // A4 without its margins, at 96 dots an inch
  await report.emulateMedia({ media: 'print' });
  assert.ok((await widest()) <= 1, `A4: ${await widest()} px too wide`);
  await picture(report, 'report-print');
  await report.emulateMedia({ media: 'screen' });
  await report.close();
  // How long it took is shown beside what was forecast at Start; one that was ended by hand is not held against it.
  const { flight_time } = await get(`/api/v1/missions/${mission}`);
  assert.ok(flight_time.forecast_s.low < flight_time.forecast_s.high);
  assert.match(
    await text(id('publish').getByTestId('flown-time')),
    /^Flown in \d\d:\d\d; forecast at Start \d\d:\d\d to \d\d:\d\d. Not compared: the flight ended before its plan was flown.$/,
  );
  // So short a flight leaves anchors that lack something: a plan about those, to look at and to save.
  const lacking = Number(/(\d+)$/.exec(await text(id('fly-again')))[1]);
  assert.ok(lacking > 0);
  await id('fly-again').click();
  await eventually(
    'the plan is open',
    async () => (await id('plan-name').inputValue()).startsWith('Again: 0x'),
    20_000,
  );
  assert.equal((await id('plan-name').inputValue()).split(',').length, lacking);
  await id('check').getByText('BE FLOWN').waitFor({ timeout: 20_000 });
  assert.ok((await id('plan-map').locator('.wp').count()) >= 4);
  await picture(page, 'fly-again-light');
  await page.getByRole('button', { name: 'Discard them' }).click();
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('who only watches sees who has control, and can start nothing', async () => {
  const taken = await server.fetch(`/api/v1/missions/${mission}/control`, { json: { action: 'take', force: true } });
  assert.equal(taken.status, 200);
  const { page, id } = await openPage(browser, server);
  await id('control').getByText('has control, since').waitFor();
  assert.equal(await id('open-checklist').isEnabled(), false);
  await page.close();
});

test('control is asked for, refused, given; a page that lost it says so at once and its buttons are dead', async () => {
  const control = async (json) =>
    (await server.fetch(`/api/v1/missions/${mission}/control`, { json })).json().then((body) => body.lease);
  let other = await control({ action: 'take', force: true });
  const { page, id } = await openPage(browser, server);
  await id('ask-control').click();
  await id('control').getByText('Asked, waiting').waitFor();
  await control({ action: 'refuse', lease: other });
  await id('toast').getByText('keeps control').waitFor({ timeout: 10_000 });
  await id('ask-control').click();
  await id('control').getByText('Asked, waiting').waitFor();
  await control({ action: 'release', lease: other });
  await id('control').getByText('You have control').waitFor({ timeout: 10_000 });
  assert.equal(await id('open-checklist').isEnabled(), true);

  // Somebody asks this page; it keeps control, then it is taken by force.
  await control({ action: 'ask' });
  await id('control-asked').waitFor({ timeout: 5000 });
  await picture(page, 'control-asked');
  await id('control-refuse').click();
  await id('control-asked').waitFor({ state: 'detached', timeout: 5000 });
  await control({ action: 'take', force: true });
  await id('control-lost').waitFor({ timeout: 2500 });
  assert.equal(await id('open-checklist').isEnabled(), false);
  await picture(page, 'control-lost');
  assert.deepEqual(await violations(page), []);

  // By force only with a second tap.
  await id('take-anyway').click();
  await id('take-anyway').getByText('tap again').waitFor();
  assert.equal(await id('control').getByText('You have control').count(), 0);
  await id('take-anyway').click();
  await id('control').getByText('You have control').waitFor({ timeout: 5000 });
  assert.equal(await id('control-lost').count(), 0);
  await page.close();
});
