// A flight of one heading would not show a wrong lever arm: its anchors wait until a person says how well the arm was measured.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord e2e ')),
  flight = join(folder, 'flight');
let browser, server;

before(async () => {
  const made = await run(['simulate', 'flight', '--seed', '7', '--duration', '120', '--out', flight]);
  assert.equal(made.code, 0, made.stderr);
  // As logged by an aircraft that looks east all the time.
  const [head, ...rows] = readFileSync(join(flight, 'track.csv'), 'utf8').trim().split('\n'),
    from = head.split(',').indexOf('qx');
  const east = rows.map((row) => [...row.split(',').slice(0, from), 0, 0, 0, 1].join());
  writeFileSync(join(flight, 'track.csv'), `${[head, ...east].join('\n')}\n`);
  const about = JSON.parse(readFileSync(join(flight, 'flight.json'), 'utf8'));
  about.tags[0].lever_arm_body_m = [0, 0, -0.28];
  writeFileSync(join(flight, 'flight.json'), JSON.stringify(about));
  server = await startServer({ auth: 'off' });
  const imported = await run(['import', 'flight', flight, '--url', server.url]);
  assert.equal(imported.code, 0, imported.stderr);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('anchors are withheld with the reason, and accepted once the sigma of the lever arm is given', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/anchors' });
  await id('review').click();
  await id('draft').waitFor({ timeout: 60_000 });
  const calibrations = async () => (await (await server.fetch('/api/v1/calibrations')).json()).items,
    before_it = (await calibrations()).length;
  const rows = id('draft').locator('tbody tr'),
    n = await rows.count();
  assert.ok(n >= 5, `${n} anchors`);
  for (const row of await rows.all()) assert.match(await text(row), /A wrong lever arm would not show.*0\.30 m/);
  const asked = id('lever-arm-sigma');
  assert.match(await text(asked), new RegExp(`withholds ${n} anchors`));
  const again = asked.getByRole('button', { name: 'Solve again' });
  for (const wrong of ['', '0', '-0.02', 'two']) {
    await asked.getByRole('textbox').fill(wrong);
    assert.equal(await again.isDisabled(), true, wrong);
  }
  assert.deepEqual(await violations(page), []);
  await asked.getByRole('textbox').fill('0,03');
  await picture(page, 'one-heading');
  await again.click();
  await eventually('it was solved again', async () => /measured to 0\.030 m/.test(await text(asked)), 60_000);
  await eventually('what passed may be published', async () => id('publish-now').isEnabled());
  const passed = (await text(id('draft'))).match(/PASSES/g).length;
  assert.ok(passed >= n - 1, `${passed} of ${n}`);
  assert.equal((await calibrations()).length, before_it + 1);
  await eventually('it can be published', async () => (await text(id('publish-now'))).includes(`${passed} of ${n}`));
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a flight that declares the sigma of its lever arm is accepted without being asked, and Review shows what it holds', async () => {
  const about = JSON.parse(readFileSync(join(flight, 'flight.json'), 'utf8'));
  writeFileSync(join(flight, 'flight.json'), JSON.stringify({ ...about, name: 'declared', lever_arm_sigma_m: 0.03 }));
  const solved = await run(['solve', flight, '--format', 'json']);
  assert.equal(solved.code, 0, solved.stderr);
  const [alone] = JSON.parse(solved.stdout).flights;
  assert.equal(alone.shared.lever_arm_sigma_m, 0.03);
  assert.ok(alone.anchors.every((a) => a.gates.every((g) => g.name !== 'unseen_arm')));
  const other = await run(['solve', flight, '--format', 'json', '--lever-arm-sigma', '0.2']);
  assert.equal(JSON.parse(other.stdout).flights[0].shared.lever_arm_sigma_m, 0.2, 'what is asked for comes first');
  const imported = await run(['import', 'flight', flight, '--url', server.url]);
  assert.equal(imported.code, 0, imported.stderr);
  const { page, seen, id } = await openPage(browser, server, { hash: '#/anchors' });
  await id('review').click();
  await id('draft').waitFor({ timeout: 60_000 });
  const n = await id('draft').locator('tbody tr').count(),
    passed = (await text(id('draft'))).match(/PASSES/g).length;
  assert.ok(passed >= n - 1, `${passed} of ${n}`);
  assert.match(await text(id('lever-arm-sigma')), /measured to 0\.030 m, one sigma/);
  assert.equal(await id('lever-arm-sigma').getByRole('textbox').inputValue(), '0.03');
  assert.deepEqual(await violations(page), []);
  await picture(page, 'one-heading-declared');
  // A word of the reviewer comes before that of the flight: what was measured to 3 m makes regions that name it.
  await id('lever-arm-sigma').getByRole('textbox').fill('3');
  await id('lever-arm-sigma').getByRole('button', { name: 'Solve again' }).click();
  await eventually('regions are too wide', async () => /measured to 3\.000 m/.test(await text(id('lever-arm-sigma'))));
  assert.match(
    await text(id('draft')),
    /the largest part of its uncertainty is the lever arm \(\d+ %\), and what would help most: measure the lever arm/,
  );
  assert.deepEqual(seen.errors, []);
  await page.close();
});
