// The views of the desk: measurements, models, facility data, system, replay. Real binary, real rows, real training; numbers on screen against the API's.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text, violations } from './browser.mjs';
import { eventually, root, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord views '));
let browser, server, training;

const post = async (path, json, headers = {}) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer({ auth: 'off' });
  const flight = join(folder, 'flight');
  assert.equal((await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', flight])).code, 0);
  const replayed = await run(['replay', flight, '--url', server.url, '--speed', 'max']);
  assert.equal(replayed.code, 0, replayed.stderr);
  await post('/api/v1/campaigns', { name: 'halls' });
  const csv = readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8');
  const imported = await server.fetch('/api/v1/campaigns/halls/samples', {
    method: 'POST',
    headers: { 'content-type': 'text/csv' },
    body: csv,
  });
  assert.equal(imported.status, 200, await imported.text());
  await post('/api/v1/datasets', {
    name: 'set',
    campaigns: ['halls'],
    aggregation: 'none',
    split: { test: ['room 6'] },
  });
  training = await post(
    '/api/v1/training-runs',
    { task: 'nlos_id', dataset: 'set', methods: ['logistic', 'random_forest'], cv: { folds: 4, seed: 7 } },
    { prefer: 'wait=200' },
  );
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('the confusion on screen is that of the API, and the slider tells what a threshold costs', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/models' });
  await id('confusion').waitFor();
  const { test: held_out } = await get(`/api/v1/training-runs/${training.id}/confusion`);
  const cells = await id('confusion').locator('tbody td b').allTextContents(),
    c = held_out.confusion;
  assert.deepEqual(cells.map(Number), [c.tp, c.fn, c.fp, c.tn]);
  assert.equal(parseFloat(await text(id('fpr'))), Number(((100 * c.fp) / (c.fp + c.tn)).toFixed(1)));
  const { points } = await get(`/api/v1/training-runs/${training.id}/roc`);
  await id('threshold-slider').fill('0.9');
  const near = points.filter((p) => p.threshold >= 0.9).reduce((a, b) => (b.threshold < a.threshold ? b : a));
  await eventually(
    'the slider speaks',
    async () => parseFloat(await text(id('slider-fpr'))) === Number((100 * near.fpr).toFixed(1)),
  );
  assert.deepEqual(await violations(page), []);
  await picture(page, 'models-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('runs ticked in the table stand side by side, with the figures of the API and a warning where they are of different data', async () => {
  await post('/api/v1/datasets', {
    name: 'other set',
    campaigns: ['halls'],
    aggregation: 'none',
    split: { test: ['room 5'] },
  });
  const second = await post(
    '/api/v1/training-runs',
    { task: 'nlos_id', dataset: 'other set', methods: ['logistic'], cv: { folds: 4, seed: 7 } },
    { prefer: 'wait=200' },
  );
  const { page, seen, id } = await openPage(browser, server, { hash: `#/models/runs/${training.id}` });
  await id(`compare-${training.id}`).check();
  await page.getByText('Tick one more run').waitFor();
  await id(`compare-${second.id}`).check();
  const line = id('compare').getByRole('row', { name: /^Accuracy, held-out places/ });
  await line.waitFor();
  const shown = (await line.locator('td').allTextContents()).map(parseFloat);
  const accuracy = await Promise.all(
    [training, second].map(async (r) => (await get(`/api/v1/training-runs/${r.id}`)).test.accuracy),
  );
  assert.deepEqual(
    shown,
    accuracy.map((a) => Number((100 * a).toFixed(1))),
  );
  await id('compare').getByText('Not trained on the same data set').waitFor();
  assert.match(page.url(), new RegExp(`compare=${training.id},${second.id}`));
  assert.deepEqual(await violations(page), []);
  await picture(page, 'compare-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('the plain rules stand beside the learned models, with the rates of the API', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/models' });
  await id('task-rules').click();
  await id('rules').locator('tbody tr').first().waitFor();
  const { fitted } = await get('/api/v1/datasets/set/rules');
  const row = id('rules').getByRole('row', { name: /^RSS over distance/ });
  const shown = await row.locator('td').allTextContents();
  assert.equal(parseFloat(shown[2]), Number((100 * fitted.rss.los_rate).toFixed(1)));
  assert.equal(parseFloat(shown[3]), Number((100 * fitted.rss.nlos_rate).toFixed(1)));
  assert.deepEqual(await violations(page), []);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a model is promoted past the gate, takes effect, and is rolled back by one press', async () => {
  const { page, id } = await openPage(browser, server, { hash: `#/models/runs/${training.id}` });
  const dialog = id('promote-dialog');
  await opensByKeys(page, id('promote'), dialog);
  await id('promote').click();
  await dialog.getByText(/GATE (NOT )?PASSED/).waitFor();
  assert.deepEqual(await violations(page), []);
  const reason = dialog.getByRole('textbox');
  if (await reason.count()) await reason.fill('first model of this building');
  await dialog.getByRole('button', { name: /^Promote/ }).click();
  await dialog.waitFor({ state: 'detached' });
  await eventually(
    'it is active',
    async () => (await get('/api/v1/models/active')).models?.nlos_id?.id === training.model.split('/').pop(),
  );
  await page.getByText('ACTIVE').first().waitFor();
  await id('rollback').click();
  await eventually('none is active', async () => !(await get('/api/v1/models/active')).models?.nlos_id);
  await page.close();
});

test('measurements are filtered, plotted and opened one by one', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('rows').locator('tbody tr').first().waitFor();
  const whole = await text(id('counts'));
  await id('who').selectOption({ index: 1 });
  await eventually('fewer are shown', async () => (await text(id('counts'))) !== whole);
  await id('who').selectOption('');
  await id('source').selectOption({ label: 'halls' });
  await id('plot-bias').waitFor();
  await id('rows').locator('tbody tr').first().click();
  await id('features').waitFor();
  const first = await text(id('impulse').locator('h2'));
  await page.keyboard.press('j');
  await eventually(
    'the next one is open',
    async () =>
      (await text(id('impulse').locator('h2'))) !== first || (await id('rows').locator('tr.sel').count()) === 1,
  );
  assert.deepEqual(await violations(page), []);
  await picture(page, 'measurements-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a range is taken out of use with a reason, and used again', async () => {
  const {
      items: [{ id: mission }],
    } = await get('/api/v1/missions'),
    record = async () => (await get(`/api/v1/missions/${mission}/exclusions`)).items;
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('source').selectOption(mission);
  await id('rows').locator('tbody tr:not(.space)').first().click();
  await id('exclude').click();
  await id('exclude-picked').waitFor();
  assert.equal(await text(id('exclude-picked')), '1');
  assert.ok(await id('exclude-now').isDisabled(), 'not without a reason');
  await id('exclude-reason').fill('a crane stood in the way');
  await id('exclude-now').click();
  await eventually('it is in the record', async () => (await record()).length === 1);
  const [one] = await record();
  assert.deepEqual([one.kind, one.n_rows, one.reason, one.included], ['ranges', 1, 'a crane stood in the way', null]);
  await id('exclusion-list').getByText('a crane stood in the way').waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'measurements-out-of-use-light');
  await id('include').click();
  await eventually('it is used again', async () => (await record())[0].included !== null);
  await id('exclusion-list').getByText('used again').waitFor();
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test("the filter is the server's: the list, the count and the file are of the same rows, and only what is in sight is in the page", async () => {
  const {
      items: [{ id: mission }],
    } = await get('/api/v1/missions'),
    { items } = await get(`/api/v1/ranges?mission=${mission}&limit=10000`);
  const limit = Math.round(items.map((r) => r.distance_m).sort((a, b) => a - b)[Math.floor(items.length / 2)] * 2) / 2,
    near = items.filter((r) => r.distance_m <= limit);
  assert.ok(near.length > 250 && near.length < items.length, `${near.length} of ${items.length}`);
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('source').selectOption(mission);
  const count = async () => (await text(id('counts'))).split(' of ').map((n) => Number(n.replace(/\D/g, '')));
  await eventually('all are counted', async () => (await count())[0] === items.length);
  await id('distance-to').fill('9 m');
  await id('distance-to').press('Enter');
  assert.equal(await id('distance-to').getAttribute('aria-invalid'), 'true', 'no number, no filter');
  assert.equal((await count())[0], items.length);
  await id('distance-to').fill(limit.toFixed(1).replace('.', ','));
  await id('distance-to').press('Enter');
  await eventually('fewer are counted', async () => (await count()).join() === [near.length, items.length].join());
  const file = await fetch(await id('download-ndjson').getAttribute('href'));
  assert.deepEqual(
    (await file.text())
      .trim()
      .split('\n')
      .map((l) => JSON.parse(l).id)
      .sort(),
    near.map((r) => r.id).sort(),
  );
  // To the oldest, page by page: what was gone through is not kept in the page.
  const list = id('rows'),
    oldest = near.reduce((a, b) => (b.t_us < a.t_us ? b : a));
  // The last page may come after the last scroll, and makes the list longer.
  const to_end = () =>
    id('rows-box').evaluate((e) => {
      e.scrollTop = e.scrollHeight;
    });
  await eventually(
    'the end is reached',
    async () => {
      await to_end();
      return Number(await list.getAttribute('aria-rowcount')) === near.length + 1;
    },
    30_000,
    100,
  );
  await eventually('the oldest is listed', async () => {
    await to_end();
    return (
      (await list.locator('tbody tr:not(.space)').last().locator('td').nth(3).textContent()) ===
      oldest.distance_m.toFixed(3)
    );
  });
  assert.ok((await list.locator('tbody tr').count()) < 60);
  await id('turn').click();
  await eventually(
    'the oldest is first',
    async () =>
      (await text(list.locator('tbody tr:not(.space)').first().locator('td').nth(3))) === oldest.distance_m.toFixed(3),
  );
  assert.deepEqual(await violations(page), []);
  // No model is promoted: no measurement of the flight is called LOS, and the way out is said.
  await id('predicted').selectOption('los');
  await page.getByText('No measurement passes this filter').waitFor();
  await id('reset').click();
  await eventually('all are back', async () => (await count())[0] === items.length);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('measurements are filtered by what the promoted model calls them, and the level is drawn against the line of a data set', async () => {
  const model = training.model.split('/').pop();
  await post(`/api/v1/models/${model}/promote`, { reason: 'to filter by it' });
  const { items } = await get('/api/v1/campaigns/halls/samples?limit=1000&predicted=true'),
    called = items.filter((s) => s.predicted.p_los < 0.4);
  assert.ok(called.length > 20 && called.length < items.length - 20, `${called.length} of ${items.length}`);
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('source').selectOption({ label: 'halls' });
  await id('predicted').selectOption('nlos');
  await eventually(
    'those are counted',
    async () => (await text(id('counts'))) === `${called.length} of ${items.length}`,
  );
  for (const cell of await id('rows').locator('tbody tr:not(.space) td:nth-of-type(3)').allTextContents())
    assert.match(cell, /^NLOS (\d|[1-3]\d|40) %$/);
  const file = await fetch(await id('download-csv').getAttribute('href'));
  assert.equal((await file.text()).trim().split('\r\n').length, called.length + 1);
  const {
      thresholds: { rss },
    } = await get('/api/v1/datasets/set/rules'),
    words = id('line-words');
  await id('line').selectOption({ label: 'line of set' });
  await eventually('the line is named', async () =>
    (await text(words)).includes(`LOS above ${rss.at_zero_dbm.toFixed(1).replace('-', '\u2212')} dBm`),
  );
  const labelled = called.filter((s) => s.truth.los === false),
    under = labelled.filter((s) => s.rx_dbm <= rss.at_zero_dbm + rss.slope_dbm_per_m * s.range_m);
  assert.ok(
    (await text(words))
      .replaceAll('\u00a0', ' ')
      .includes(`${((100 * under.length) / labelled.length).toFixed(1)} % of NLOS below`),
    await text(words),
  );
  await id('plot-level').locator('[data-mark="line"]').waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'measurements-filtered-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
  await post('/api/v1/models/rollback', { task: 'nlos_id' });
});

/** One DW1000 record: noise of `noise`, a first path at tap 740 and a tail that fades with `tau` taps. */
function response(noise, first, tau) {
  const bytes = Buffer.alloc(1016 * 4);
  for (let k = 0; k < 1016; k++)
    bytes.writeInt16LE(
      k < 740 ? noise * (k % 2 ? 1 : -1) : Math.round(first * Math.exp(-(k - 740) / tau)) + noise,
      4 * k,
    );
  return { n: 1016, dt_ps: 1001.6, first_path_idx: 740, rxpacc: 1001, b64: bytes.toString('base64') };
}

test('a campaign of impulse responses is imported, and a sample shows its response with the features of the API', async () => {
  await post('/api/v1/campaigns', { name: 'responses' });
  const rows = Array.from({ length: 12 }, (_, i) => ({
    environment: `place ${1 + (i % 2)}`,
    setting: `s${i}`,
    true_distance_m: 5,
    los: i % 2 === 0,
    range_m: 5.02 + 0.03 * i,
    rx_dbm: -80 - i / 10,
    fp_dbm: -83 - i / 10,
    cir: response(20, 4000 - 100 * i, i % 2 ? 30 : 6),
  }));
  const imported = await server.fetch('/api/v1/campaigns/responses/samples', {
    method: 'POST',
    headers: { 'content-type': 'application/x-ndjson' },
    body: rows.map((r) => JSON.stringify(r)).join('\n'),
  });
  assert.equal(imported.status, 200, await imported.text());
  const { items } = await get('/api/v1/campaigns/responses/samples?features=true');
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('source').selectOption({ label: 'responses' });
  await eventually('its rows are listed', async () => (await id('rows').locator('tbody tr').count()) === 12);
  // By keys alone: the first row is chosen from the table, and its taps are read in a table.
  await id('rows').locator('tbody button').first().focus();
  await page.keyboard.press('Enter');
  const plot = id('impulse').getByRole('img', {
    name: /^Impulse response of 1016 taps, 1\.00 ns each, first path at tap 740\.0/,
  });
  await plot.waitFor();
  // Chosen below, it is in sight above.
  await eventually('the plot is in sight', () =>
    plot.evaluate((e) => {
      const r = e.getBoundingClientRect(),
        at = document.elementFromPoint(r.x + r.width / 2, r.y + 30);
      return at !== null && e.contains(at);
    }),
  );
  for (const mark of ['first', 'noise', 'delay', 'peak'])
    assert.equal(await plot.locator(`[data-mark="${mark}"]`).count(), 1, mark);
  const shown = parseFloat((await text(id('impulse').locator('h2'))).match(/, ([\d.]+) m$/)[1]),
    sample = items.find((s) => s.range_m.toFixed(3) === shown.toFixed(3));
  for (const name of ['kurtosis', 'mean_excess_delay_ns', 'rms_delay_spread_ns', 'rx_dbm', 'fp_dbm'])
    assert.equal(
      parseFloat((await text(id(`feature-${name}`).locator('td').first())).replace('\u2212', '-')),
      Number(sample.features[name].toFixed(2)),
      name,
    );
  await id('taps-toggle').focus();
  await page.keyboard.press('Enter');
  assert.match(await text(id('taps').locator('tbody th', { hasText: 'strongest' })), /^740/);
  // Kept for comparison, the first stays under the second.
  await id('keep').click();
  await page.keyboard.press('j');
  await plot.locator('[data-mark="kept"]').waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'campaign-cir-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test("facility data of an anchor are edited where they stand, kept over a reload, and never overwrite another's", async () => {
  const {
    features: [anchor],
  } = await get('/api/v1/anchors?view=live');
  const name = anchor.properties.network_id;
  const { page, seen, id } = await openPage(browser, server, { hash: `#/anchors/${name}` });
  await id('facility-edit').click();
  const form = id('facility').getByRole('form');
  await form.getByLabel('Name', { exact: true }).fill('Hall A north-west');
  await form.getByRole('button', { name: 'Add a system' }).click();
  await form.getByLabel('System 1', { exact: true }).fill('archibus');
  await form.getByLabel('Name in system 1').fill('EQ-7');
  await page.reload();
  assert.equal(await form.getByLabel('Name', { exact: true }).inputValue(), 'Hall A north-west');
  // Somebody else fills in the room meanwhile: told, and both stand in the end.
  const read = await server.fetch(`/api/v1/anchors/${name}`);
  assert.equal(
    (
      await server.fetch(`/api/v1/anchors/${name}`, {
        method: 'PATCH',
        headers: { 'if-match': read.headers.get('etag') },
        json: { space: 'A0.12' },
      })
    ).status,
    200,
  );
  await id('facility-save').click();
  await id('facility').getByText('Somebody else has changed this anchor').waitFor();
  assert.equal(await form.getByLabel('Room').inputValue(), 'A0.12');
  assert.deepEqual(await violations(page), []);
  await picture(page, 'facility-light');
  await id('facility-save').click();
  await id('facility').getByText('EQ-7').waitFor();
  const { properties } = await get(`/api/v1/anchors/${name}`);
  assert.deepEqual(
    [properties.name, properties.space, properties.external_ids],
    ['Hall A north-west', 'A0.12', [{ system: 'archibus', id: 'EQ-7' }]],
  );
  assert.deepEqual(
    seen.errors.filter((e) => !e.includes('412')),
    [],
  );
  await page.close();
});

test('system tells the state of the server, and a token is shown once', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  await id('health').getByText('DB', { exact: true }).waitFor();
  await id('radios-in-range').locator('tbody tr').first().waitFor();
  await id('access').getByPlaceholder('who or what will use it').fill('museum app');
  await id('create-token').click();
  const secret = await id('secret').getByRole('textbox').inputValue();
  assert.match(secret, /^anc_/);
  assert.deepEqual(await violations(page), []);
  await picture(page, 'system-light');
  await page.reload();
  await id('access').getByText('museum app').waitFor();
  assert.equal(await id('secret').count(), 0);
  assert.ok(!(await page.content()).includes(secret));
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a wrong name and lever arm of a stored flight are corrected, and everything else of it stays', async () => {
  const of_api = async () => (await (await server.fetch('/api/v1/missions')).json()).items.at(-1);
  const before = await of_api();
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  await id('correct-flight').last().click();
  const form = id('flight-form');
  assert.ok(await form.getByTestId('flight-correct').isDisabled(), 'nothing is wrong yet');
  await form.getByLabel('Name').fill('North hall');
  await form.getByLabel(`${before.tags[0].tag} Up, m`).fill('x');
  await form.getByText('Lever arms are numbers in metres.').waitFor();
  await form.getByLabel(`${before.tags[0].tag} Up, m`).fill('-0,31');
  assert.deepEqual(await violations(page, { within: '[data-testid="flight-form"]' }), []);
  await form.getByTestId('flight-correct').click();
  await form.waitFor({ state: 'detached' });
  await eventually('the list has the new name', async () => (await text(id('flights'))).includes('North hall'), 10_000);
  const now = await of_api();
  assert.deepEqual(now.tags[0].lever_arm_body_m, [...before.tags[0].lever_arm_body_m.slice(0, 2), -0.31]);
  for (const key of ['id', 'kit', 'frame', 'track_point', 'state', 'created_at', 'n_ranges', 'n_fixes'])
    assert.deepEqual(now[key], before[key], key);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a stored flight is replayed: time moves, a jump shows that moment, and no command is offered', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/replay' });
  await eventually('the flight is read', async () => /\d/.test(await text(id('replay-time'))), 20_000);
  await id('scrubber').fill('30000000');
  await eventually('it is at 30 s', async () => (await text(id('replay-time'))).startsWith('00:00:30'));
  assert.ok((await id('range-list').locator('tbody tr').count()) >= 3);
  // Positions are of that moment: what the server says was estimated then, not what the whole flight gave.
  await page.locator('[data-testid="replay"][data-positions="moment"]').waitFor({ timeout: 60_000 });
  const [mission] = (await get('/api/v1/missions')).items,
    { items } = await get(`/api/v1/missions/${mission.id}/estimates`),
    from_us = (await get(`/api/v1/missions/${mission.id}/track?limit=1`)).properties.t_us[0];
  const anchor = await text(id('anchor-card').locator('h2')),
    of_it = items.filter((e) => e.anchor === anchor),
    of_moment = of_it.filter((e) => e.t_us <= from_us + 30e6).at(-1);
  assert.ok(of_it.length > 10 && of_moment.t_us < of_it.at(-1).t_us - 20e6);
  const [e, n] = of_moment.enu_m.map((m) => m.toFixed(3).replace('-', '−'));
  await eventually('its position is that of 30 s', async () => (await text(id('anchor-card'))).includes(`${e}, ${n},`));
  await id('speed').selectOption('4');
  await id('play').click();
  await eventually('time moves on', async () => Number((await text(id('replay-time'))).slice(6, 8)) >= 33);
  await id('play').click();
  assert.equal(await page.getByRole('button', { name: /hold|land|start/i }).count(), 0);
  assert.deepEqual(await violations(page), []);
  await picture(page, 'replay-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a place is labelled in the field: its truth is typed, one press records, and the form is there after a reload', async () => {
  const { id: mission } = await post('/api/v1/missions', {
    name: 'yard',
    frame: 'wgs84',
    track_point: 'gnss_antenna',
    tags: [],
  });
  let seq = 0;
  const heard = async (n) =>
    post(
      '/api/v1/ranges',
      Array.from({ length: n }, () => ({
        mission,
        tag: '0x6e01',
        anchor: '0x6a77',
        t_us: 1_800_000_000_000_000 + ++seq * 50_000,
        seq,
        distance_m: 5 + 0.01 * (seq % 3),
        rx_dbm: -80,
        fp_dbm: -84,
        cir: response(20, 3000, 12),
      })),
    );
  const { page, seen, id } = await openPage(browser, server, { hash: '#/measurements' });
  await id('label-field').click();
  for (const [field, value] of Object.entries({
    campaign: 'yard',
    environment: 'yard',
    distance_m: '4,95',
    material: 'brick',
    wanted: '6',
  }))
    await id(`take-${field}`).fill(value);
  await eventually(
    'the anchor is heard',
    async () => {
      await heard(1);
      return (await text(id('take-anchor'))).includes('0x6a77');
    },
    60_000,
    300,
  );
  await id('take-anchor').selectOption('0x6a77');
  await id('campaign-mode').getByRole('button', { name: 'NLOS', exact: true }).click();
  assert.deepEqual(await violations(page), []);
  await id('take-record').click();
  await id('take-now').waitFor();
  // Only what comes after the press counts; the first look has fixed where that is once it says 0 of 6.
  await id('take-now').getByText('0 of 6').waitFor();
  await eventually(
    'six come after the press',
    async () => {
      await heard(1);
      return id('take-done').filter({ hasText: 'kept' }).count();
    },
    60_000,
    300,
  );
  assert.match(await text(id('take-done')), /6 of 6 kept as 4\.95 m, brick, NLOS/);
  const { items } = await get('/api/v1/campaigns/yard/samples');
  assert.equal(items.length, 6);
  for (const s of items)
    assert.deepEqual(
      [s.truth.distance_m, s.truth.los, s.truth.material, s.has_cir, s.rx_dbm],
      [4.95, false, 'brick', true, -80],
    );
  await id('taken').getByText('4.95 m, brick, NLOS').waitFor();
  await picture(page, 'campaign-mode-light');
  await page.reload();
  await id('label-field').click();
  assert.equal(await id('take-distance_m').inputValue(), '4,95');
  assert.deepEqual(seen.errors, []);
  await page.close();
});
