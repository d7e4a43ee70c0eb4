// What axe finds, in every view, every theme and every size: nothing, the sizes of targets among it. One server with something in each view.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, violations } from './browser.mjs';
import { hall_outline } from './flight.mjs';
import { eventually, root, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord axe ')),
  sizes = [
    ['desk', 1440, 900],
    ['laptop', 1024, 768],
    ['tablet', 768, 1024],
    ['phone', 390, 844],
  ],
  views = ['live', 'plan', 'anchors', 'measurements', 'models', 'replay', 'system', 'guide'];
let browser, server;
const post = async (path, json, headers = {}) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};

before(async () => {
  server = await startServer({ auth: 'off' });
  const flight = join(folder, 'flight');
  assert.equal((await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', flight])).code, 0);
  const replayed = await run(['replay', flight, '--url', server.url, '--speed', 'max']);
  assert.equal(replayed.code, 0, replayed.stderr);
  const made = await post('/api/v1/plans/generate', {
    name: 'Hall',
    outline: hall_outline,
    building_height_m: 8,
    settings: { max_height_m: 14 },
  });
  await post('/api/v1/plans', made.plan);
  await post('/api/v1/campaigns', { name: 'halls' });
  const imported = await server.fetch('/api/v1/campaigns/halls/samples', {
    method: 'POST',
    headers: { 'content-type': 'text/csv' },
    body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
  });
  assert.equal(imported.status, 200, await imported.text());
  await post('/api/v1/datasets', {
    name: 'set',
    campaigns: ['halls'],
    aggregation: 'none',
    split: { test: ['room 6'] },
  });
  await post(
    '/api/v1/training-runs',
    { task: 'nlos_id', dataset: 'set', methods: ['logistic'], cv: { folds: 4, seed: 7 } },
    { prefer: 'wait=200' },
  );
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** What is wrong wherever the page is scrolled to: a bar at the bottom may half cover what can be scrolled out from under it. */
async function wrong(page) {
  const here = await violations(page, { sizes: true });
  if (!here.some((v) => v.startsWith('target-size'))) return here;
  await page.evaluate(() => {
    for (const e of document.querySelectorAll('*')) if (e.scrollHeight > e.clientHeight + 8) e.scrollTop += 90;
  });
  const there = await violations(page, { sizes: true });
  await page.evaluate(() => {
    for (const e of document.querySelectorAll('*')) if (e.scrollTop > 0) e.scrollTop -= 90;
  });
  return here.filter((v) => !v.startsWith('target-size') || there.includes(v));
}

for (const theme of ['light', 'dark', 'sun'])
  test(`no view breaks a rule of axe at any size, ${theme}`, async () => {
    const { page, id } = await openPage(browser, server, { hash: '#/live', theme }),
      found = [];
    for (const view of views) {
      await page.goto(`${server.url}/?theme=${theme}#/${view}`);
      await eventually(`${view} is there`, () => id(view).isVisible(), 20_000);
      for (const [size, width, height] of sizes) {
        await page.setViewportSize({ width, height });
        await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
        found.push(...(await wrong(page)).map((v) => `${view}, ${size}: ${v}`));
        await picture(page, `axe-${view}-${size}-${theme}`);
      }
    }
    assert.deepEqual(found, []);
    await page.close();
  });

test('the page of the API breaks none either', async () => {
  const page = await browser.context.newPage(),
    found = [];
  for (const [size, width, height] of sizes) {
    await page.setViewportSize({ width, height });
    await page.goto(`${server.url}/api/docs`);
    found.push(...(await violations(page, { sizes: true })).map((v) => `${size}: ${v}`));
  }
  assert.deepEqual(found, []);
  await page.close();
});
