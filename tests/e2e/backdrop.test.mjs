// A floor's plan under the maps of Live and Anchors: drawn where it was placed, put away by its choice, and there with the server away. Real
// server, a picture made byte by byte, the simulated flight round the hall whose plan it is.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { placed_floor, room_png } from './room.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord backdrop '));
let browser, server;

before(async () => {
  server = await startServer({ auth: 'off' });
  // The room is the hall: 5 cm a pixel, its south-west corner, pixel (100, 500), at the site's origin.
  await placed_floor(server, {
    origin: { lon: 3.7131, lat: 51.0231, h_m: 50 },
    png: room_png(),
    points: [
      [100, 500, 0, 0],
      [700, 500, 30, 0],
      [100, 100, 0, 20],
    ],
  });
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

/** Pixels of the map below everything that moves that are walls: ink, half as strong, on the ground of the light theme. */
const walls = (page, within = 'main') =>
  page.evaluate((part) => {
    let n = 0;
    for (const c of document.querySelectorAll(`${part} .mapcanvas canvas`)) {
      if (!c.width) continue;
      const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height);
      for (let i = 0; i < data.length; i += 4) {
        const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
        if (r > 105 && r < 126 && Math.abs(r - g) < 10 && Math.abs(r - b) < 10) n++;
      }
    }
    return n;
  }, within);
const drawn = (page, what, within) => eventually(what, async () => (await walls(page, within)) > 500, 15_000, 100);
const gone = (page, what) => eventually(what, async () => (await walls(page)) < 100, 5000, 100);

test('Live, Anchors, Replay and Review draw the plan under their maps; the choice puts it away in both, and is remembered', async () => {
  const { page, seen, id } = await openPage(browser, server);
  for (const [view, size] of [
    ['live', [1440, 900]],
    ['anchors', [1440, 900]],
    ['live', [390, 844]],
    ['anchors', [768, 1024]],
  ]) {
    await page.setViewportSize({ width: size[0], height: size[1] });
    await id(`nav-${view}`).click();
    await id('level').waitFor({ timeout: 10_000 });
    // All of the site on a phone leaves walls one pixel wide, grey by chance: nearer they have their own colour.
    if (size[0] < 600) await page.getByRole('button', { name: 'Zoom in' }).click();
    await drawn(page, `${view} at ${size.join(' x ')}`);
    assert.deepEqual(await violations(page), [], view);
    await picture(page, `backdrop-${view}-${size[0]}`);
  }
  // Review and Replay have the same choice under their maps.
  await page.setViewportSize({ width: 1440, height: 900 });
  await id('nav-replay').click();
  await id('scrubber').waitFor({ timeout: 20_000 });
  await drawn(page, 'replay');
  await id('nav-anchors').click();
  await id('review').click();
  await id('draft').getByTestId(/^why-/).first().click({ timeout: 60_000 });
  await id('review-anchor').waitFor();
  await drawn(page, 'review', '[data-testid="review-anchor"]');
  await picture(page, 'backdrop-review');
  await page.keyboard.press('Escape');
  await id('level').selectOption('');
  await gone(page, 'put away in Anchors');
  await id('nav-live').click();
  await id('level').waitFor();
  await gone(page, 'put away in Live');
  await page.reload();
  await id('level').waitFor({ timeout: 10_000 });
  assert.equal(await id('level').inputValue(), '');
  await gone(page, 'after a reload too');
  await id('level').selectOption('0');
  await drawn(page, 'brought back');
  const asked = [...seen.hosts].filter((host) => host !== ''); // a picture that is here already has none
  assert.deepEqual(asked, [new URL(server.url).host]);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('with the server away the plan stays under the maps, in a view that is opened then as well', async () => {
  const { page, id } = await openPage(browser, server);
  await drawn(page, 'Live');
  await id('nav-anchors').click();
  await drawn(page, 'Anchors');
  await id('nav-live').click();
  await drawn(page, 'Live again');
  process.kill(server.pid, 'SIGSTOP');
  try {
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 12_000);
    await drawn(page, 'Live without a server');
    await id('nav-anchors').click();
    await drawn(page, 'Anchors without a server');
    await picture(page, 'backdrop-lost');
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await page.close();
});
