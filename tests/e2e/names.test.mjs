// One long name, with an emoji and words from right to left, for each thing that has a name: it makes no view or panel wider than its place.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture } from './browser.mjs';
import { hall_outline, ndjson, simulatedFlight } from './flight.mjs';
import { sizes } from './full_server.mjs';
import { eventually, root, startServer } from './server.mjs';

const name = `Werkstattgebäudeerweiterungs${'Nord'.repeat(12)} 🛰️ قاعة الاختبار الكبرى`;
let browser, server, mission, plan, run, calibration;

async function send(path, json, headers = {}) {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
}

async function fly() {
  const flight = await simulatedFlight({ duration: 60 }),
    rows = (of) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(of) });
  const { id: site } = await send('/api/v1/sites', { name, origin: { lon: 3.7131, lat: 51.0231, h_m: 50 } });
  ({ id: mission } = await send('/api/v1/missions', { ...flight.mission, name, kit: name, site }));
  await server.fetch(`/api/v1/fixes?mission=${mission}`, rows(flight.fixes));
  await server.fetch(`/api/v1/ranges?mission=${mission}`, rows(flight.ranges));
  await send(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  ({ id: calibration } = await send('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' }));
  await send(`/api/v1/calibrations/${calibration}/publish`, {});
  const address = '/api/v1/anchors/0x6a21',
    etag = (await server.fetch(address)).headers.get('etag');
  const named = await server.fetch(address, {
    method: 'PATCH',
    body: JSON.stringify({ name }),
    headers: { 'content-type': 'application/merge-patch+json', 'if-match': etag },
  });
  assert.equal(named.status, 200, await named.text());
}

async function learn() {
  await send('/api/v1/campaigns', { name });
  await server.fetch(`/api/v1/campaigns/${encodeURIComponent(name)}/samples`, {
    method: 'POST',
    headers: { 'content-type': 'text/csv' },
    body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
  });
  await send('/api/v1/datasets', { name, campaigns: [name], aggregation: 'none', split: { test: ['room 6'] } });
  const asked = { task: 'nlos_id', dataset: name, methods: ['logistic'], cv: { folds: 4, seed: 7 } };
  ({ id: run } = await send('/api/v1/training-runs', asked, { prefer: 'wait=200' }));
}

before(async () => {
  server = await startServer({ auth: 'off' });
  await fly();
  await learn();
  await send('/api/v1/devices', { kind: 'gnss', name, address: 'tcp://127.0.0.1:9' });
  const settings = { max_height_m: 14 };
  const made = await send('/api/v1/plans/generate', { name, outline: hall_outline, building_height_m: 8, settings });
  ({ id: plan } = await send('/api/v1/plans', made.plan));
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

/** Panels that what is in them reaches out of, and views that would have to be moved sideways. */
const beyond = (page, view) =>
  page.evaluate((root) => {
    const parts = [...document.querySelectorAll('main section, main .toolbar')].filter(
      (e) => e.checkVisibility() && !/auto|scroll/.test(getComputedStyle(e).overflowX),
    );
    return [document.documentElement, document.querySelector(`[data-testid="${root}"]`), ...parts]
      .filter((e) => e.scrollWidth > e.clientWidth + 2)
      .map((e) => `${e.dataset.testid ?? e.className}: ${e.scrollWidth} px in ${e.clientWidth}`);
  }, view);

for (const [size, width, height] of sizes)
  test(`a long name breaks no view, ${size}`, async () => {
    const views = [
      ['live', '#/live'],
      ['plan', `#/plan/${plan}`],
      ['anchors', '#/anchors'],
      ['anchors', '#/anchors/0x6a21'],
      ['measurements', '#/measurements'],
      ['models', '#/models'],
      ['models', `#/models/runs/${run}`],
      ['replay', `#/replay/${mission}?t=20`],
      ['system', '#/system'],
    ];
    for (const [view, hash] of views) {
      const { page, id } = await openPage(browser, server, { hash, width, height });
      await id(view).waitFor({ timeout: 20_000 });
      await eventually('the view has what it shows', () => page.getByText('Werkstatt').count(), 20_000);
      await page.waitForTimeout(500); // late panels
      assert.deepEqual(await beyond(page, view), [], hash);
      await picture(page, `names-${view}-${size}`);
      await page.close();
    }
  });

test('a long name breaks no report, on A4 and on a phone', async () => {
  const page = await browser.context.newPage();
  for (const [width, height] of [
    [1000, 1200],
    [390, 844],
  ]) {
    await page.setViewportSize({ width, height });
    await page.goto(`${server.url}/api/v1/calibrations/${calibration}/report`);
    const out = await page.evaluate(() => {
      const sheets = [...document.querySelectorAll('.sheet')],
        scrolls = (e) => e.closest('table') && getComputedStyle(e.closest('table')).overflowX === 'auto';
      return sheets.flatMap((sheet) => {
        const { right } = sheet.getBoundingClientRect();
        return [...sheet.querySelectorAll('*')]
          .filter((e) => e.getBoundingClientRect().right > right + 1 && !scrolls(e))
          .map((e) => `${e.tagName}.${e.className}: ${e.textContent.slice(0, 40)}`);
      });
    });
    assert.deepEqual(out, [], `${width} px`);
    assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width, `${width} px wide`);
  }
  await page.close();
});
