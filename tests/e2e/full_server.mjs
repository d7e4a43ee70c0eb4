// A server with something in every view: a flight, a plan, a campaign, a data set and a trained model.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { hall_outline } from './flight.mjs';
import { root, run, startServer } from './server.mjs';

export const sizes = [
  ['desk', 1440, 900],
  ['laptop', 1024, 768],
  ['tablet', 768, 1024],
  ['phone', 390, 844],
];
export const views = ['live', 'plan', 'anchors', 'measurements', 'models', 'replay', 'system', 'guide'];

/** {server, mission, plan, training}; to be disposed of. */
export async function fullServer() {
  const folder = mkdtempSync(join(tmpdir(), 'anchord full ')),
    server = await startServer({ auth: 'off' });
  const post = async (path, json, headers = {}) => {
    const answer = await server.fetch(path, { json, headers });
    assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
    return answer.json();
  };
  try {
    const flight = join(folder, 'flight');
    assert.equal((await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', flight])).code, 0);
    const replayed = await run(['replay', flight, '--url', server.url, '--speed', 'max']);
    assert.equal(replayed.code, 0, replayed.stderr);
    const made = await post('/api/v1/plans/generate', {
      name: 'Hall',
      outline: hall_outline,
      building_height_m: 8,
      settings: { max_height_m: 14 },
    });
    const { id: plan } = await post('/api/v1/plans', made.plan);
    await post('/api/v1/campaigns', { name: 'halls' });
    const imported = await server.fetch('/api/v1/campaigns/halls/samples', {
      method: 'POST',
      headers: { 'content-type': 'text/csv' },
      body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
    });
    assert.equal(imported.status, 200, await imported.text());
    await post('/api/v1/datasets', {
      name: 'set',
      campaigns: ['halls'],
      aggregation: 'none',
      split: { test: ['room 6'] },
    });
    const training = await post(
      '/api/v1/training-runs',
      { task: 'nlos_id', dataset: 'set', methods: ['logistic'], cv: { folds: 4, seed: 7 } },
      { prefer: 'wait=200' },
    );
    const [mission] = (await (await server.fetch('/api/v1/missions')).json()).items;
    return { server, mission, plan, training };
  } catch (error) {
    await server.dispose();
    throw error;
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}
