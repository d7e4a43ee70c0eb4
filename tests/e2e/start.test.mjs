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
  const track = rename('track.csv', {
    t_s: 'moment',
    lat_deg: 'phi',
    lon_deg: 'lambda',
    alt_m: 'ell_h',
    fix: 'quality',
  });
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
  await id('import-problem').getByText('a header line of names is needed').waitFor();
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
  assert.deepEqual([...seen.hosts], [new URL(server.url).host]);
  assert.deepEqual(seen.errors, []);
  await page.close();
});
