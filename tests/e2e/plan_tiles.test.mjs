// A plan that is larger than its backdrop, in tiles: by REST, and under a map that asks for those in sight alone and is sharp where the backdrop is not.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text } from './browser.mjs';
import { ndjson, simulatedFlight } from './flight.mjs';
import { drawn_png, placed_floor } from './room.mjs';
import { eventually, startServer } from './server.mjs';

// 360 x 15 m at 2 cm a pixel, its middle at the site's origin; a wall round it, and about its middle lines of 2 pixels with as much between them: one of
// each is less than a pixel of a backdrop of 4096.
const WIDTH = 18_000,
  HEIGHT = 750,
  M_PER_PX = 0.02;
const plan = () =>
  drawn_png(
    WIDTH,
    HEIGHT,
    (x, y) =>
      x < 15 ||
      y < 15 ||
      x >= WIDTH - 15 ||
      y >= HEIGHT - 15 ||
      (x > 8400 && x < 9600 && y > 100 && y < 650 && x % 4 < 2),
  );

let browser, server, floor;
before(async () => {
  server = await startServer({ auth: 'off' });
  floor = await placed_floor(server, {
    origin: { lon: 3.7, lat: 51, h_m: 50 },
    png: plan(),
    points: [
      [0, 0],
      [WIDTH, 0],
      [0, HEIGHT],
    ].map(([x, y]) => [x, y, M_PER_PX * (x - WIDTH / 2), M_PER_PX * (HEIGHT / 2 - y)]),
  });
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

test('the floor says which tiles there are, and each is served with its ETag, or refused with those there are', async () => {
  assert.equal(floor.tiles_missing, null);
  const { levels, href, north_west_m, sha256 } = floor.tiles;
  assert.deepEqual(
    levels.map(({ level, columns, rows }) => [level, columns, rows]),
    // Of 32 768 pixels of the plan a side, and half of that each time.
    [
      [0, 1, 1],
      [1, 2, 1],
      [2, 3, 1],
      [3, 5, 1],
      [4, 9, 1],
      [5, 18, 1],
      [6, 36, 2],
      [7, 71, 3],
    ],
  );
  assert.ok(Math.abs(levels.at(-1).m_per_px - M_PER_PX) < 1e-6, `${levels.at(-1).m_per_px}`);
  assert.ok(Math.abs(north_west_m[0] + 180) < 0.01 && Math.abs(north_west_m[1] - 7.5) < 0.01, `${north_west_m}`);
  const at = (level, column, row, headers = {}) =>
    server.fetch(href.replace('{level}', level).replace('{column}', column).replace('{row}', row), { headers });
  const tile = await at(7, 35, 1);
  assert.equal(tile.status, 200);
  assert.equal(tile.headers.get('content-type'), 'image/png');
  assert.equal(tile.headers.get('etag'), `"${sha256}"`);
  const bytes = Buffer.from(await tile.arrayBuffer());
  assert.deepEqual([bytes.readUInt32BE(16), bytes.readUInt32BE(20)], [256, 256]);
  assert.equal((await at(7, 35, 1, { 'if-none-match': `"${sha256}"` })).status, 304);
  const outside = await at(7, 71, 0);
  assert.equal(outside.status, 404);
  assert.match((await outside.json()).detail, /level 7 of the plan has columns 0 to 70 and rows 0 to 2/);
});

/** How far light and dark are apart in the middle row of the plan under the map: the lines, or their grey. */
const contrast = (id) =>
  id('under-plan').evaluate((c) => {
    const { data } = c.getContext('2d').getImageData(c.width / 2 - 60, c.height / 2, 120, 1);
    const reds = [];
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 0) reds.push(data[i]);
    reds.sort((a, b) => a - b);
    return reds.length < 100 ? null : reds[Math.floor(reds.length * 0.9)] - reds[Math.floor(reds.length * 0.1)];
  });

test('near by, the map asks for the tiles in sight alone, is sharper by them than by the backdrop, and stays so without a server', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
  await eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
  let asked = [],
    away = true;
  await page.route(/\/plan\/tiles\//, (route) => {
    if (away) return route.abort();
    asked.push(route.request().url().split('/tiles/')[1]);
    return route.continue();
  });
  await id('where').fill('51.0000, 3.7000');
  await id('where').press('Enter');
  await id('level').waitFor();
  await eventually('the plan is there', async () => (await contrast(id)) !== null, 20_000);
  for (let i = 0; i < 5; i++) await page.getByRole('button', { name: 'Zoom in' }).click();
  const px_per_m = 8 * 1.5 ** 5;
  await eventually('the backdrop stands in', async () => (await contrast(id)) !== null);
  const blurred = await contrast(id);
  assert.ok(blurred < 90, `${blurred}: the backdrop cannot tell the lines apart`);
  await picture(page, 'plan-tiles-backdrop');
  away = false;
  await eventually('the lines are seen', async () => (await contrast(id)) > 150, 20_000);
  await picture(page, 'plan-tiles');
  // Of the last level, 5.12 m a side, from (-180, 7.5) m.
  const [w, h] = await id('under-plan').evaluate((c) => [c.width, c.height]),
    side = 256 * M_PER_PX,
    [de, dn] = [w / 2 / px_per_m, h / 2 / px_per_m],
    in_sight = [];
  for (let row = Math.floor((7.5 - dn) / side); row < Math.ceil((7.5 + dn) / side); row++)
    for (let column = Math.floor((180 - de) / side); column < Math.ceil((180 + de) / side); column++)
      if (row >= 0 && row < 3) in_sight.push(`7/${column}/${row}`);
  await eventually('all in sight were asked for', async () => in_sight.every((tile) => asked.includes(tile)));
  assert.deepEqual([...asked].sort(), [...in_sight].sort(), 'each once, and no others');
  assert.ok(in_sight.length < 40, `${in_sight.length} of 213`);

  assert.deepEqual(
    seen.errors.filter((line) => !/ERR_FAILED/.test(line)), // the tiles that were kept away
    [],
  );

  process.kill(server.pid, 'SIGSTOP');
  try {
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 30_000);
    for (let i = 0; i < 3; i++) await page.getByRole('button', { name: 'Zoom out' }).click();
    await eventually('further off it is grey', async () => (await contrast(id)) < 90);
    for (let i = 0; i < 3; i++) await page.getByRole('button', { name: 'Zoom in' }).click();
    await eventually('the lines are back', async () => (await contrast(id)) > 150);
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await page.close();
});

/** Pixels of the map below everything that moves that are ink, half as strong, on the ground of the light theme. */
const ink = (page) =>
  page.evaluate(() => {
    let n = 0;
    for (const c of document.querySelectorAll('main .mapcanvas canvas')) {
      if (!c.width) continue;
      const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height);
      for (let i = 0; i < data.length; i += 4) {
        const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
        if (r > 105 && r < 130 && Math.abs(r - g) < 10 && Math.abs(r - b) < 10) n++;
      }
    }
    return n;
  });

test('Live draws the same tiles under a flight over the plan', async () => {
  const { mission, fixes } = await simulatedFlight({ duration: 30 }),
    post = async (path, options) => {
      const answer = await server.fetch(path, { method: 'POST', ...options });
      assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
      return answer.json();
    };
  const flown = await post('/api/v1/missions', { json: mission });
  // Over the middle of the plan.
  const there = fixes.map((fix) => ({
    ...fix,
    mission: flown.id,
    lon: fix.lon - fixes[0].lon + 3.7,
    lat: fix.lat - fixes[0].lat + 51,
  }));
  await post('/api/v1/fixes', { body: ndjson(there), headers: { 'content-type': 'application/x-ndjson' } });
  const { page, seen, id } = await openPage(browser, server);
  const asked = new Set();
  let away = true;
  await page.route(/\/plan\/tiles\//, (route) => {
    if (away) return route.abort();
    asked.add(route.request().url().split('/tiles/')[1].split('/')[0]);
    return route.continue();
  });
  await id('level').waitFor({ timeout: 20_000 });
  await page.getByRole('button', { name: 'Follow drone' }).click();
  for (let i = 0; i < 2; i++) await page.getByRole('button', { name: 'Zoom in' }).click();
  await page.waitForRequest(/\/plan\/tiles\//, { timeout: 20_000 });
  const blurred = await ink(page);
  away = false;
  await eventually('the lines are seen', async () => (await ink(page)) > blurred + 3000, 20_000, 100);
  // A click while the map still moves is less than a whole step.
  const nearer = async () => asked.has('7') || void (await page.getByRole('button', { name: 'Zoom in' }).click());
  await eventually('the last level was asked for', nearer, 20_000, 500);
  await picture(page, 'plan-tiles-live');
  assert.ok(!asked.has('5'), `${[...asked]}: no level that the backdrop is as sharp as`);
  assert.deepEqual(
    seen.errors.filter((line) => !/ERR_FAILED/.test(line)),
    [],
  );
  await page.close();
});
