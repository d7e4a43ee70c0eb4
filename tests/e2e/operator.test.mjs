// What an operator must not misread: a lost link, a slow one, and numbers of a flight that are those of the server.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text, violations } from './browser.mjs';
import { sizes } from './full_server.mjs';
import { binary, eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord e2e ')),
  flight = join(folder, 'flight');
let browser, server, playing;

before(async () => {
  const made = await run(['simulate', 'flight', '--seed', '7', '--duration', '120', '--out', flight]);
  assert.equal(made.code, 0, made.stderr);
  browser = await openBrowser();
  server = await startServer({ auth: 'off' });
  playing = spawn(binary, ['replay', flight, '--url', server.url, '--speed', '1'], { stdio: 'ignore' });
});
after(async () => {
  playing?.kill('SIGTERM');
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** Until the page has fetched its other views, for the time without a link. */
const views_loaded = (page) =>
  eventually(
    'every view is here',
    () =>
      page.evaluate(
        (names) => names.every((n) => performance.getEntriesByType('resource').some((r) => r.name.includes(`/${n}-`))),
        ['replay', 'system', 'plan', 'measurements', 'models'],
      ),
    30_000,
    200,
  );
const live = (id) => eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
/** Values of the view that are drawn as if they were current. */
const unstruck = (page) =>
  page.evaluate(() => {
    const struck = (el) => {
      for (let e = el; e && e !== document.body; e = e.parentElement)
        if (getComputedStyle(e).textDecorationLine.includes('line-through')) return true;
      return false;
    };
    // Sentences with a number too, but for names, limits, scales and the ages themselves.
    const fixed =
        'button, select, label, dt, th, h2, h3, kbd, code, figcaption, .flightname, .sr, .age, .now, .scalebar, .elevbar, .mapfoot, svg',
      sentences = [],
      texts = document.createTreeWalker(document.querySelector('main'), NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) {
      const el = texts.currentNode.parentElement;
      if (/\d/.test(texts.currentNode.data) && !el.closest(fixed) && el.checkVisibility()) sentences.push(el);
    }
    return [...document.querySelectorAll('main :is(dd, td)')]
      .filter(
        (el) => /\d/.test(el.textContent) && !el.querySelector('button, input, select, a') && el.checkVisibility(),
      )
      .concat([...document.querySelectorAll('main .chip')].filter((el) => el.checkVisibility() && !el.closest('.now')))
      .concat(sentences)
      .filter((el) => ![el, ...el.querySelectorAll('*')].some(struck))
      .map((el) => `${el.closest('[data-testid]')?.dataset.testid}: ${el.textContent.trim()}`);
  });

test('with the link lost every value is struck and aged, nothing is assessed without data, and what came back is told', async () => {
  const { page, id } = await openPage(browser, server);
  await eventually('ranges arrive', async () => (await id('range-list').locator('tbody tr').count()) >= 2, 20_000);
  await id('anchor-card').waitFor({ timeout: 40_000 });
  await views_loaded(page);
  process.kill(server.pid, 'SIGSTOP');
  try {
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 12_000);
    for (const view of ['live', 'anchors', 'system']) {
      await id(`nav-${view}`).click();
      await eventually('the age of the view', async () => /\d+ s old/.test(await text(id('last-known'))), 5000);
      await eventually(
        `every value of ${view} is struck: ${await unstruck(page)}`,
        async () => (await unstruck(page)).length === 0,
        3000,
      );
      await picture(page, `lost-${view}`);
    }
    assert.doesNotMatch(await text(id('alarm-bar')), /tag and its cable/);
    assert.deepEqual(await violations(page, { sizes: true }), []);
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await id('toast').waitFor({ timeout: 20_000 });
  assert.match(
    await text(id('toast')),
    /^Link back after \d+ s.*(recovered messages|Resynchronised|Nothing was missed)/,
  );
  await live(id);
  assert.equal(await id('last-known').count(), 0);
  assert.doesNotMatch(await text(id('alarm-bar')), /tag and its cable/);
  await page.close();
});

test('a view that was not opened before an outage opens after it', async () => {
  const { page, id } = await openPage(browser, server);
  await live(id);
  await page.route('**/assets/*.js', (route) => route.abort());
  await id('nav-models').click();
  await page.getByText('opens as soon as the link is back').waitFor();
  process.kill(server.pid, 'SIGSTOP');
  try {
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 12_000);
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await page.unroute('**/assets/*.js');
  await id('models').waitFor({ timeout: 20_000 });
  await page.close();
});

test('what was loaded while nothing else was to be done opens during an outage', async () => {
  const { page, id } = await openPage(browser, server);
  await live(id);
  await views_loaded(page);
  process.kill(server.pid, 'SIGSTOP');
  try {
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 12_000);
    await id('nav-system').click();
    await id('system').waitFor({ timeout: 5000 });
    // What was not loaded is not said to be empty.
    for (const panel of ['flights', 'base', 'levers', 'access', 'audit'])
      assert.match(await text(id(panel)), /Not loaded: no connection to the server/, panel);
    assert.doesNotMatch(
      await text(id('system')),
      /No flight is stored|There is no valid token|there is none yet|No site yet/,
    );
    await id('nav-plan').click();
    await eventually('plan', async () => /Not loaded: no connection/.test(await text(id('plan'))), 5000);
    assert.equal(await id('where').count(), 0);
    await id('nav-system').click();
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await eventually(
    'the flights are loaded when the link is back',
    async () => (await id('flights').locator('tbody tr').count()) > 0,
    20_000,
  );
  await eventually('nothing is left out', async () => (await id('not-loaded').count()) === 0, 10_000);
  await page.close();
});

test('every address that names something unknown says so, and what to do; none shows another thing in silence', async () => {
  const gone = '00000000-0000-4000-8000-000000000000',
    { page, seen, id } = await openPage(browser, server, { hash: '#/live' });
  await live(id);
  for (const [hash, what, says, todo] of [
    [`#/plan/${gone}`, 'plan', `No plan ${gone} is stored here.`, 'another plan is shown'],
    [`#/models/runs/${gone}`, 'run', `No training run ${gone} is stored here.`, 'another run is shown'],
    [`#/models/runs/no-id`, 'run', 'No training run no-id is stored here.', 'another run is shown'],
    [`#/replay/${gone}`, 'flight', `No flight ${gone} is stored here.`, 'choose a flight in System'],
    [`#/replay/${gone}?t=3`, 'flight', `No flight ${gone} is stored here.`, 'choose a flight in System'],
    [
      '#/anchors/0xdead',
      'anchor',
      'No anchor 0xdead is published or in range in this flight.',
      'choose one from the table',
    ],
    ['#/anchors/%E0%A4%A', 'anchor', 'No anchor %E0%A4%A is published or in range in this flight.', 'choose one'],
    ['#/nothing', 'page', 'No page #/nothing is in this dashboard.', 'choose a view'],
    [`#/live/${gone}`, 'page', `No page #/live/${gone} is in this dashboard.`, 'choose a view'],
    [`#/models/${gone}`, 'page', `No page #/models/${gone} is in this dashboard.`, 'choose a view'],
    ['#/system/floors', 'page', 'No page #/system/floors is in this dashboard.', 'System is shown'],
    ['#/guide/elsewhere', 'page', 'No page #/guide/elsewhere is in the guide.', 'its first page is shown'],
  ]) {
    await page.evaluate((to) => (location.hash = to), hash);
    await id(`unknown-${what}`).getByText(says, { exact: true }).waitFor({ timeout: 20_000 });
    assert.match(await text(id(`unknown-${what}`)), new RegExp(`Check the address;.*${todo}`), hash);
    await page.evaluate(() => (location.hash = '#/live'));
    await id(`unknown-${what}`).waitFor({ state: 'detached', timeout: 20_000 });
  }
  assert.deepEqual(
    seen.errors.filter((e) => !/40[0-9]|422/.test(e)), // what the server does not know is an answer of it
    [],
  );
  await page.close();
});

test('a link to an anchor that is not known says so; one that is known opens it', async () => {
  const { page, id } = await openPage(browser, server, { hash: '#/anchors/0xdead' });
  await live(id);
  await eventually(
    'it says so',
    async () => /No anchor 0xdead is published or in range/.test(await text(id('unknown-anchor'))),
    10_000,
  );
  assert.equal(await id('anchor-detail').count(), 0);
  assert.deepEqual(await violations(page, { sizes: true }), []);
  const known = await id('anchor-table').locator('tbody th button').last().textContent();
  await page.evaluate((a) => (location.hash = `#/anchors/${a}`), known);
  await eventually('it is opened', async () => (await text(id('anchor-detail').locator('h2'))) === known, 5000);
  await page.evaluate(() => (location.hash = '#/replay/0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f'));
  await id('unknown-flight').waitFor();
  await page.close();
});

test('Escape closes every dialog and the focus goes back; the view is reached without its neighbours', async () => {
  const { page, id } = await openPage(browser, server);
  await live(id);
  await page.keyboard.press('Tab');
  assert.equal(await page.evaluate(() => document.activeElement.dataset.testid), 'skip');
  await page.keyboard.press('Enter');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'main');
  for (const tile of ['link', 'rtk', 'uwb', 'drone', 'rec', 'alarms'])
    await opensByKeys(page, id(`status-${tile}`), page.getByRole('dialog'));
  await opensByKeys(page, id('user'), page.getByRole('dialog'));
  await opensByKeys(page, page.getByRole('button', { name: 'Help' }), id('help'));
  await opensByKeys(page, id('open-checklist'), id('checklist'));
  await id('nav-anchors').click();
  await opensByKeys(page, id('columns'), id('columns-list'));
  await opensByKeys(page, id('compare'), page.getByRole('dialog'));
  await opensByKeys(page, id('review'), id('publish'));
  // Of two that are open Escape closes the newer one.
  await id('review').click();
  await id('publish').waitFor();
  await page.keyboard.press('?');
  await id('help-page').getByRole('heading', { name: 'After landing: review and publish' }).waitFor();
  await page.keyboard.press('Escape');
  await id('help').waitFor({ state: 'detached' });
  assert.equal(await id('publish').count(), 1);
  await page.keyboard.press('Escape');
  await id('publish').waitFor({ state: 'detached' });
  await page.close();
});

test('a replay is of its moment: the strip says REPLAY and its time, never LIVE', async () => {
  await new Promise((done) => (playing.exitCode === null ? playing.once('exit', done) : done()));
  const { page, id } = await openPage(browser, server, { hash: '#/replay' });
  await eventually('the flight is read', async () => /\d/.test(await text(id('replay-time'))), 20_000);
  await eventually('REPLAY', async () => /REPLAY.*00:00:00/.test(await text(id('status-link'))), 5000);
  await id('scrubber').fill('30000000');
  await eventually('its time', async () => /REPLAY.*00:00:30/.test(await text(id('status-link'))), 5000);
  for (const tile of ['link', 'rtk', 'uwb', 'drone', 'rec'])
    assert.doesNotMatch(await text(id(`status-${tile}`)), /LIVE|ended/, tile);
  await picture(page, 'replay-30s');
  assert.deepEqual(await violations(page, { sizes: true }), []);
  await id('nav-live').click();
  await live(id);
  await page.close();
});

test('who may only look sees no tool that he may not use', async () => {
  const closed = await startServer({ auth: 'on' });
  try {
    const { token } = await (
      await closed.fetch('/api/v1/tokens', { json: { name: 'a visitor', roles: ['viewer'] } })
    ).json();
    const { page, id } = await openPage(browser, closed, { hash: '#/plan' });
    await id('token').fill(token);
    await id('sign-in-submit').click();
    await id('sign-in').waitFor({ state: 'detached' });
    for (const [size, width, height] of sizes) {
      await page.setViewportSize({ width, height });
      for (const view of ['plan', 'live', 'anchors', 'measurements', 'models', 'system']) {
        await id(`nav-${view}`).click();
        await id(view === 'live' ? 'first-run' : view)
          .first()
          .waitFor();
        for (const tool of [
          /^(Undo|Import|New|Outline|Generate|Save|Draw here|Expect)$/,
          /Review and publish|Promote|Exclude|Label|Discover|Add a device|Take control/,
        ])
          assert.equal(await page.getByRole('button', { name: tool }).count(), 0, `${size}, ${view}: ${tool}`);
      }
      await id('nav-plan').click();
      await id('plan').waitFor();
      const fields = page.locator('main :is(input, textarea):enabled:not([readonly])').filter({ visible: true });
      assert.equal(await fields.count(), 0, `a plan to look at, ${size}`);
    }
    // A server that ends and starts again knows who is signed in.
    await closed.kill();
    await eventually('LOST', async () => (await text(id('status-link'))).includes('LOST'), 10_000);
    await closed.start();
    await eventually('LIVE after the restart', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
    assert.equal(await id('sign-in').count(), 0);
    await page.close();
    await browser.context.clearCookies();
  } finally {
    await closed.dispose();
  }
});
