// What axe finds, in every view, every theme and every size: nothing, the sizes of targets among it. One server with something in each view.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, violations } from './browser.mjs';
import { fullServer, sizes, views } from './full_server.mjs';
import { eventually } from './server.mjs';

let browser, server;

before(async () => {
  ({ server } = await fullServer());
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
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
