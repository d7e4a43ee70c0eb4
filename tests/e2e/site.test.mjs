// `anchord simulate site` against a fresh server with the simulated tag and rover: what stands there afterwards, that ranges measured live
// are told apart by the promoted model, and that a second run adds nothing.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { binary, eventually, root, run, startServer } from './server.mjs';

let simulator, server;
const get = async (path) => {
  const answer = await server.fetch(path);
  assert.equal(answer.status, 200, `${path}: ${await answer.clone().text()}`);
  return answer.json();
};
const fill = (...words) => run(['simulate', 'site', '--url', server.url, ...words], { deadlineMs: 240_000 });

before(async () => {
  simulator = spawn(binary, ['simulate', 'demonstration', '--json', '--seed', '7'], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const served = [];
  await new Promise((done, fail) => {
    createInterface({ input: simulator.stdout }).on('line', (line) => served.push(JSON.parse(line)) === 2 && done());
    simulator.once('exit', (code) => fail(new Error(`anchord simulate ended with ${code}`)));
  });
  server = await startServer({
    args: ['--devices', served.map(({ kind, address }) => `${kind}=${address}`).join(',')],
  });
});
after(async () => {
  simulator?.kill('SIGTERM');
  await server?.dispose();
});

/** Everything that the command may add, without what changes by itself. */
async function standing() {
  const names = (listing) => listing.items.map((item) => item.id ?? item.revision);
  const out = {};
  for (const what of ['campaigns', 'datasets', 'training-runs', 'models', 'missions', 'calibrations', 'revisions'])
    out[what] = names(await get(`/api/v1/${what}`));
  out.samples = (await get(`/api/v1/campaigns/${out.campaigns[0]}`)).n_samples;
  out.promotions = (await get('/api/v1/models/promotions')).items.length;
  return out;
}

let first;
test('a fresh server gets a labelled campaign, a promoted model, a finished flight and a published revision', async () => {
  const { code, stderr } = await fill();
  assert.equal(code, 0, stderr);
  first = await standing();
  const campaign = await get(`/api/v1/campaigns/${first.campaigns[0]}`);
  assert.ok(campaign.n_samples > 1000, stderr);
  for (const los of [true, false])
    assert.ok(campaign.settings.filter((setting) => setting.los === los).length > 100, `settings with los ${los}`);

  const { models, raw } = await get('/api/v1/models/active');
  assert.equal(raw, false);
  const promotions = (await get('/api/v1/models/promotions')).items;
  assert.deepEqual(promotions.map(({ model }) => model).sort(), [models.bias.id, models.nlos_id.id].sort());
  for (const { reason } of promotions) assert.equal(reason, '', 'through the gate, not past it');

  const [mission] = (await get('/api/v1/missions')).items;
  assert.equal(mission.name, 'Demonstration building, finished flight');
  assert.equal(mission.state, 'finished');
  const [revision] = (await get('/api/v1/revisions')).items;
  assert.equal(revision.calibration, first.calibrations[0]);
  assert.ok((await get('/api/v1/anchors')).features.length >= 5, stderr);
});

test('a second run finds all of it and adds nothing', async () => {
  const { code, stderr } = await fill();
  assert.equal(code, 0, stderr);
  assert.deepEqual(await standing(), first);
  assert.match(stderr, /already exists/);
});

test('ranges of a live flight are told apart by the promoted model', async () => {
  const answer = await server.fetch('/api/v1/missions', {
    json: {
      name: 'live',
      frame: 'wgs84',
      track_point: 'gnss_antenna',
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.12, 0, -0.28] }],
    },
  });
  const mission = await answer.json();
  assert.equal(answer.status, 201, JSON.stringify(mission));
  const ranges = await eventually(
    '200 ranges of the live flight',
    async () => {
      const { items } = await get(`/api/v1/ranges?mission=${mission.id}&predicted=true&limit=1000`);
      return items.length >= 200 && items;
    },
    90_000,
    500,
  );
  const of = (name) => ranges.filter(({ predicted }) => predicted.class === name).length;
  assert.ok(
    ranges.every(({ predicted }) => predicted.p_los !== null),
    'each has a probability',
  );
  assert.ok(of('unclear') < 0.25 * ranges.length, `${of('unclear')} of ${ranges.length} are unclear`);
  assert.ok(of('los') > 0 && of('nlos') > 0, `${of('los')} LOS, ${of('nlos')} NLOS`);
});

test('nothing is promoted or published over what others decided', async () => {
  const other = await startServer();
  const post = async (path, json, headers = {}) => {
    const answer = await other.fetch(path, { json, headers });
    assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
    return answer.json();
  };
  try {
    await post('/api/v1/campaigns', { name: 'halls' });
    const imported = await other.fetch('/api/v1/campaigns/halls/samples', {
      method: 'POST',
      headers: { 'content-type': 'text/csv' },
      body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
    });
    assert.equal(imported.status, 200, await imported.text());
    await post('/api/v1/datasets', { name: 'set', campaigns: ['halls'], split: { test: ['room 6'] } });
    const trained = await post(
      '/api/v1/training-runs',
      { task: 'nlos_id', dataset: 'set', methods: ['logistic'], importance: false },
      { prefer: 'wait=200' },
    );
    await post(`${trained.model}/promote`, {});
    const { code, stderr } = await run(['simulate', 'site', '--url', other.url], { deadlineMs: 240_000 });
    assert.equal(code, 0, stderr);
    assert.match(stderr, /not promoted: model [0-9a-f-]+ is active/);
    const active = await (await other.fetch('/api/v1/models/active')).json();
    assert.equal(`/api/v1/models/${active.models.nlos_id.id}`, trained.model);
    assert.equal(active.models.bias, null);
  } finally {
    await other.dispose();
  }
});

test('a server that is not there is named, with what to do', async () => {
  const { code, stderr } = await run(['simulate', 'site', '--url', 'http://127.0.0.1:1']);
  assert.equal(code, 1);
  assert.match(stderr, /no anchord server answers at http:\/\/127\.0\.0\.1:1/);
});
