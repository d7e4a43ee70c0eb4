// Replay of a real flight: it says REPLAY at every moment and never LIVE, offers no command, and its events are stepped through by the keys.
// The simulated aircraft flies it first, so that what is replayed has the events of a procedure.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually } from './server.mjs';
import { serverWithAircraft, startFlight } from './simulated_aircraft.mjs';

let server, aircraft, browser, mission;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  ({ server, aircraft, mission } = await serverWithAircraft());
  await startFlight(server, mission);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

/** Opened, read to its end, at its first moment. */
async function opened(options = {}) {
  const { page, seen, id } = await openPage(browser, server, { hash: `#/replay/${mission}`, ...options });
  await eventually('the flight is read', async () => /\d/.test(await text(id('replay-time'))), 30_000);
  return { page, seen, id };
}
/** The first moment of the recording. */
async function first_us() {
  const path = `mission=${mission}&limit=1`,
    firsts = await Promise.all([get(`/api/v1/fixes?${path}`), get(`/api/v1/ranges?${path}`)]);
  return Math.min(...firsts.map(({ items: [row] }) => row.t_us));
}
const seconds = (clock) => clock.split(':').reduce((s, part) => 60 * s + Number(part), 0);

test('. and , step through the events in the order of the flight, each at its own moment', async () => {
  const { page, seen, id } = await opened();
  const place = async () =>
    (/(\d+) of (\d+)/.exec(await text(id('replay-events').locator('.meta'))) ?? []).slice(1).map(Number);
  const [at_first, n] = await place();
  assert.ok(n >= 4, `${n} events of the flight`);
  const from_us = await first_us(),
    { items } = await get(`/api/v1/missions/${mission}/events?limit=1000`),
    moments = [...new Set(items.map((e) => e.t_us))].sort((a, b) => a - b).filter((t_us) => t_us > from_us);
  const current = async () => ({
    time_s: seconds(await text(id('replay-time'))),
    words: (await text(id('replay-events').locator('[aria-current="step"] > span'))).replace(/^\w*: /, ''),
    place: (await place())[0],
  });
  const forth = [];
  let last = at_first;
  while (last < n) {
    await page.keyboard.press('.');
    await eventually('the next event', async () => (await place())[0] > last, 5000);
    forth.push(await current());
    last = forth.at(-1).place;
    assert.match(await text(id('status-link')), /REPLAY/);
    for (const tile of ['link', 'rtk', 'uwb', 'drone', 'rec'])
      assert.doesNotMatch(await text(id(`status-${tile}`)), /LIVE/, `${tile} at event ${last}`);
  }
  assert.ok(forth.length >= 4, `${forth.length} steps`);
  for (const [i, { words, time_s }] of forth.entries()) {
    const at_s = (moments[i] - from_us) / 1e6; // tenths are shown
    assert.ok(time_s <= at_s + 0.01 && time_s > at_s - 0.11, `event ${i + 1} at ${time_s} s, by the API ${at_s} s`);
    assert.ok(
      items.some((e) => e.t_us === moments[i] && e.text === words),
      `the event of that moment: ${words}`,
    );
  }
  // The rows of the list are those of Live: with the mark of their level.
  const rows = id('replay-events').locator('li');
  assert.equal(await rows.locator('> .mark').count(), await rows.count());
  await picture(page, 'replay-last-event');
  const back = [];
  while (back.length < forth.length - 1) {
    const [here] = await place();
    await page.keyboard.press(',');
    await eventually('the event before', async () => (await place())[0] < here, 5000);
    back.push(await current());
  }
  assert.deepEqual(back.reverse(), forth.slice(0, -1), 'the same events on the way back');
  assert.deepEqual(await violations(page, { sizes: true }), []);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('nothing of the running flight is shown as a replay while the stored one is being read', async () => {
  const page = await browser.context.newPage();
  let go_on;
  const held = new Promise((done) => (go_on = done));
  await page.route('**/api/v1/fixes*', async (route) => {
    await held;
    await route.continue();
  });
  await page.goto(`${server.url}/#/replay/${mission}`);
  await page.getByText('The flight is being read').waitFor({ timeout: 20_000 });
  await eventually(
    'the strip says REPLAY',
    async () => /REPLAY/.test(await text(page.getByTestId('status-link'))),
    5000,
  );
  assert.equal(await page.getByTestId('range-list').count(), 0, 'no range of now');
  for (const tile of ['rtk', 'drone'])
    assert.doesNotMatch(await text(page.getByTestId(`status-${tile}`)), /FIX$|\d/, tile);
  assert.match(
    await text(page.getByTestId('status-uwb')),
    /none|UWB\s*0\/\d+$/,
    'no anchor is in range of what is not read yet',
  );
  go_on();
  await page.getByTestId('range-list').waitFor({ timeout: 20_000 });
  await page.close();
});

test('a flight without measurements says so, and nothing of the flight played before is left', async () => {
  const none = await (
    await server.fetch('/api/v1/missions', {
      json: {
        name: 'nothing came',
        frame: 'wgs84',
        track_point: 'gnss_antenna',
        tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
      },
    })
  ).json();
  const { page, id } = await opened();
  await id('play').click();
  await page.getByLabel('Flight to replay').selectOption(none.id);
  await page.getByText('This flight has no measurements: there is nothing to play.').waitFor({ timeout: 20_000 });
  assert.ok(await id('play').isDisabled());
  assert.equal(await id('range-list').count(), 0, 'no range of the other flight');
  assert.equal(await text(id('replay-time')), '–');
  await page.getByLabel('Flight to replay').selectOption(mission);
  await eventually('the first is played again', () => id('range-list').isVisible(), 20_000);
  await page.close();
});

test('while it plays, jumps and ends the strip says REPLAY; no command is there, and alarms stay those of now', async () => {
  const { page, id } = await opened({ width: 768, height: 1024 });
  const said = [];
  const look = async () => said.push(await text(id('status-link')));
  await id('speed').selectOption('4');
  await page.evaluate(() => document.activeElement?.blur());
  await page.keyboard.press(' ');
  await eventually('it plays', async () => seconds(await text(id('replay-time'))) > 2, 10_000);
  for (let i = 0; i < 10; i++) {
    await look();
    await page.evaluate(() => new Promise((done) => setTimeout(done, 100)));
  }
  await page.keyboard.press(' ');
  const paused = await text(id('replay-time'));
  await page.keyboard.press('ArrowRight');
  await eventually('a tenth of a second', async () => seconds(await text(id('replay-time'))) > seconds(paused), 5000);
  await look();
  await id('scrubber').press('End');
  await look();
  for (const one of said) assert.match(one, /REPLAY/);
  for (const one of said) assert.doesNotMatch(one, /LIVE/);
  assert.equal(
    await page.locator('[data-testid^="cmd-"], [data-testid="take-control"], [data-testid="flight-bar"]').count(),
    0,
  );
  assert.ok(await id('alarm-bar').isVisible());
  await id('nav-live').click();
  await eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 10_000);
  await page.close();
});

test('after a restart the replay still shows procedure, its reason and the point it flew to', async () => {
  const before = (await get(`/api/v1/missions/${mission}/events?limit=1000`)).items,
    sent = before.filter((e) => e.place);
  assert.ok(sent.length > 0, 'the aircraft was sent somewhere');
  await server.restart();
  const after_it = (await get(`/api/v1/missions/${mission}/events?limit=1000`)).items,
    kept = new Map(after_it.map((e) => [e.id, e]));
  for (const event of before) assert.deepEqual(kept.get(event.id), event, 'as it was');
  const { page, seen, id } = await opened();
  await id('scrubber').press('End');
  await id('procedure').waitFor({ timeout: 10_000 });
  assert.match(await text(id('procedure')), /\w{4}/);
  const log = (await get(`/api/v1/missions/${mission}/procedure-log?limit=1000`)).items,
    decision = log.find((e) => e.topic === 'mission.grid' && e.data.candidates.length > 1);
  assert.ok(decision, 'a decision of the flight was kept');
  await id('scrubber').fill(String(Math.ceil((decision.t_us - (await first_us())) / 1e4) * 1e4 + 20_000));
  await id('next-point').waitFor({ timeout: 5000 });
  await eventually(
    'the candidates of that decision',
    async () => (await text(id('next-point'))).includes(`${decision.data.candidates.length} candidates`),
    5000,
  );
  assert.ok((await id('replay-events').locator('li').count()) > 0, 'events are listed');
  await picture(page, 'replay-after-restart');
  assert.deepEqual(seen.errors, []);
  await page.close();
});
