// A page that cannot keep up gets less, never older: on a fraction of the CPU, where the browser itself would queue what its socket brings, and over
// 1 Mbit/s and 300 ms. Fifty anchors, a hundred ranges a second, the real server.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text } from './browser.mjs';
import { feeder_args, fly_fifty, watch_ages } from './fifty_anchors.mjs';
import { eventually, startServer } from './server.mjs';
import { slowLink } from './slow_link.mjs';

const k_late_ms = 2000; // dashboard.md: beyond it the link reads LATE
let browser, server, flight;

before(async () => {
  server = await startServer({ args: feeder_args });
  flight = await fly_fifty(server);
  browser = await openBrowser({ reducedMotion: 'no-preference' });
  await browser.context.addInitScript(watch_ages);
});
after(async () => {
  flight?.stop();
  await browser?.close();
  await server?.dispose();
});

const shown = (id) =>
  eventually(
    'ranges of all anchors are shown',
    async () => (await id('range-list').locator('tbody tr').count()) === 50,
    60_000,
    250,
  );
/** For so long: ages of the ranges as they were worked in, and what the page said of its link meanwhile. */
async function watched(page, id, seconds) {
  await page.evaluate(() => (globalThis.range_ages.length = 0));
  const said = [],
    end = Date.now() + seconds * 1000;
  while (Date.now() < end) {
    said.push(await text(id('status-link')));
    await new Promise((done) => setTimeout(done, 500));
  }
  const ages = await page.evaluate(() => globalThis.range_ages);
  assert.ok(ages.length > 3, `${ages.length} frames of ranges in ${seconds} s`);
  return { ages: ages.map(([, age_ms]) => Math.round(age_ms)), said };
}
const middle = (list) => [...list].sort((a, b) => a - b)[list.length >> 1];

test('on a twelfth of the CPU the page shows less, and nothing that is older', async () => {
  const { page, id } = await openPage(browser, server);
  await shown(id);
  const cdp = await page.context().newCDPSession(page);
  await cdp.send('Emulation.setCPUThrottlingRate', { rate: 12 });
  await new Promise((done) => setTimeout(done, 3000)); // what was on its way has come
  const { ages } = await watched(page, id, 12),
    half = ages.length >> 1;
  await cdp.send('Emulation.setCPUThrottlingRate', { rate: 1 });
  assert.ok(middle(ages) < k_late_ms, `half of the ranges are older than ${middle(ages)} ms: ${ages}`);
  assert.ok(
    middle(ages.slice(half)) < middle(ages.slice(0, half)) + 1000,
    `they grow older: ${middle(ages.slice(0, half))} ms, then ${middle(ages.slice(half))} ms`,
  );
  await picture(page, 'slow-page');
  // Given its time back it is as quick as any, without a new connection.
  await eventually(
    'LIVE, with nothing old',
    async () => {
      const newest = await page.evaluate(() => globalThis.range_ages.at(-1)[1]);
      return newest < 500 && (await text(id('status-link'))).includes('LIVE');
    },
    10_000,
    250,
  );
  await page.close();
});

test('over 1 Mbit/s and 300 ms what is shown is younger than two seconds, and LIVE', async () => {
  const link = await slowLink(server.port);
  try {
    const { page, id } = await openPage(browser, { url: `http://127.0.0.1:${link.port}` });
    await shown(id);
    await new Promise((done) => setTimeout(done, 8000)); // the other views come in the background
    const { ages, said } = await watched(page, id, 8);
    assert.ok(Math.min(...ages) > 150, `the link delays: ${Math.min(...ages)} ms`);
    assert.ok(middle(ages) < 1000, `half of the ranges are older than ${middle(ages)} ms`);
    assert.ok(Math.max(...ages) < k_late_ms, `the oldest is ${Math.max(...ages)} ms old`);
    assert.deepEqual(
      said.filter((s) => !s.includes('LIVE')),
      [],
    );
    await picture(page, 'slow-link');
    await page.close();
  } finally {
    await link.close();
  }
});
