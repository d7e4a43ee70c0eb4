// What axe finds, in every view, every theme and every size: nothing, the sizes of targets among it; and that all of it can be read.
// One server with something in each view.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, unreadable, violations } from './browser.mjs';
import { fullServer, sizes, views } from './full_server.mjs';
import { eventually } from './server.mjs';

let browser, server, mission;

before(async () => {
  ({ server, mission } = await fullServer());
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
  test(`no view breaks a rule of axe at any size, and every word of it can be read, ${theme}`, async () => {
    const { page, id } = await openPage(browser, server, { hash: '#/live', theme }),
      found = [];
    for (const view of views) {
      await page.goto(`${server.url}/?theme=${theme}#/${view}`);
      await eventually(`${view} is there`, () => id(view).isVisible(), 20_000);
      for (const [size, width, height] of sizes) {
        await page.setViewportSize({ width, height });
        await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
        found.push(...[...(await wrong(page)), ...(await unreadable(page))].map((v) => `${view}, ${size}: ${v}`));
        await picture(page, `axe-${view}-${size}-${theme}`);
      }
    }
    assert.deepEqual(found, []);
    await page.close();
  });

test('no page of the guide, no state of Help and none of Replay breaks one, on a phone', async () => {
  const [, width, height] = sizes.at(-1),
    { page, id } = await openPage(browser, server, { hash: '#/guide', width, height }),
    found = [];
  const look = async (state, within = null) => {
    const here = within ? await violations(page, { sizes: true, within }) : await wrong(page);
    found.push(...here.map((v) => `${state}: ${v}`));
    await picture(page, `axe-state-${state.replaceAll(/\W+/g, '-')}`);
  };
  await id('guide').waitFor({ timeout: 20_000 });
  const links = await id('guide')
    .locator('nav a')
    .evaluateAll((all) => all.map((a) => [a.hash, a.textContent]));
  for (const [hash, title] of links) {
    await page.evaluate((to) => (location.hash = to), hash);
    await id('guide').getByRole('heading', { level: 1, name: title, exact: true }).waitFor();
    await look(`guide, ${title}`, 'article'); // its list of pages is held above
  }
  for (const view of ['live', 'replay', 'system']) {
    await page.goto(`${server.url}/?theme=light#/${view}`);
    await eventually(`${view} is there`, () => id(view).isVisible(), 20_000);
    await page.keyboard.press('?');
    await id('help-page').waitFor();
    await look(`help over ${view}`, '[data-testid="help"]');
    await page.keyboard.press('Escape');
  }
  await page.goto(`${server.url}/?theme=light#/replay/${mission.id}?t=20`);
  await eventually('the flight is read', async () => /\d/.test(await text(id('replay-time'))), 20_000);
  await eventually('its anchors', async () => (await id('anchor-card').count()) === 1, 20_000);
  await look('replay at a moment');
  await id('play').click();
  await look('replay playing');
  await id('play').click();
  await id('show-elevation').click();
  await look('replay from the side');
  await page.goto(`${server.url}/?theme=light#/replay/0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f`);
  await page.getByTestId('unknown-flight').waitFor();
  await look('replay of no flight');
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
