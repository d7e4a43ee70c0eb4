// From an empty database to the first anchors, without a shell: the demonstration that the server flies, a flight dropped as files with
// columns of other names, and the guide. Real binary, no internet.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord start '));
let browser, server;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer({ auth: 'off' });
  const made = await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', join(folder, 'flight')]);
  assert.equal(made.code, 0, made.stderr);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('every view of an empty server says what to do next, and on a phone the rail stays at the bottom', async () => {
  const { page, seen, id } = await openPage(browser, server, { width: 390, height: 844 });
  await id('first-run').waitFor();
  for (const [view, next] of [
    ['plan', page.getByRole('button', { name: 'Draw here' })],
    ['anchors', page.getByRole('link', { name: 'Import a flight' })],
    ['measurements', page.getByRole('link', { name: 'Import a flight' })],
    ['models', page.getByRole('link', { name: 'Go to Measure' })],
    ['replay', page.getByRole('link', { name: 'Import a flight' })],
    ['system', page.getByRole('button', { name: 'Add a device' })],
  ]) {
    await id(`nav-${view}`).click();
    await next.waitFor();
    const rail = await page.getByRole('navigation', { name: 'Views' }).boundingBox();
    assert.ok(Math.abs(rail.y + rail.height - 844) < 2, `${view}: the rail ends at ${rail.y + rail.height}`);
    assert.equal(await page.getByRole('heading', { level: 1 }).count(), 1, view);
    await picture(page, `empty-${view}`);
  }
  assert.doesNotMatch(await text(page.getByRole('main')), /under this address/);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('an empty server offers three ways; the demonstration flies at one press, and its anchors converge', async () => {
  const { page, seen, id } = await openPage(browser, server);
  await id('first-run').waitFor();
  for (const way of ['fly-demonstration', 'connect-devices', 'import-flight'])
    assert.equal(await id(way).count(), 1, way);
  assert.deepEqual(await violations(page, { sizes: true }), []);
  await picture(page, 'first-run-three-ways-light');
  await id('fly-demonstration').click();
  await id('progress').waitFor({ timeout: 30_000 });
  await eventually('ranges arrive', async () => (await id('range-list').locator('tbody tr').count()) >= 3, 30_000);
  const again = await server.fetch('/api/v1/demonstration', { json: { speed: 4 } });
  assert.equal(again.status, 409, 'one at a time');
  assert.equal((await server.fetch('/api/v1/demonstration', { json: { speed: 0 } })).status, 422);
  await eventually(
    'three anchors converge',
    async () => Number(/(\d+) of \d+/.exec(await text(id('progress').locator('dd')))?.[1]) >= 3,
    90_000,
  );
  await picture(page, 'demonstration-light');
  const [mission] = (await get('/api/v1/missions')).items;
  assert.equal(mission.name, 'Demonstration');
  // It ends by itself: a finished flight, as any other.
  await eventually(
    'it is finished',
    async () => (await get(`/api/v1/missions/${mission.id}`)).state === 'finished',
    90_000,
    500,
  );
  assert.deepEqual(
    seen.errors.filter((e) => !/409|422/.test(e)),
    [],
  );
  await page.close();
});

test('a flight whose columns have other names is imported by saying what they are', async () => {
  // What somebody else's logger might write: other names, millimetres, no flight.json.
  const rename = (name, names, change = (cells) => cells) => {
    const [head, ...rows] = readFileSync(join(folder, 'flight', name), 'utf8')
        .trim()
        .split('\n'),
      columns = head.split(',');
    const keep = Object.keys(names).map((k) => columns.indexOf(k));
    const out = [Object.values(names).join(';')];
    for (const row of rows) out.push(change(keep.map((i) => row.split(',')[i])).join(';'));
    const path = join(folder, `other ${name}`);
    writeFileSync(path, `${out.join('\n')}\n`);
    return path;
  };
  const track = rename(
    'track.csv',
    { t_s: 'moment', lat_deg: 'phi', lon_deg: 'lambda', alt_m: 'ell_h', fix: 'quality' },
    (cells) => [...cells.slice(0, 4), { fixed: '4', float: '5', single: '1' }[cells[4]]],
  );
  const ranges = rename('ranges.csv', { t_s: 'moment', anchor_id: 'who', range_m: 'dist_mm' }, ([t, a, r]) => [
    t,
    a,
    String(Math.round(Number(r) * 1000)),
  ]);
  const { page, seen, id } = await openPage(browser, server, { hash: '#/import' });
  await id('dropzone').waitFor();
  await page.getByLabel('Flight files').setInputFiles(track);
  await id('mapping').waitFor();
  assert.equal(await id('import-send').isEnabled(), false, 'a track alone is no flight');
  await page.getByRole('button', { name: 'Other files' }).click();
  await page.getByLabel('Flight files').setInputFiles([track, ranges]);
  await id('mapping').waitFor();
  assert.equal(await id('import-send').isEnabled(), false);
  assert.deepEqual(await violations(page), []);
  await picture(page, 'import-mapping-light');
  const [of_track, of_ranges] = [id('mapping').locator('table').nth(0), id('mapping').locator('table').nth(1)];
  for (const [where, field, column] of [
    [of_track, 'time', 'moment'],
    [of_track, 'lat', 'phi'],
    [of_track, 'lon', 'lambda'],
    [of_track, 'height', 'ell_h'],
    [of_ranges, 'time', 'moment'],
    [of_ranges, 'anchor', 'who'],
  ])
    await where.getByTestId(`column-of-${field}`).selectOption(column);
  await id('import-tag').fill('0x6e01');
  assert.equal(await id('import-send').isEnabled(), false, 'nobody said what 4 means');
  await id('fix-numbers').selectOption('nmea');
  for (const [field, value] of [
    ['Forward, m', '0.12'],
    ['Up, m', '-0.28'],
  ]) {
    await page.getByLabel(field).fill(value);
    await page.getByLabel(field).blur();
  }
  await id('import-arm-sigma').fill('-1');
  assert.equal(await id('import-send').isEnabled(), false);
  await id('import-arm-sigma').fill('0,02');
  await id('import-name').fill('Brought along');
  await id('import-send').click();
  await id('toast')
    .getByText(/rows are in/)
    .waitFor({ timeout: 60_000 });
  const mission = (await get('/api/v1/missions')).items.find((m) => m.name === 'Brought along');
  assert.equal(mission.state, 'finished');
  assert.deepEqual(mission.tags, [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.12, 0, -0.28] }]);
  assert.equal(mission.lever_arm_sigma_m, 0.02);
  // Row by row what the file says.
  const { items } = await get(`/api/v1/ranges?mission=${mission.id}&limit=5`),
    first = readFileSync(ranges, 'utf8')
      .split('\n')
      .slice(1, 400)
      .map((l) => l.split(';')),
    asked = items[0],
    same = first.filter(([, who, mm]) => who === asked.anchor && Math.abs(Number(mm) / 1000 - asked.distance_m) < 1e-9);
  assert.ok(same.length >= 1, JSON.stringify(asked));
  assert.equal(mission.n_fixes, readFileSync(track, 'utf8').trim().split('\n').length - 1);
  // What is no flight is refused with the reason.
  await page.goto(`${server.url}/?theme=light#/import`);
  const wrong = join(folder, 'notes.csv');
  writeFileSync(wrong, '1,2\n3,4\n');
  await page.getByLabel('Flight files').setInputFiles(wrong);
  await id('import-problem').getByText('a header line with names is needed').waitFor();
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a flight out of a German spreadsheet, its anchors with names, gives the anchors of the same flight folder', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/import' }),
    take = async (...files) => {
      await page.goto(`${server.url}/?theme=light#/import`);
      await id('dropzone').waitFor();
      await page.getByLabel('Flight files').setInputFiles(files);
      await id('mapping').waitFor();
    },
    sent = async (name) => {
      await id('import-name').fill(name);
      await id('import-send').click();
      // Names of anchors are kept after the flight is finished; then the page goes on.
      await page.waitForURL(/#\/anchors/, { timeout: 60_000 });
      await eventually(
        `${name} is in`,
        async () => (await get('/api/v1/missions')).items.some((m) => m.name === name && m.state === 'finished'),
        60_000,
      );
      const { id: mission } = (await get('/api/v1/missions')).items.find((m) => m.name === name);
      const { id: made } = await (
        await server.fetch('/api/v1/calibrations', { json: { missions: [mission] }, headers: { prefer: 'wait=60' } })
      ).json();
      return (await get(`/api/v1/calibrations/${made}`)).anchors;
    },
    of = (name) => {
      const [head, ...rows] = readFileSync(join(folder, 'flight', name), 'utf8')
        .trim()
        .split('\n');
      return rows.map((row) => Object.fromEntries(row.split(',').map((cell, i) => [head.split(',')[i], cell])));
    },
    epoch_ms = Date.parse(JSON.parse(readFileSync(join(folder, 'flight', 'flight.json'), 'utf8')).epoch_utc),
    moment = (t_s) =>
      `${new Date(epoch_ms + 1000 * Math.floor(Number(t_s))).toISOString().slice(0, 19).replace('T', ' ')},${(Number(t_s) % 1).toFixed(6).slice(2)}`,
    comma = (text) => text.replace('.', ','),
    sheet = (name, heads, rows) => {
      const path = join(folder, name);
      writeFileSync(path, `\ufeff${[heads, ...rows].map((cells) => cells.join(';')).join('\r\n')}\r\n`);
      return path;
    };
  await take(...['flight.json', 'track.csv', 'ranges.csv'].map((f) => join(folder, 'flight', f)));
  const before = await sent('As a folder');
  const track = sheet(
      'GNSS.csv',
      ['Zeit', 'Breite', 'Länge', 'Höhe', 'Qualität', 'hAcc', 'vAcc', 'qx', 'qy', 'qz', 'qw'],
      of('track.csv').map((r) => [
        moment(r.t_s),
        comma(r.lat_deg),
        comma(r.lon_deg),
        comma(r.alt_m),
        { fixed: 'RTK fixed', float: 'RTK float' }[r.fix] ?? r.fix,
        ...['sd_h_m', 'sd_v_m', 'qx', 'qy', 'qz', 'qw'].map((c) => comma(r[c])),
      ]),
    ),
    ranges = sheet(
      'Abstand.csv',
      ['Zeit', 'Anker', 'Abstand'],
      of('ranges.csv').map((r) => [moment(r.t_s), `Säule ${r.anchor_id}`, comma(r.range_m)]),
    );
  await take(track, ranges);
  await id('mapping')
    .locator('details')
    .first()
    .evaluate((d) => (d.open = true));
  await id('column-of-fix').selectOption('Qualität');
  assert.equal(await id('import-send').isEnabled(), false, 'nothing says what Höhe is above');
  await id('import-heights-above').selectOption('ellipsoidal');
  await id('import-tag').fill('0x6e01');
  for (const [field, value] of [
    ['Forward, m', '0,12'],
    ['Up, m', '-0,28'],
  ]) {
    await page.getByLabel(field).fill(value);
    await page.getByLabel(field).blur();
  }
  await picture(page, 'import-spreadsheet-light');
  const after = await sent('As a spreadsheet');
  assert.equal(after.length, before.length);
  const names = new Map(
    await Promise.all(
      after.map(async (a) => [(await get(`/api/v1/anchors/${a.network_id}`)).properties.name, a.enu_m]),
    ),
  );
  for (const { network_id, enu_m } of before) {
    const same = names.get(`Säule ${network_id}`);
    assert.ok(same, `${network_id}: ${[...names.keys()]}`);
    assert.ok(Math.hypot(...same.map((x, i) => x - enu_m[i])) < 0.02, `${network_id}: ${same} beside ${enu_m}`);
  }
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('the guide is there offline: every page opens, and ? opens the one for what is on the screen', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/guide' });
  await id('guide').waitFor();
  const links = await id('guide').locator('nav a').all();
  assert.ok(links.length >= 12);
  for (const link of links) {
    const title = await link.textContent();
    await link.click();
    await page.getByRole('heading', { level: 1, name: title }).waitFor();
  }
  assert.deepEqual(await violations(page), []);
  await picture(page, 'guide-light');
  for (const [view, title] of [
    ['plan', 'Plan'],
    ['anchors', 'Anchors'],
    ['system', 'System'],
  ]) {
    await page.goto(`${server.url}/?theme=light#/${view}`);
    await id(view).waitFor();
    await page.keyboard.press('?');
    await id('help-page').getByRole('heading', { name: title }).waitFor();
    assert.deepEqual(await violations(page), []);
    await page.keyboard.press('Escape');
    await id('help').waitFor({ state: 'detached' });
  }
  // Of a dialog or part that is open, not of the view behind it; closing it leaves what was open.
  const part = async (title) => {
    await page.keyboard.press('?');
    await id('help-page').getByRole('heading', { name: title }).waitFor();
    await page.keyboard.press('Escape');
    await id('help').waitFor({ state: 'detached' });
  };
  await page.goto(`${server.url}/?theme=light#/system/connect`);
  await id('connect-steps').waitFor();
  await part('Connect the devices');
  await page.goto(`${server.url}/?theme=light#/plan`);
  await id('open-floor-plan').click();
  await id('floor-plan').waitFor();
  await part('Floor plans');
  await page.keyboard.press('Escape');
  await id('status-rtk').click();
  await part('The status strip');
  await page.keyboard.press('Escape');
  await page.goto(`${server.url}/?theme=light#/guide/base`);
  await id('guide').waitFor();
  await part('Base station and NTRIP');
  assert.deepEqual([...seen.hosts], [new URL(server.url).host]);
  assert.deepEqual(seen.errors, []);
  await page.close();
});
