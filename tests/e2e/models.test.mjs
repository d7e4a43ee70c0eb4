// F10, at every size: a run that was started by curl is seen to progress, is canceled; a better model passes the gate, a worse one only with a reason.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { fullServer, sizes } from './full_server.mjs';
import { endless } from './learning_bodies.mjs';
import { eventually } from './server.mjs';

let browser, server, training;
const get = async (path) => (await server.fetch(path)).json();
const post = async (path, json, headers = {}) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};
const last = (path) => path.split('/').pop();
const active = async () => (await get('/api/v1/models/active')).models?.nlos_id?.id;

before(async () => {
  ({ server, training } = await fullServer());
  browser = await openBrowser({ hasTouch: true });
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

for (const [size, width, height] of sizes)
  test(`a run progresses on the screen and is canceled there, ${size}`, async () => {
    const { page, seen, id } = await openPage(browser, server, { width, height, hash: '#/models' }),
      press = (what) => (width < 1000 ? what.tap() : what.click());
    await id('runs').waitFor({ timeout: 20_000 });
    const { id: run } = await post('/api/v1/training-runs', endless),
      row = id(`run-${run}`),
      shown = async () => (await text(row)).match(/search (\d+) %/)?.[1];
    const first = await eventually('the search is shown, without a reload', shown, 60_000);
    const later = await eventually(
      'and goes on',
      async () => {
        const percent = await shown();
        return percent !== first && percent;
      },
      60_000,
    );
    const { progress } = await get(`/api/v1/training-runs/${run}`);
    assert.ok(Number(later) > Number(first), `${first} %, then ${later} %`);
    assert.ok(Number(later) <= Math.ceil(100 * progress.fraction), `${later} % shown, ${progress.fraction} in the API`);
    await page.evaluate((r) => (location.hash = `#/models/runs/${r}`), run);
    await id('cancel').waitFor();
    await picture(page, `models-running-${size}`);
    await press(id('cancel'));
    await eventually('it reads CANCELED', async () => (await text(row)).includes('CANCELED'), 20_000);
    assert.equal((await get(`/api/v1/training-runs/${run}`)).state, 'canceled');
    assert.equal(await id('cancel').count(), 0);
    assert.equal(await id('promote').isDisabled(), true, 'there is nothing to promote');
    assert.deepEqual(await violations(page), []);
    assert.deepEqual(seen.errors, []);
    await page.close();
  });

test('a worse model is promoted only with a reason, which is in the audit log', async () => {
  const good = last(training.model);
  await post(`/api/v1/models/${good}/promote`, { reason: 'the first of this building' });
  // One feature that says little of what stands between.
  const poor = await post(
    '/api/v1/training-runs',
    { task: 'nlos_id', dataset: 'set', methods: ['logistic'], features: ['range_m'], cv: { folds: 4, seed: 7 } },
    { prefer: 'wait=200' },
  );
  const gate = await get(`/api/v1/models/${last(poor.model)}/gate`);
  assert.equal(gate.passed, false, 'the test is of a model that the gate holds back');
  const { page, id } = await openPage(browser, server, { hash: `#/models/runs/${poor.id}` });
  await id('promote').click();
  const dialog = id('promote-dialog');
  await dialog.getByText('GATE NOT PASSED').waitFor();
  for (const check of gate.checks) await dialog.getByRole('row', { name: check.name.replaceAll('_', ' ') }).waitFor();
  assert.equal(await id('promote-now').isDisabled(), true);
  await id('reason').fill('   ');
  assert.equal(await id('promote-now').isDisabled(), true, 'blanks are no reason');
  await id('reason').fill('to compare on a flight');
  await picture(page, 'models-gate');
  await id('promote-now').click();
  await dialog.waitFor({ state: 'detached' });
  assert.equal(await active(), last(poor.model));
  const { items } = await get('/api/v1/audit?limit=20');
  assert.ok(
    items.some((entry) => JSON.stringify(entry).includes('to compare on a flight')),
    JSON.stringify(items[0]),
  );
  // The better one passes by itself.
  await page.evaluate((r) => (location.hash = `#/models/runs/${r}`), training.id);
  await page.getByTestId(`run-${training.id}`).and(page.locator('.sel')).waitFor();
  await id('promote').click();
  await dialog.getByText('GATE PASSED').waitFor();
  assert.equal(await id('reason').count(), 0);
  await id('promote-now').click();
  await dialog.waitFor({ state: 'detached' });
  assert.equal(await active(), good);
  await page.close();
});
