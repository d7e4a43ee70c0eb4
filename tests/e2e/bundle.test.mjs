// A site leaves one server as a file from its dashboard, and stands on another by its Import view: the same flight, with its events.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually, startServer } from './server.mjs';

let folder, here, there, browser, mission, site;
const json = async (server, path) => (await server.fetch(path)).json();

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  here = await startServer({ auth: 'off' });
  there = await startServer({ auth: 'off' });
  browser = await openBrowser({ acceptDownloads: true });
  const send = async (path, body, type = 'application/json') =>
    (
      await here.fetch(path, {
        method: 'POST',
        headers: { 'content-type': type },
        body: typeof body === 'string' ? body : JSON.stringify(body),
      })
    ).json();
  site = (await send('/api/v1/sites', { name: 'Hall <b>é</b>' })).id;
  const flight = { name: 'north side', site, frame: 'wgs84', track_point: 'tag_antenna' };
  mission = (await send('/api/v1/missions', flight)).id;
  const t_us = 1_777_889_472_000_000,
    rows = (n, row) => Array.from({ length: n }, (_, k) => JSON.stringify(row(k))).join('\n') + '\n',
    sigma_m = [0.01, 0.01, 0.02];
  const fix = (k) => ({
      t_us: t_us + k * 100_000,
      lon: 3.7131,
      lat: 51.0231 + k * 1e-6,
      h_m: 60,
      fix: 'fixed',
      sigma_m,
    }),
    range = (k) => ({ t_us: t_us + k * 100_000, tag: '0x6e01', anchor: '0x6a2f', distance_m: 12 + k / 100 });
  await send(`/api/v1/fixes?mission=${mission}`, rows(50, fix), 'application/x-ndjson');
  await send(`/api/v1/ranges?mission=${mission}`, rows(50, range), 'application/x-ndjson');
  assert.equal((await send(`/api/v1/missions/${mission}/actions`, { action: 'finish' })).state, 'finished');
});
after(async () => {
  await browser?.close();
  await here?.dispose();
  await there?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** What a link of the page downloads, in a file of the folder. */
async function downloaded(page, link, name) {
  const [download] = await Promise.all([page.waitForEvent('download'), link.click()]);
  const path = join(folder, name);
  await download.saveAs(path);
  return path;
}
/** The Import view with this file chosen, once it has an answer. */
async function imported(file) {
  const { page, id, seen } = await openPage(browser, there, { hash: '#/import' });
  await id('import').locator('input[type="file"]').first().setInputFiles(file);
  await page.locator('[data-testid="bundle-result"], [data-testid="bundle-problem"]').waitFor({ timeout: 60_000 });
  return { page, id, seen };
}

test('the bundle of a flight comes from System and goes in by Import', async () => {
  const { page, id } = await openPage(browser, here, { hash: '#/system' });
  await id('bundle-flight').first().waitFor({ timeout: 20_000 });
  const file = await downloaded(page, id('bundle-flight').first(), 'flight.anchord');
  await page.close();
  const other = await imported(file);
  assert.match(await text(other.id('bundle-result')), /on this server/);
  assert.deepEqual(await violations(other.page), []);
  await picture(other.page, 'import-bundle');
  await other.id('bundle-import').getByRole('link').first().click();
  await eventually('its replay', async () => /\d/.test(await text(other.id('replay-time'))), 30_000);
  assert.deepEqual(other.seen.errors, []);
  await other.page.close();
  const [a, b] = [await json(here, `/api/v1/missions/${mission}`), await json(there, `/api/v1/missions/${mission}`)];
  assert.equal(b.n_ranges, 50);
  assert.equal(b.n_fixes, a.n_fixes);
  const events = await json(here, `/api/v1/missions/${mission}/events?limit=1000`),
    theirs = new Map((await json(there, `/api/v1/missions/${mission}/events?limit=1000`)).items.map((e) => [e.id, e]));
  assert.ok(events.items.length > 0, 'a flight has events');
  for (const event of events.items) assert.deepEqual(theirs.get(event.id), event);
});

test('a whole site does too, and says what was here already', async () => {
  const answer = await here.fetch(`/api/v1/sites/${site}/bundle`);
  assert.equal(answer.status, 200);
  const file = join(folder, 'site.anchord');
  writeFileSync(file, Buffer.from(await answer.arrayBuffer()));
  const { page, id, seen } = await imported(file);
  assert.match(await text(id('bundle-result')), /The site is on this server|already on this server/);
  assert.match(await text(id('bundle-import')), /north side.*was already on this server/s);
  assert.equal((await json(there, `/api/v1/sites/${site}`)).name, 'Hall <b>é</b>');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a file that is none says so, and nothing comes of it', async () => {
  const file = join(folder, 'broken.anchord');
  writeFileSync(file, 'no zip file');
  const { page, id } = await imported(file);
  assert.match(await text(id('bundle-problem')), /It was not imported\. \S+/);
  await page.close();
});
