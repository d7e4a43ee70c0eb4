// The alarm line keeps its place: whatever comes, grows or goes, an operator's next tap lands where the finger already is. Real server, the
// simulated aircraft in flight; its silence and that of the server are real ones.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, unreadable, violations } from './browser.mjs';
import { eventually } from './server.mjs';
import { serverWithAircraft, startFlight } from './simulated_aircraft.mjs';

const sizes = [
  ['desk', 1440, 900],
  ['laptop', 1024, 768],
  ['tablet', 768, 1024],
  ['phone', 390, 844],
];
let server, aircraft, browser, mission;

before(async () => {
  ({ server, aircraft, mission } = await serverWithAircraft());
  await startFlight(server, mission);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  aircraft?.kill('SIGCONT');
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

/** Where everything is that a finger may be on its way to: of the frame, of the map, and the commands in their order. Whole pixels. */
const places = (page) =>
  page.evaluate(() => {
    const at = {},
      note = (name, element) => {
        const b = element.getBoundingClientRect();
        at[name] = [b.x, b.y + scrollY, b.width, b.height].map(Math.round).join(' ');
      };
    // How far down the view reaches is its content's where the page scrolls as a whole.
    const { x, y, width } = document.querySelector('main').getBoundingClientRect();
    at['the view'] = [x, y + scrollY, width].map(Math.round).join(' ');
    for (const e of document.querySelectorAll('header [data-testid], nav a, nav button'))
      note(e.dataset.testid ?? e.textContent, e);
    for (const e of document.querySelectorAll('main .mapui button')) note(e.ariaLabel, e);
    [...document.querySelectorAll('[data-testid="commands"] > .cmd')].forEach((e, i) => note(`command ${i + 1}`, e));
    return at;
  });
const alarmed = (page) => page.locator('.alarm.first').count();

test('in flight, with control in other hands, every command and value can be read at every size, in sun too', async () => {
  const control = (json) => server.fetch(`/api/v1/missions/${mission}/control`, { json });
  const { lease } = await (await control({ action: 'take' })).json();
  assert.ok(lease);
  for (const theme of ['light', 'sun']) {
    const { page, id } = await openPage(browser, server, { theme });
    await id('take-anyway').waitFor({ timeout: 20_000 });
    for (const [name, width, height] of sizes) {
      await page.setViewportSize({ width, height });
      await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
      assert.deepEqual(await unreadable(page), [], `${theme}, ${name}`);
      const commands = await id('commands').locator('> .cmd').all();
      assert.equal(commands.length, 4, `${theme}, ${name}`);
      for (const command of commands) {
        const box = await command.boundingBox();
        assert.ok(box.width >= 72 && box.height >= 44, `${box.width} x ${box.height} of a command, ${theme}, ${name}`);
      }
      await picture(page, `in-other-hands-${theme}-${name}`);
    }
    await page.close();
  }
  await control({ action: 'release', lease });
});

test('in flight no command, tile or view moves when alarms come, are several, are read, and go', async () => {
  const open = [];
  for (const [name, width, height] of sizes)
    open.push({ name, ...(await openPage(browser, server, { width, height })) });
  for (const { id } of open) await id('cmd-land').waitFor({ timeout: 20_000 });
  // Nobody has control here: Hold alone would take it, the others are dead.
  assert.equal(await open[0].id('cmd-hold').isEnabled(), true);
  for (const name of ['cmd-skip', 'cmd-return', 'cmd-land']) {
    assert.equal(await open[0].id(name).isEnabled(), false, name);
    assert.match(await open[0].id(name).getAttribute('title'), /Nobody has control/, name);
  }
  for (const one of open) {
    await eventually(`no alarm at first, ${one.name}`, async () => !(await alarmed(one.page)), 30_000);
    one.before = await places(one.page);
    assert.ok(one.before['command 4'], `four commands, ${one.name}`);
  }
  const same = async (when) => {
    for (const { name, page, before } of open) assert.deepEqual(await places(page), before, `${name}: ${when}`);
  };
  aircraft.kill('SIGSTOP');
  try {
    for (const { name, page } of open) await eventually(`an alarm, ${name}`, () => alarmed(page), 20_000);
    await same('an alarm stands');
    const [{ id: first }] = open;
    await eventually('several', async () => /\+\d more/.test(await text(first('alarm-more'))), 20_000);
    await same('several stand');
    for (const { page, id } of open) {
      await id('alarm-more').click();
      await page.getByRole('dialog', { name: 'All alarms' }).waitFor();
    }
    await same('the list lies over the page');
  } finally {
    aircraft.kill('SIGCONT'); // before it goes home for want of a link
  }
  for (const { name, page } of open) {
    assert.deepEqual(await violations(page), [], `the list, ${name}`);
    await picture(page, `alarms-${name}`);
    await page.keyboard.press('Escape');
  }
  // On a slow machine the aircraft has gone home meanwhile, which is an alarm of its own: that one may stand.
  await same('the aircraft is back');

  process.kill(server.pid, 'SIGSTOP');
  try {
    for (const { id } of open) await id('alarm-link.lost').waitFor({ timeout: 20_000 });
    await same('the link is lost');
    for (const { name, page } of open) {
      assert.deepEqual(await violations(page), [], `link lost, ${name}`);
      await picture(page, `link-lost-${name}`);
    }
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  for (const { id } of open) await id('alarm-link.lost').waitFor({ state: 'detached', timeout: 20_000 });
  await same('the link is back');
  for (const { page } of open) await page.close();
});

test('in every view the line has its place, at every size, with and without an alarm', async () => {
  const views = ['live', 'plan', 'anchors', 'measurements', 'models', 'replay', 'system', 'guide'],
    { page, id } = await openPage(browser, server),
    measured = [];
  const all = async () => {
    const found = {};
    for (const [name, width, height] of sizes) {
      await page.setViewportSize({ width, height });
      await page.evaluate(() => scrollTo(0, 0));
      const { y, height: tall } = await id('alarm-bar').boundingBox(),
        main = await page.locator('main').boundingBox();
      assert.ok(Math.abs(main.y - y - tall) < 1, `the view begins below the line, ${name}`);
      assert.ok(tall >= 48, `${tall} px for the line, ${name}`);
      found[name] = [y, tall, main.x, main.y, main.width].map(Math.round).join(' ');
    }
    return found;
  };
  for (const view of views) {
    await page.evaluate((v) => (location.hash = `#/${v}`), view);
    await id(view).waitFor({ timeout: 20_000 });
    measured.push(await all());
  }
  for (const [i, found] of measured.entries()) assert.deepEqual(found, measured[0], views[i]);
  process.kill(server.pid, 'SIGSTOP');
  try {
    await id('alarm-link.lost').waitFor({ timeout: 20_000 });
    for (const view of views) {
      await page.evaluate((v) => (location.hash = `#/${v}`), view);
      assert.deepEqual(await all(), measured[0], `${view}, link lost`);
    }
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  await page.close();
});

test('the open list keeps the places of its rows: what is over stays, said to be over', async () => {
  const { page, id } = await openPage(browser, server);
  await id('live').waitFor({ timeout: 20_000 });
  process.kill(server.pid, 'SIGSTOP');
  try {
    await id('alarm-link.lost').waitFor({ timeout: 20_000 });
    await id('alarm-more').click();
    await id('listed-link.lost').getByRole('button', { name: 'Retry now' }).waitFor();
  } finally {
    process.kill(server.pid, 'SIGCONT');
  }
  const before = await id('listed-link.lost').boundingBox();
  await id('listed-link.lost').getByText('over', { exact: true }).waitFor({ timeout: 20_000 });
  const now = await id('listed-link.lost').boundingBox();
  assert.deepEqual([now.x, now.y], [before.x, before.y]);
  await page.keyboard.press('Escape');
  await page.getByRole('dialog').waitFor({ state: 'detached' });
  await page.close();
});
