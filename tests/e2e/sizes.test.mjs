// What each view is for is done at each size: desk, 1024 x 768, portrait tablet, phone. One server with something in each view; numbers against the API's.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text } from './browser.mjs';
import { fullServer, sizes } from './full_server.mjs';
import { eventually } from './server.mjs';

let browser, server, mission, plan, training;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  ({ server, mission, plan, training } = await fullServer());
  browser = await openBrowser({ hasTouch: true });
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

for (const [size, width, height] of sizes)
  test(`models, measurements, replay, review and plan work, and no other host is asked, ${size}`, async () => {
    const { page, seen, id } = await openPage(browser, server, { width, height, hash: '#/models' }),
      press = (name) => (width < 1000 ? id(name).tap() : id(name).click()),
      open = async (view) => {
        await press(`nav-${view}`);
        await id(view).waitFor({ timeout: 20_000 });
      };
    // F11: the confusion is that of the API.
    await id('confusion').waitFor({ timeout: 20_000 });
    const c = (await get(`/api/v1/training-runs/${training.id}/confusion`)).test.confusion;
    assert.deepEqual((await id('confusion').locator('tbody td b').allTextContents()).map(Number), [
      c.tp,
      c.fn,
      c.fp,
      c.tn,
    ]);
    // F19: a measurement opens.
    await open('measurements');
    await eventually('rows are there', async () => (await id('rows').getByRole('row').count()) > 3, 20_000);
    // F12: a jump of the replay shows that moment.
    await page.evaluate((m) => (location.hash = `#/replay/${m}?t=20`), mission.id);
    await id('scrubber').waitFor({ timeout: 20_000 });
    await eventually('the moment is shown', async () => /00:20|20\.0/.test(await text(id('replay-time'))), 10_000);
    assert.equal(await page.getByTestId(/^cmd-/).count(), 0, 'no command in a replay');
    // The review has what the API has.
    await open('anchors');
    await press('review');
    await id('draft').locator('tbody tr').first().waitFor({ timeout: 60_000 });
    const { anchors } = await get(`/api/v1/calibrations/${(await get('/api/v1/calibrations')).items[0].id}`);
    for (const { network_id } of anchors) assert.ok(await id('draft').getByText(network_id).count(), network_id);
    await picture(page, `sizes-review-${size}`);
    await page.keyboard.press('Escape');
    // F9: a plan is named, and what was typed is there after another view.
    await open('plan');
    await id('plan-name').fill(`Hall on a ${size}`);
    await open('system');
    await open('plan');
    await eventually(
      'the name that was typed',
      async () => (await id('plan-name').inputValue()) === `Hall on a ${size}`,
    );
    if (height > width)
      for (const view of ['live', 'anchors', 'plan']) {
        await open(view);
        const box = await id(view === 'plan' ? 'plan-map' : 'map')
          .first()
          .boundingBox();
        assert.ok(box.height >= 0.4 * height, `map of ${box.height} px in ${view}`);
      }
    await open('plan');
    await page.getByRole('button', { name: 'Discard them' }).click();
    // F1: all of it without the internet.
    assert.deepEqual([...seen.hosts], [new URL(server.url).host]);
    assert.deepEqual(seen.errors, []);
    await page.close();
  });

for (const theme of ['light', 'sun'])
  test(`at 1024 x 768 the tools of a view are one row, files in a list, ${theme}`, async () => {
    for (const [view, hash] of [
      ['plan', `#/plan/${plan}`],
      ['anchors', '#/anchors'],
    ]) {
      const { page, id } = await openPage(browser, server, { width: 1024, height: 768, theme, hash });
      await id('export').waitFor({ timeout: 20_000 });
      const rows = await page.evaluate(() => {
        const boxes = [...document.querySelector('.toolbar').children]
          .filter((e) => getComputedStyle(e).position !== 'absolute')
          .map((e) => e.getBoundingClientRect())
          .filter((b) => b.height > 0);
        return Math.max(...boxes.map((b) => b.top)) < Math.min(...boxes.map((b) => b.bottom)) ? 1 : 2;
      });
      assert.equal(rows, 1, `rows of tools in ${view}`);
      await opensByKeys(page, id('export'), id('export-list'));
      await id('export').click();
      const file = await fetch(new URL(await id('geojson').getAttribute('href'), server.url));
      assert.equal((await file.json()).type, 'FeatureCollection');
      await page.close();
    }
  });

test('in forced colours nothing is lost: states have shape and word, buttons an edge', async () => {
  const { page, id } = await openPage(browser, server);
  await page.emulateMedia({ forcedColors: 'active' });
  await id('live').waitFor({ timeout: 20_000 });
  for (const tile of ['status-link', 'status-rtk', 'status-uwb'])
    assert.match(await text(id(tile)), /[A-Z0-9]{2,}/, tile);
  const bare = await page.evaluate(() =>
    [...document.querySelectorAll('button.btn, button.cmd, select, input')]
      .filter((b) => b.checkVisibility())
      .filter((b) => ['none', 'hidden'].includes(getComputedStyle(b).borderTopStyle))
      .map((b) => b.textContent || b.name),
  );
  assert.deepEqual(bare, []);
  await picture(page, 'forced-colours');
  await page.close();
});

test('a server that was killed and started again: every page is back by itself, with what is there now', async () => {
  const pages = [];
  for (const [, width, height] of sizes) pages.push(await openPage(browser, server, { width, height }));
  const all = (look) => Promise.all(pages.map(look));
  const live = ({ id }) => eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 30_000);
  await all(live);
  await server.kill();
  await all(({ id }) =>
    id('alarm-link.lost').or(id('status-link').getByText('LOST')).first().waitFor({ timeout: 30_000 }),
  );
  await server.start();
  await all(live);
  const made = await server.fetch('/api/v1/missions', {
    json: { name: 'After the restart', frame: 'wgs84', track_point: 'tag_antenna' },
  });
  assert.equal(made.status, 201);
  await all(({ page }) =>
    eventually(
      'the flight that began after it is in the page',
      async () => (await page.getByText('After the restart').count()) > 0,
      30_000,
    ),
  );
  await all(({ page }) => page.close());
});
