// A grid search that keeps every core busy: what others are measured beside.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { eventually, root } from '../e2e/server.mjs';

/** {state(), stop()} of a search that runs. */
export async function start_search(server) {
  const send = async (path, init, status) => {
    const answer = await server.fetch(path, init);
    const text = await answer.text();
    if (answer.status !== status) throw new Error(`${path}: ${answer.status} ${text.slice(0, 300)}`);
    return JSON.parse(text);
  };
  await send('/api/v1/campaigns', { json: { name: 'bench' } }, 201);
  const csv = readFileSync(join(root, 'docs/examples/campaign.csv'));
  await send(
    '/api/v1/campaigns/bench/samples',
    { method: 'POST', headers: { 'content-type': 'text/csv' }, body: csv },
    200,
  );
  await send('/api/v1/datasets', { json: { name: 'bench', campaigns: ['bench'], aggregation: 'none' } }, 201);
  const values = (n, from, step) => Array.from({ length: n }, (_, i) => Number((from * step ** i).toPrecision(6)));
  const job = await send(
    '/api/v1/training-runs',
    {
      json: {
        task: 'nlos_id',
        dataset: 'bench',
        methods: ['svm'],
        importance: false,
        grid: { svm: { c: values(90, 0.1, 1.1), gamma: values(90, 0.001, 1.1) } },
      },
    },
    202,
  );
  const now = () => send(`/api/v1/jobs/${job.id}`, {}, 200);
  await eventually('the search runs', async () => (await now()).progress.stage === 'search', 30_000);
  return {
    state: async () => (await now()).state,
    stop: () => server.fetch(`/api/v1/jobs/${job.id}`, { method: 'DELETE' }),
  };
}
