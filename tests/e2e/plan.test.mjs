// Planning in the browser: drawn, generated, checked, saved by revision, kept over a reload. Real binary, numbers on screen against the API's.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text, violations } from './browser.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord plan '));
let browser, server;
const post = async (path, json) => {
  const answer = await server.fetch(path, { json });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer({ auth: 'off' });
  // Its origin is where the page begins to draw.
  const flight = join(folder, 'flight');
  assert.equal((await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', flight])).code, 0);
  const replayed = await run(['replay', flight, '--url', server.url, '--speed', 'max']);
  assert.equal(replayed.code, 0, replayed.stderr);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a person draws an outline, generates a flight, moves a point by keys, saves, and a second editor is told', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
  const map = id('plan-map');
  await map.waitFor();
  const box = await map.boundingBox();
  for (const [x, y] of [
    [0.35, 0.35],
    [0.65, 0.35],
    [0.65, 0.6],
    [0.35, 0.6],
  ])
    await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
  await id('plan-name').fill('Hall A');
  await id('generate').click();
  await id('waypoints').locator('tbody tr').nth(3).waitFor({ timeout: 20_000 });
  await id('check').getByText('BE FLOWN').waitFor();
  await id('save').click();
  await id('plan').getByText('revision 1').waitFor();
  await id('check').getByText('BE FLOWN').waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'plan-light');
  const {
    items: [stored],
  } = await get('/api/v1/plans');
  assert.equal(stored.name, 'Hall A');
  assert.ok(stored.waypoints.length >= 4);
  assert.equal(stored.outline.coordinates[0].length, 5);
  // A waypoint goes half a metre north by an arrow key.
  await id('waypoints').getByRole('button', { name: '1', exact: true }).click();
  await map.focus();
  await page.keyboard.press('ArrowUp');
  await id('save').click();
  await id('plan').getByText('revision 2').waitFor();
  const moved = await get(`/api/v1/plans/${stored.id}`);
  assert.ok(Math.abs((moved.waypoints[0].lat - stored.waypoints[0].lat) * 111_000 - 0.5) < 0.02);
  // Somebody else saves; this page must not overwrite it in silence.
  const other = await server.fetch(`/api/v1/plans/${stored.id}`, {
    method: 'PATCH',
    headers: { 'if-match': '"p-2"' },
    json: { name: 'Hall B' },
  });
  assert.equal(other.status, 200);
  await id('plan-name').fill('Hall C');
  await id('save').click();
  await id('conflict').waitFor();
  await id('conflict').getByRole('button', { name: 'Take theirs' }).click();
  await eventually('theirs is shown', async () => (await id('plan-name').inputValue()) === 'Hall B');
  assert.deepEqual(
    seen.errors.filter((e) => !e.includes('412')),
    [],
  );
  await page.close();
});

test('waypoints are spaced evenly and made denser, judged while they are drawn, and two versions stand side by side', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
  await eventually('the plan is open', async () => (await id('plan-name').inputValue()) === 'Hall B');
  const before = (await get('/api/v1/plans')).items[0],
    stored = () => get(`/api/v1/plans/${before.id}`),
    points = id('waypoints').locator('tbody tr');
  await id('spacing').fill('6');
  await id('space-evenly').click();
  await eventually('other waypoints are there', async () => (await points.count()) !== before.waypoints.length);
  const n = await points.count();
  await id('waypoints').getByRole('button', { name: '2', exact: true }).click();
  await id('denser').click();
  await eventually('two more', async () => (await points.count()) === n + 2);
  // Judged without being saved: time, and the map of what is expected.
  await id('predicted').locator('tbody tr').first().waitFor();
  await id('check').getByText('BE FLOWN').waitFor();
  const seconds = (clock) => clock.split(':').reduce((s, x) => 60 * s + Number(x), 0);
  const way = seconds((await text(id('profile').locator('.meta'))).split(' ')[0]);
  assert.equal((await stored()).revision, before.revision);
  const cells = await id('plan-map').locator('.cand, .unseen').count();
  await id('predicted-of').selectOption('none');
  assert.ok(cells > 0);
  assert.equal(await id('plan-map').locator('.cand, .unseen').count(), 0);
  await id('predicted-of').selectOption('gdop');
  await id('expect-address').fill('6A77');
  await id('expect').click();
  const own = id('expected').getByLabel('Target sigma of 0x6a77, metres');
  assert.equal(await own.getAttribute('placeholder'), '0.050', 'that of the plan, until it has one');
  await own.fill('0.02');
  await own.press('Tab');
  await id('save').click();
  await id('plan')
    .getByText(`revision ${before.revision + 1}`)
    .waitFor();
  const kept = await stored(),
    check = await post(`/api/v1/plans/${before.id}/validate`, {});
  assert.deepEqual(kept.anchor_targets, [{ network_id: '0x6a77', target_sigma_m: 0.02 }]);
  assert.deepEqual([kept.expected_anchors, kept.waypoints.length], [['0x6a77'], n + 2]);
  await eventually(
    "the page's forecast is the server's",
    async () => Math.abs(check.duration_s - seconds(await text(id('flight-time')))) < 1.5,
  );
  assert.ok(check.duration_low_s < check.duration_s && check.duration_s < check.duration_high_s);
  const { speed_mps, dwell_s } = kept.settings;
  const alone = check.length_m / speed_mps + check.n_measure * dwell_s;
  assert.ok(Math.abs(alone - way) < 1.5, `${alone} ${way}`);
  assert.deepEqual(
    check.issues.filter((i) => i.severity === 'error'),
    [],
  );
  // Evenly: neighbours away from the denser place are the spacing apart, within a tenth.
  const metres = (a, b) =>
    Math.hypot((a.lon - b.lon) * 111_320 * Math.cos((a.lat * Math.PI) / 180), (a.lat - b.lat) * 111_230);
  const gaps = kept.waypoints
    .filter((w) => w.measure)
    .slice(4)
    .map((w, i, all) => (i ? metres(w, all[i - 1]) : null))
    .filter((g) => g !== null);
  assert.ok(
    gaps.every((g) => g < 6.6) && gaps.filter((g) => g > 5.4).length >= gaps.length * 0.7,
    gaps.map((g) => g.toFixed(2)).join(' '),
  );
  assert.deepEqual(await violations(page), []);
  await picture(page, 'plan-even-light');
  // Somebody else moves a waypoint: both are drawn, and the line says which and how.
  const waypoints = kept.waypoints.map((w, i) =>
    i === 3 ? { ...w, height_above_ground_m: w.height_above_ground_m + 2 } : w,
  );
  assert.equal(
    (
      await server.fetch(`/api/v1/plans/${before.id}`, {
        method: 'PATCH',
        headers: { 'if-match': `"p-${kept.revision}"` },
        json: { waypoints },
      })
    ).status,
    200,
  );
  await id('plan-name').fill('Hall D');
  await opensByKeys(page, id('save'), id('conflict')); // decided later: the next saving asks again
  await id('save').click();
  const lines = id('differences').locator('tbody tr');
  await lines.first().waitFor();
  assert.deepEqual(
    (await lines.allTextContents()).map((l) => l.replace(/\u2212/g, '-')),
    [
      'NameHall DHall B',
      `Waypoint 4${(waypoints[3].height_above_ground_m - 2).toFixed(1)} m high${waypoints[3].height_above_ground_m.toFixed(1)} m high`,
    ],
  );
  await eventually('both are drawn', async () => (await id('conflict').locator('svg .only').count()) === 2);
  assert.deepEqual(await violations(page), []);
  await picture(page, 'plan-conflict-light');
  await id('conflict').getByRole('button', { name: 'Keep mine, then save' }).click();
  await id('save').click();
  await eventually('mine is stored over theirs', async () => (await stored()).name === 'Hall D');
  await id('plan-name').fill('Hall B');
  await id('save').click();
  await eventually('and its old name again', async () => (await stored()).name === 'Hall B');
  assert.deepEqual(
    seen.errors.filter((e) => !e.includes('412')),
    [],
  );
  await page.close();
});

test('a plan that was not saved is back after a reload, and can be thrown away', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
  await eventually('the plan is open', async () => (await id('plan-name').inputValue()) === 'Hall B');
  await id('plan-name').fill('Hall Z');
  await page.reload();
  await id('brought-back').waitFor();
  assert.equal(await id('plan-name').inputValue(), 'Hall Z');
  assert.deepEqual(await violations(page), []);
  await id('brought-back').getByRole('button', { name: 'Discard them' }).click();
  await eventually('what is saved is shown', async () => (await id('plan-name').inputValue()) === 'Hall B');
  await page.reload();
  await eventually('and stays', async () => (await id('plan-name').inputValue()) === 'Hall B');
  assert.equal(await id('brought-back').count(), 0);
  assert.deepEqual(seen.errors, []);
  await page.close();
});
