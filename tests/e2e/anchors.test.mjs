// Anchors at the desk: what each range says against the answer, two calibrations beside each other, chosen columns, and who is left out of a revision.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord anchors '));
let browser, server, solved;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer();
  for (const seed of ['7', '9']) {
    const flight = join(folder, seed);
    assert.equal((await run(['simulate', 'flight', '--seed', seed, '--duration', '120', '--out', flight])).code, 0);
    assert.equal((await run(['replay', flight, '--url', server.url, '--speed', 'max'])).code, 0);
  }
  const missions = (await get('/api/v1/missions')).items;
  solved = [];
  for (const m of missions) {
    const answer = await server.fetch('/api/v1/calibrations', {
      json: { missions: [m.id] },
      headers: { prefer: 'wait=100' },
    });
    assert.equal(answer.status, 201, await answer.clone().text());
    solved.push(await answer.json());
  }
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('residuals of the chosen anchor are those of its calibration, with direction', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/anchors/0x6a22' });
  await id('sectors').waitFor({ timeout: 20_000 });
  // The newest calibration that has the flight on screen.
  const mission = (await get('/api/v1/missions')).items[0].id,
    solve = solved.find((c) => c.missions.includes(mission));
  const { items } = await get(`/api/v1/calibrations/${solve.id}/residuals?anchor=0x6a22`),
    used = items.filter((r) => r.weight > 0).length;
  assert.ok(used > 30, `${used} used`);
  assert.ok((await text(id('residuals'))).includes(`${used} ranges with weight, ${items.length - used} rejected`));
  assert.equal(await id('residuals').locator('.resid').first().locator('circle').count(), used);
  const shares = (await id('sectors').locator('td.num').allTextContents()).map((t) => parseInt(t, 10));
  assert.ok(Math.abs(shares.reduce((a, b) => a + b, 0) - 100) <= 4, shares.join());
  assert.deepEqual(await violations(page), []);
  await picture(page, 'residuals-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('two calibrations are compared: shift of each anchor as the API has it, and whether it moved', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/anchors' });
  await id('compare').click();
  await id('compare-of').selectOption(solved[0].id);
  await id('compare-against').selectOption(solved[1].id);
  await id('shifts').locator('tbody tr').first().waitFor();
  const { items, n_moved } = await get(`/api/v1/calibrations/${solved[0].id}/diff?against=${solved[1].id}`);
  const shown = (await id('shifts').locator('tbody tr').allTextContents()).length,
    first = await id('shifts').locator('tbody tr').first().locator('td').allTextContents();
  assert.equal(shown, items.length);
  const words = (m) => (m * 1000).toFixed(0).replace(/^-0$/, '0').replace('-', '−');
  assert.deepEqual(first.slice(2, 5), items[0].delta_enu_m.map(words));
  assert.match(await text(id('compare-verdict')), n_moved ? new RegExp(`${n_moved} OF`) : /NONE MOVED/);
  await id('compare-against').selectOption(solved[0].id);
  await page.getByText('These are the same calibration').waitFor();
  assert.deepEqual(await violations(page), []);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('columns are chosen and stay, degrees may have minutes, and one anchor is left out of a revision with the reason', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/anchors' });
  await id('row-0x6a21').waitFor();
  const heads = () => id('anchor-table').locator('thead').textContent();
  assert.match(await heads(), /GDOP/);
  await id('columns').click();
  await id('column-gdop').uncheck();
  await id('column-lat').check();
  await id('dms').check();
  await page.keyboard.press('Escape');
  assert.equal(await id('columns-list').count(), 0);
  await page.reload();
  await id('row-0x6a21').waitFor();
  assert.doesNotMatch(await heads(), /GDOP/);
  assert.match(await text(id('row-0x6a21')), /51°01′\d\d\.\d{5}″\u00a0N/);
  await id('review').click();
  const leave = id('draft').getByTestId(/^leave-/);
  await leave.first().waitFor({ timeout: 60_000 });
  const good = await leave.count(),
    out = (await leave.first().getAttribute('data-testid')).slice('leave-'.length);
  assert.ok(good >= 2, `${good} may go out`);
  // Each anchor says why: gates, error budget, residuals, on the map among the others. What has moved since is told on the globe.
  await id(`why-${out}`).click();
  const review = id('review-anchor');
  await review.getByTestId('gates').waitFor();
  await review
    .getByTestId('residuals')
    .getByText(/ranges with weight/)
    .waitFor();
  assert.equal(await review.getByTestId('map').count(), 1);
  const shifts = (await id('draft').locator('tbody td:nth-child(5)').allTextContents()).map(Number);
  assert.ok(
    shifts.every((m) => m < 2),
    `from live: ${shifts.join()} m`,
  );
  assert.deepEqual(await violations(page), []);
  await picture(page, 'review-light');
  await id(`why-${out}`).click();
  await review.waitFor({ state: 'detached' });
  await leave.first().click();
  await page.getByLabel(`Why ${out} is rejected`).fill('its pole was hit');
  await id('publish-now').click();
  await eventually('it is published', async () => (await get('/api/v1/revisions')).items?.length === 1, 20_000);
  const [revision] = (await get('/api/v1/revisions')).items;
  assert.equal(revision.note, `Left out: ${out} (its pole was hit).`);
  const published = (await get('/api/v1/anchors')).features.map((f) => f.properties.network_id);
  assert.ok(published.length === good - 1 && !published.includes(out), published.join());
  assert.deepEqual(seen.errors, []);
  await page.close();
});
