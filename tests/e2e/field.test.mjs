// In the field with the rover at hand: what is on the ground is on the plan's map, corners are set where the rover is, and heights are seen
// from the side beside every map. Real server, a simulated flight that is played into it while the page is open.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { hall_outline, metresBetween } from './flight.mjs';
import { binary, eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord field '));
let browser, server, flight;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer({ auth: 'off' });
  flight = join(folder, 'flight');
  assert.equal((await run(['simulate', 'flight', '--seed', '7', '--duration', '240', '--out', flight])).code, 0);
  const replayed = await run(['replay', flight, '--url', server.url, '--speed', 'max']);
  assert.equal(replayed.code, 0, replayed.stderr);
  const made = await server.fetch('/api/v1/plans', {
    json: { name: 'Hall', outline: hall_outline, waypoints: [] },
    headers: { 'idempotency-key': 'hall' },
  });
  assert.equal(made.status, 201, await made.text());
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** Of the canvas of the side elevation: how many pixels are neither ground nor alike. */
const painted = (page) =>
  page.evaluate(() => {
    const c = document.querySelector('.elevbox canvas');
    if (!c?.width) return 0;
    const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height);
    let n = 0;
    for (let i = 0; i < data.length; i += 4)
      if (Math.abs(data[i] - data[0]) + Math.abs(data[i + 1] - data[1]) + Math.abs(data[i + 2] - data[2]) > 60) n++;
    return n;
  });

test('heights are seen from the side beside the map of Live, Anchors, Plan and Replay, in one component', async () => {
  const { page, seen, id } = await openPage(browser, server);
  const [mission] = (await get('/api/v1/missions')).items;
  for (const [hash, name] of [
    ['#/live', 'live'],
    ['#/anchors', 'anchors'],
    ['#/plan', 'plan'],
    [`#/replay/${mission.id}?t=200`, 'replay'],
  ]) {
    await page.goto(`${server.url}/?theme=light${hash}`);
    const open = id('show-elevation');
    await open.waitFor();
    // Read and pressed at one go: once the size of a map is known, a tall one opens it by itself.
    await open.evaluate((button) => button.getAttribute('aria-pressed') === 'false' && button.click());
    await id('elevation').locator('canvas').waitFor();
    await eventually(`${name}: something is drawn`, async () => (await painted(page)) > 500);
    assert.deepEqual(await violations(page), [], name);
    await picture(page, `elevation-${name}-light`);
  }
  // What it says to who cannot see it is what the API says.
  await page.goto(`${server.url}/?theme=light#/live`);
  const words = async () => (await id('elevation').locator('canvas').getAttribute('aria-label')) ?? '',
    number = (s) => Number(s.replace('−', '-'));
  await eventually('its heights are those of the API', async () => {
    const { features } = await get(`/api/v1/anchors?view=live&mission=${mission.id}`),
      ups = features.map((a) => a.properties.enu_m[2]),
      [, n, low, high] = /(\d+) anchors between ([−\d.]+) and ([−\d.]+) m/.exec(await words()) ?? [];
    return (
      Number(n) === ups.length &&
      Math.abs(number(low) - Math.min(...ups)) < 0.06 &&
      Math.abs(number(high) - Math.max(...ups)) < 0.06
    );
  });
  // Turned by hand; the choice is remembered, and closing it gives the map its room back.
  const before = await text(id('elevation-bearing'));
  await page.getByRole('button', { name: 'Turn right by 15 degrees' }).click();
  assert.notEqual(await text(id('elevation-bearing')), before);
  const tall = async () => (await page.locator('.mapcanvas').boundingBox()).height;
  const small = await tall();
  await page.getByRole('button', { name: 'Close the side elevation' }).click();
  await eventually('the map is taller', async () => (await tall()) > small + 100);
  await page.reload();
  await id('show-elevation').waitFor();
  assert.equal(await id('show-elevation').getAttribute('aria-pressed'), 'false');
  assert.equal(await id('elevation').count(), 0);
  await id('show-elevation').click();
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('the rover is on the map of the plan: a corner is set where it is, and an outline is walked', async () => {
  const playing = spawn(binary, ['replay', flight, '--url', server.url, '--speed', '6'], { stdio: 'ignore' });
  try {
    const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
    await id('plan-rover').waitFor({ timeout: 20_000 });
    await id('plan-rover').getByText('rover FIX').waitFor({ timeout: 20_000 });
    await page.getByRole('button', { name: 'New', exact: true }).click();
    await id('draw-waypoints').click();
    await id('corner-here').click();
    await eventually('a waypoint is drawn', async () => (await id('plan-map').locator('.wp').count()) === 1);
    // Once round the building: the flight is a rounded rectangle, of which corners are left.
    await id('draw-outline').click();
    await id('walk-outline').click();
    await eventually(
      'a hundred metres are walked',
      async () => Number(/(\d+) m/.exec(await text(id('walk-outline')))?.[1]) >= 100,
      60_000,
    );
    assert.equal(await id('walk').count(), 1);
    await picture(page, 'plan-walk-light');
    await id('walk-outline').click();
    await id('toast')
      .getByText(/corners from the walk/)
      .waitFor();
    const corners = Number(/(\d+) corners/.exec(await text(id('toast')))[1]);
    assert.ok(corners >= 4 && corners <= 40, `${corners}`);
    assert.deepEqual(await violations(page), []);
    await id('plan-name').fill('Walked');
    await id('save').click();
    await id('plan').getByText('revision 1').waitFor();
    // All of them are where the API says that the aircraft flew.
    const plan = (await get('/api/v1/plans')).items.find((p) => p.name === 'Walked'),
      [mission] = (await get('/api/v1/missions')).items,
      track = (await get(`/api/v1/missions/${mission.id}/track?limit=10000`)).geometry.coordinates.map(
        ([lon, lat]) => ({
          lon,
          lat,
        }),
      );
    const set = [...plan.waypoints, ...plan.outline.coordinates[0].map(([lon, lat]) => ({ lon, lat }))];
    assert.equal(set.length, 1 + corners + 1);
    for (const c of set) {
      const off = Math.min(...track.map((t) => metresBetween(t, c)));
      assert.ok(off < 0.3, `${off} m from the track`);
    }
    assert.deepEqual(seen.errors, []);
    // With the link lost the plan stays as it is drawn; what is of now on it is struck and aged, on the map and from the side.
    process.kill(server.pid, 'SIGSTOP');
    try {
      await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 12_000);
      await eventually(
        'the rover is struck and aged',
        async () => /rover FIX \d+ s old/.test(await text(id('plan-rover'))),
        5000,
      );
      const struck = (at) => at.evaluate((e) => getComputedStyle(e).textDecorationLine.includes('line-through'));
      assert.equal(await struck(id('plan-rover').locator('tspan')), true);
      assert.match(await id('elevation').getByRole('img').getAttribute('aria-label'), /values are the last known/);
      for (const tile of ['rtk', 'uwb', 'drone', 'rec', 'alarms']) {
        assert.match(await text(id(`status-${tile}`)), /\d+ s old/, tile);
        assert.equal(await struck(id(`status-${tile}`).locator('b')), true, tile);
      }
      await picture(page, 'lost-plan');
    } finally {
      process.kill(server.pid, 'SIGCONT');
    }
    await eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
    // The link to the rover is not forever: it ages, and no corner can be set any more.
    playing.kill('SIGINT');
    await id('plan-rover')
      .getByText(/\d+ s old/)
      .waitFor({ timeout: 20_000 });
    await eventually('no outline can be walked', async () => !(await id('walk-outline').isEnabled()), 20_000);
    await page.close();
  } finally {
    playing.kill('SIGINT');
  }
});

test('a finished flight is handed over as one zip file, one that is being recorded is not yet', async () => {
  const made = await server.fetch('/api/v1/missions', {
    json: { name: 'in the air', frame: 'wgs84', track_point: 'tag_antenna' },
    headers: { 'idempotency-key': 'in the air' },
  });
  assert.equal(made.status, 201, await made.text());
  const { page, seen } = await openPage(browser, server, { hash: '#/system' });
  const row = (name) => page.getByRole('row').filter({ has: page.getByRole('rowheader', { name }) });
  await row('in the air').waitFor();
  assert.equal(await row('in the air').getByTestId('handover-flight').count(), 0);
  const finished = (await get('/api/v1/missions')).items.find((m) => m.state === 'finished');
  const coming = page.waitForEvent('download');
  await row(finished.name).getByTestId('handover-flight').click();
  const pack = await coming;
  assert.match(pack.suggestedFilename(), /^handover-.+\.zip$/);
  assert.equal(
    readFileSync(await pack.path())
      .subarray(0, 4)
      .toString('latin1'),
    'PK\x03\x04',
  );
  assert.deepEqual(seen.errors, []);
  await page.close();
});
