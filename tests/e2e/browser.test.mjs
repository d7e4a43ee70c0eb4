// The dashboard as people use it: Debian's Chromium, the real binary, the simulated flight through the real REST door.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { gzipSync } from 'node:zlib';
import { chromiumPath, haveChromium, openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { sizes } from './full_server.mjs';
import { binary, eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
const flight = join(folder, 'flight');
let browser, flown;

before(async () => {
  assert.ok(haveChromium, `${chromiumPath} is missing: apt-get install chromium`);
  const made = await run(['simulate', 'flight', '--seed', '7', '--duration', '150', '--out', flight]);
  assert.equal(made.code, 0, made.stderr);
  browser = await openBrowser({ reducedMotion: 'no-preference' });
  flown = await startServer({ auth: 'off' });
});
after(async () => {
  await browser?.close();
  await flown?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** Plays the flight into the server; `ended` resolves with its exit code. */
function replay(server, speed) {
  const child = spawn(binary, ['replay', flight, '--url', server.url, '--speed', String(speed)], {
    stdio: ['ignore', 'ignore', 'pipe'],
  });
  let stderr = '';
  child.stderr.setEncoding('utf8').on('data', (c) => (stderr += c));
  const ended = new Promise((done) => child.once('exit', (code) => done({ code, stderr })));
  return { ended, stop: () => child.kill('SIGTERM') };
}
/** What the first page gives to copy. */
const commands = (id) =>
  id('first-run')
    .locator('input')
    .evaluateAll((all) => all.map((e) => e.value));

test('a cold start offline shows what to do first, asks no other host and logs no error', async () => {
  const server = await startServer({ auth: 'off' });
  try {
    const { page, seen, id } = await openPage(browser, server);
    await id('first-run').waitFor();
    await eventually('the link is live', async () => (await text(id('status-link'))).includes('LIVE'));
    assert.deepEqual([...seen.hosts], [new URL(server.url).host]);
    assert.deepEqual(seen.errors, []);
    assert.ok((await commands(id)).includes(`anchord import flight DIR --url ${server.url}`), 'nobody signs in here');
    await picture(page, 'first-run-light');
    await page.close();
  } finally {
    await server.dispose();
  }
});

test('the script and the styles stay within their budgets', async () => {
  const page = await (await fetch(flown.url)).text();
  const first = [...page.matchAll(/(?:src|href)="\.\/(assets\/[^"]+)"/g)].map((m) => m[1]);
  const size = async (path) =>
    gzipSync(Buffer.from(await (await fetch(`${flown.url}/${path}`)).arrayBuffer()), { level: 9 }).length;
  const sizes = Object.fromEntries(await Promise.all(first.map(async (p) => [p, await size(p)])));
  const js = Object.entries(sizes)
    .filter(([p]) => p.endsWith('.js'))
    .reduce((s, [, n]) => s + n, 0);
  const css = Object.entries(sizes)
    .filter(([p]) => p.endsWith('.css'))
    .reduce((s, [, n]) => s + n, 0);
  const entry = await (await fetch(`${flown.url}/${first.find((p) => p.endsWith('.js'))}`)).text();
  const chunks = [...new Set([...entry.matchAll(/\.\/([\w-]+\.js)/g)].map((m) => m[1]))];
  const lazy = await Promise.all(chunks.map((c) => size(`assets/${c}`)));
  console.log(
    `first load ${js} B gz script, ${css} B gz style; chunks ${chunks.map((c, i) => `${c} ${lazy[i]}`).join(', ')}`,
  );
  assert.ok(js > 5000 && js <= 52_000, `first load ${js} B gz`);
  assert.ok(first.length <= 3, `${first.length} files before anything is seen`);
  assert.ok(css <= 15_000, `style ${css} B gz`);
  assert.ok(chunks.length >= 2, 'map and plot are chunks of their own');
  for (const n of lazy) assert.ok(n <= 130_000, `a chunk of ${n} B gz`);
  assert.ok(js + lazy.reduce((a, b) => a + b, 0) <= 300_000);
});

test('signed out: the sheet asks for a token, refuses a wrong one, and the right one opens the page', async () => {
  const server = await startServer({ auth: 'on' });
  try {
    const { page, id } = await openPage(browser, server);
    await id('sign-in').waitFor();
    await id('token').fill('anc_000000_not-a-token');
    await id('sign-in-submit').click();
    await page.getByText('is unknown').waitFor();
    assert.deepEqual(await violations(page), []);
    await picture(page, 'signed-out-light');
    await id('token').fill(server.token);
    await id('sign-in-submit').click();
    await id('sign-in').waitFor({ state: 'detached' });
    await eventually('the link is live', async () => (await text(id('status-link'))).includes('LIVE'));
    assert.ok((await commands(id)).includes(`anchord import flight DIR --url ${server.url} --token-file TOKEN_FILE`));
    await page.close();
    await browser.context.clearCookies();
  } finally {
    await server.dispose();
  }
});

test('a simulated flight converges on screen, and what is published is what the calibration found', async () => {
  const { page, seen, id } = await openPage(browser, flown);
  await eventually('the link is live', async () => (await text(id('status-link'))).includes('LIVE'));
  const playing = replay(flown, 4); // anchors are solved by the clock of the machine: a busy one needs the time
  try {
    await id('progress').waitFor({ timeout: 20_000 });
    await eventually('ranges arrive', async () => (await id('range-list').locator('tbody tr').count()) >= 3, 20_000);
    await eventually('the fix is shown', async () => (await text(id('status-rtk'))).match(/FIX|FLOAT/), 10_000);
    await eventually(
      'height and speed are read',
      async () => /Height above origin[−\d.]+.*Speed[\d.]+/.test(await text(id('rtk-card'))),
      10_000,
    );
    await picture(page, 'live-converging');
    await eventually(
      'three anchors converge',
      async () => {
        const done = /(\d+) of (\d+)/.exec(await text(id('progress').locator('dd')));
        return done && Number(done[1]) >= 3;
      },
      60_000,
      250,
    );
    for (const theme of ['light', 'dark', 'sun']) {
      while ((await page.locator('html').getAttribute('data-theme')) !== theme) await id('theme').click();
      assert.deepEqual(await violations(page), [], `live, ${theme}`);
      await picture(page, `live-${theme}`);
    }
    await page.setViewportSize({ width: 810, height: 1080 });
    await page.evaluate(() => new Promise(requestAnimationFrame));
    await picture(page, 'live-portrait-sun');
    await page.setViewportSize({ width: 1440, height: 900 });
  } finally {
    const { code, stderr } = await playing.ended;
    assert.equal(code, 0, stderr);
  }
  await id('theme').click();

  // Nothing moves any more: a page that is left open does not use up the tablet's battery.
  const pictures = await page.evaluate(async () => {
    const ask = globalThis.requestAnimationFrame;
    let n = 0;
    globalThis.requestAnimationFrame = (draw) => {
      n++;
      return ask(draw);
    };
    await new Promise((done) => setTimeout(done, 2000)); // the last pose is of more than 1.5 s ago
    n = 0;
    await new Promise((done) => setTimeout(done, 3000));
    globalThis.requestAnimationFrame = ask;
    return n;
  });
  assert.ok(pictures > 0 && pictures < 60, `${pictures} pictures in 3 s`);

  await page.keyboard.press('3');
  await id('anchor-table').waitFor();
  const rows = await id('anchor-table').locator('tbody tr').count();
  assert.ok(rows >= 3, `${rows} anchors`);
  await id('review').click();
  await id('draft').waitFor({ timeout: 60_000 });
  await picture(page, 'publish');
  assert.deepEqual(await violations(page), [], 'publish');
  await id('publish-now').click();
  await id('publish').waitFor({ state: 'detached', timeout: 20_000 });
  await id('show-published').click();
  await eventually('the revision is shown', async () => (await text(id('show-published'))).includes('rev 1'));
  await id('latitude').waitFor();
  const shown = (await text(id('latitude'))).replace(/[^\d.]/g, '');
  const answer = await (await flown.fetch('/api/v1/anchors')).json();
  const latitudes = answer.features.map((f) => f.geometry.coordinates[1].toFixed(9));
  assert.ok(latitudes.includes(shown), `${shown} is none of ${latitudes}`);
  for (const theme of ['light', 'dark', 'sun']) {
    while ((await page.locator('html').getAttribute('data-theme')) !== theme) await id('theme').click();
    assert.deepEqual(await violations(page), [], `anchors, ${theme}`);
    await picture(page, `anchors-${theme}`);
  }
  assert.deepEqual([...seen.hosts], [new URL(flown.url).host]);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

for (const [size, width, height] of sizes)
  test(`everything is reached by the keyboard, and letters stay letters in a field, ${size}`, async () => {
    const { page, id } = await openPage(browser, flown, { width, height });
    await id('live').waitFor();
    await page.keyboard.press('3');
    await id('anchors').waitFor();
    await page.keyboard.press('/');
    await page.keyboard.type('13t');
    assert.equal(await id('filter').inputValue(), '13t');
    assert.equal(await page.locator('html').getAttribute('data-theme'), 'light');
    await page.keyboard.press('Escape');
    await id('filter').fill('');
    await page.keyboard.press('Escape');
    await page.keyboard.press(']');
    const first = await text(id('anchor-detail').locator('h2'));
    await page.keyboard.press(']');
    assert.notEqual(await text(id('anchor-detail').locator('h2')), first);
    await page.keyboard.press('?');
    await id('help').waitFor();
    await page.keyboard.press('Escape');
    await id('help').waitFor({ state: 'detached' });
    await page.keyboard.press('t');
    assert.equal(await page.locator('html').getAttribute('data-theme'), 'dark');
    await page.close();
  });

test('a server that goes silent is late, then lost with an alarm while a flight runs, and resumes without doubles', async () => {
  const server = await startServer({ auth: 'off' });
  const playing = replay(server, 1);
  try {
    const { page, id } = await openPage(browser, server);
    await eventually('ranges arrive', async () => (await id('range-list').locator('tbody tr').count()) >= 1, 20_000);
    process.kill(server.pid, 'SIGSTOP');
    try {
      await eventually('LATE', async () => (await text(id('status-link'))).includes('LATE'), 5000);
      await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 6000);
      await id('alarm-link.lost').waitFor({ timeout: 5000 });
      assert.match(await text(page.getByRole('alert')), /Link lost/);
      assert.deepEqual(await violations(page), [], 'link lost');
      await picture(page, 'link-lost');
    } finally {
      process.kill(server.pid, 'SIGCONT');
    }
    await eventually('LIVE again', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
    await id('toast').waitFor({ timeout: 10_000 });
    assert.match(await text(id('toast')), /recovered|Resynchronised/);
    await id('alarm-link.lost').waitFor({ state: 'detached' });

    playing.stop();
    await playing.ended;
    await server.kill();
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 10_000);
    await server.start();
    await eventually('LIVE after the restart', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
    // Another life of the server: the flight comes from its database, once.
    await id('progress').waitFor({ timeout: 10_000 });
    assert.equal(await id('mission-picker').count(), 0);
    await page.close();
  } finally {
    playing.stop();
    await playing.ended;
    await server.dispose();
  }
});

test('a tablet upright, a wide screen and text of 200 % lose nothing', async () => {
  for (const [width, height, zoom] of [
    [768, 1024, 1],
    [2560, 1440, 1],
    [1280, 1024, 2],
  ]) {
    const { page, id } = await openPage(browser, flown, { width: width / zoom, height: height / zoom });
    await id('live').waitFor();
    for (const name of ['status-link', 'status-alarms', 'theme', 'nav-anchors']) {
      const box = await id(name).boundingBox();
      assert.ok(
        box && box.x >= -1 && box.x + box.width <= width / zoom + 1 && box.width >= 24 && box.height >= 24,
        `${name} at ${width}x${height}/${zoom}: ${JSON.stringify(box)}`,
      );
    }
    assert.ok(
      await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth + 1),
      `no sideways scrolling at ${width}/${zoom}`,
    );
    await picture(page, `live-${width}-${zoom}`);
    await page.close();
  }
});
