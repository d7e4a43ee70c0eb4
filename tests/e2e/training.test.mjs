// Training runs from outside: the worker process, its death and the server's, cancel, restart, and equal bytes.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { Contract, checked } from './contract.mjs';
import { endless, quick, values } from './learning_bodies.mjs';
import { binary, eventually, root, startServer } from './server.mjs';

const contract = new Contract();
let server, call;

/** Processes of the server's worker. */
function workersOf(pid) {
  return readdirSync('/proc')
    .filter((name) => /^\d+$/.test(name))
    .flatMap((name) => {
      try {
        const stat = readFileSync(`/proc/${name}/stat`, 'utf8');
        const [state, parent] = stat.slice(stat.lastIndexOf(')') + 2).split(' ');
        return stat.includes('(anchord-worker)') && Number(parent) === pid && state !== 'Z' ? [Number(name)] : [];
      } catch {
        return []; // it ended while we looked
      }
    });
}

const alive = (pid) => {
  try {
    return !/^State:\s+[ZX]/m.test(readFileSync(`/proc/${pid}/status`, 'utf8'));
  } catch {
    return false;
  }
};

async function begin(body) {
  const job = await call('POST', '/api/v1/training-runs', { expect: 202, json: body });
  const [worker] = await eventually(
    'a worker searches',
    async () => {
      const now = await call('GET', `/api/v1/jobs/${job.json.id}`);
      assert.ok(['queued', 'running'].includes(now.json.state), now.text);
      return now.json.progress.stage === 'search' && now.json.progress.fraction > 0 && workersOf(server.pid);
    },
    60_000,
  );
  return { id: job.json.id, worker };
}

const ended = (id, deadlineMs = 120_000) =>
  eventually(
    `job ${id} ends`,
    async () => {
      const job = (await call('GET', `/api/v1/jobs/${id}`)).json;
      return !['queued', 'running'].includes(job.state) && job;
    },
    deadlineMs,
    50,
  );

before(async () => {
  server = await startServer();
  call = checked(server, contract);
  await call('POST', '/api/v1/campaigns', { expect: 201, json: { name: 'campaign' } });
  const csv = readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8');
  await call('POST', '/api/v1/campaigns/campaign/samples', {
    expect: 200,
    headers: { 'content-type': 'text/csv' },
    body: csv,
  });
  await call('POST', '/api/v1/datasets', {
    expect: 201,
    json: { name: 'set', campaigns: ['campaign'], aggregation: 'none', split: { test: ['room 6'] } },
  });
});
after(() => server?.dispose());

test('two runs with one seed are equal to the byte', async () => {
  const artifacts = [];
  for (let i = 0; i < 2; ++i) {
    const run = await call('POST', '/api/v1/training-runs', {
      expect: 201,
      json: quick,
      headers: { prefer: 'wait=200' },
    });
    artifacts.push((await call('GET', `${run.json.model}/artifact`)).text);
  }
  assert.equal(artifacts[0], artifacts[1]);
});

test('a frozen data set has one form and one digest through the service and the command line', async () => {
  const dir = mkdtempSync(join(tmpdir(), 'anchord-doors-'));
  const anchord = (...args) =>
    execFileSync(binary, args, { cwd: dir, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] });
  try {
    const set = (await call('GET', '/api/v1/datasets/set')).json;
    writeFileSync(join(dir, 'rows.csv'), (await call('GET', '/api/v1/datasets/set/rows?format=csv')).text);
    assert.match(anchord('dataset', 'check', 'rows.csv'), new RegExp(`^digest ${set.digest}\n`));
    assert.equal(
      createHash('sha256')
        .update(readFileSync(join(dir, 'rows.csv')))
        .digest('hex'),
      set.digest,
    );
    // What the command line freezes, the service takes for the same; and what either trains of it are the same bytes.
    writeFileSync(join(dir, 'campaign.csv'), readFileSync(join(root, 'docs/examples/campaign.csv')));
    const built = anchord(
      'dataset',
      'build',
      '--data',
      'campaign.csv',
      '--hold-out',
      'room 6',
      '--out',
      'built.csv',
    ).match(/^digest (\w+)/)[1];
    const frozen = await call('POST', '/api/v1/datasets', {
      expect: 201,
      json: { name: 'frozen', campaigns: ['campaign'], split: { test: ['room 6'] } },
    });
    assert.equal(frozen.json.digest, built);
    const sent = await call('POST', '/api/v1/datasets?name=built', {
      expect: 201,
      headers: { 'content-type': 'text/csv' },
      body: readFileSync(join(dir, 'built.csv'), 'utf8'),
    });
    assert.equal(sent.json.digest, built);
    const run = await call('POST', '/api/v1/training-runs', {
      expect: 201,
      json: { ...quick, dataset: 'built', importance: false },
      headers: { prefer: 'wait=200' },
    });
    anchord(
      'train',
      '--data',
      'built.csv',
      '--task',
      'nlos_id',
      '--method',
      'logistic,random_forest',
      '--folds',
      '4',
      '--seed',
      '7',
      '--out',
      'model.json',
    );
    // The service signs what it made; nothing else differs.
    const { signature, ...made } = JSON.parse((await call('GET', `${run.json.model}/artifact`)).text);
    assert.match(signature, /^made:/);
    assert.equal(JSON.stringify(made), JSON.stringify(JSON.parse(readFileSync(join(dir, 'model.json'), 'utf8'))));
  } finally {
    rmSync(dir, { recursive: true, force: true });
  }
});

test('a canceled run ends within a second or two and leaves nothing', async () => {
  const models = (await call('GET', '/api/v1/models')).json.items.length;
  const { id, worker } = await begin(endless);
  const asked = Date.now();
  await call('DELETE', `/api/v1/jobs/${id}`);
  assert.equal((await ended(id)).state, 'canceled');
  console.log(`canceled after ${Date.now() - asked} ms`);
  await eventually('the worker is gone', () => !alive(worker));
  assert.equal((await call('GET', `/api/v1/training-runs/${id}`)).json.model, null);
  await call('GET', `/api/v1/training-runs/${id}/folds`, { expect: 404 });
  assert.equal((await call('GET', '/api/v1/models')).json.items.length, models);
});

test('a worker that dies fails its job with the reason, and nothing else', async () => {
  const { id, worker } = await begin(endless);
  process.kill(worker, 'SIGKILL');
  const job = await ended(id);
  assert.equal(job.state, 'failed');
  assert.match(job.problem.detail, /worker process was ended by signal 9/);
  assert.match(job.problem.detail, /start the run again/);
  assert.equal((await server.fetch('/healthz')).status, 200);
});

test('a run interrupted by kill -9 is marked, its worker is gone, and it can be started again', async () => {
  const { id, worker } = await begin({
    ...endless,
    grid: { svm: { c: values(40, 0.1, 1.2), gamma: values(20, 0.001, 1.2) } },
  });
  await server.kill();
  await eventually('the worker dies with its server', () => !alive(worker));
  await server.start();
  const job = (await call('GET', `/api/v1/jobs/${id}`)).json;
  assert.equal(job.state, 'failed');
  assert.match(job.problem.detail, /interrupted/);
  await call('POST', `/api/v1/training-runs/${id}/restart`, { expect: 202 });
  assert.ok(['queued', 'running'].includes((await call('GET', `/api/v1/training-runs/${id}`)).json.state));
  await call('POST', `/api/v1/training-runs/${id}/restart`, { expect: 422 });
  await call('DELETE', `/api/v1/jobs/${id}`);
  await ended(id);
  await call('DELETE', `/api/v1/training-runs/${id}`, { expect: 204 });
});

test('hostile artifacts are refused, not loaded', async () => {
  const good = (await call('GET', `${(await call('GET', '/api/v1/models')).json.items[0].links[0].href}`)).json;
  const send = (body, expect) =>
    call('POST', '/api/v1/models', { expect, headers: { 'content-type': 'application/json' }, body });
  await send('[', 422);
  await send(`${'['.repeat(100_000)}`, 422);
  await send(JSON.stringify({ ...good, format: 'opencv-ml-svm' }), 422);
  // Written by hand: no number of JavaScript is too large for a double.
  const steep = JSON.stringify({ ...good, classifier: { ...good.classifier, slope: '1e999' } });
  await send(steep.replace('"1e999"', '1e999'), 422);
  await send(JSON.stringify({ ...good, manifest: { ...good.manifest, features: Array(100_000).fill('rx_dbm') } }), 422);
  await send(JSON.stringify(good), 201);
});
