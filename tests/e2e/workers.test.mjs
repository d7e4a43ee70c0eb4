// Training runs on workers of other processes, over a real PostgreSQL: the same bytes as on the server, a worker that is killed or
// stopped in the middle, cancel, restarts of server and database, and attempts that all fail.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { Contract, checked } from './contract.mjs';
import { endless, quick, values } from './learning_bodies.mjs';
import { startPostgres } from './postgres.mjs';
import { eventually, root, run, startServer } from './server.mjs';
import { allow_workers, endWorkers, startWorker } from './worker.mjs';

const contract = new Contract();
/** Takes some seconds: long enough to be interrupted, short enough to be waited for. */
const some_seconds = {
  ...endless,
  grid: { svm: { c: values(12, 0.1, 1.4), gamma: values(8, 0.001, 1.5) } },
};
let postgres, server, call;

const started = (name) => startWorker(postgres, name);

const job_of = async (id) => (await call('GET', `/api/v1/jobs/${id}`, { expect: 200 })).json;
const begin = async (body) => (await call('POST', '/api/v1/training-runs', { expect: 202, json: body })).json.id;
const becomes = (id, what, fits) =>
  eventually(
    `job ${id} ${what}`,
    async () => {
      const job = await job_of(id);
      return fits(job) && job;
    },
    60_000,
    50,
  );
const computes = (id, worker) =>
  becomes(id, `is computed by ${worker.name}`, (job) => job.worker === worker.name && job.progress.stage === 'search');
const taken_over = (id, worker) =>
  becomes(id, `is taken over by ${worker.name}`, (job) => job.worker === worker.name && job.attempts === 2);
const succeeds = async (id) => {
  const job = await becomes(id, 'ends', ({ state }) => !['queued', 'running'].includes(state));
  assert.equal(job.state, 'succeeded', JSON.stringify(job));
  return job;
};
const models_of = async (id) =>
  Number(
    await postgres.psql(
      'SELECT count(*) FROM model m JOIN training_run r USING (run_key)' +
        ` WHERE encode(r.id, 'hex') = '${id.replaceAll('-', '')}'`,
      'anchord',
    ),
  );
const artifact_of = async (id) => {
  const { model } = (await call('GET', `/api/v1/training-runs/${id}`, { expect: 200 })).json;
  return (await call('GET', `${model}/artifact`, { expect: 200 })).text;
};

before(async () => {
  postgres = await startPostgres();
  await postgres.psql('CREATE DATABASE anchord');
  server = await startServer({
    args: ['--database', postgres.url('anchord')],
    env: { ...postgres.env, ANCHORD_JOBS_LEASE_S: '1' },
  });
  call = checked(server, contract);
  await allow_workers(postgres);
  await call('POST', '/api/v1/campaigns', { expect: 201, json: { name: 'campaign' } });
  await call('POST', '/api/v1/campaigns/campaign/samples', {
    expect: 200,
    headers: { 'content-type': 'text/csv' },
    body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
  });
  await call('POST', '/api/v1/datasets', {
    expect: 201,
    json: { name: 'set', campaigns: ['campaign'], aggregation: 'none', split: { test: ['room 6'] } },
  });
});
after(async () => {
  await endWorkers();
  await server?.dispose();
  await postgres?.dispose();
});

test('a worker makes the bytes that the server makes, and the server signs them', async () => {
  const here = await begin(quick);
  assert.match((await succeeds(here)).worker, /^server /);
  await server.stop();
  server.env.ANCHORD_JOBS_RUN_HERE = 'off';
  await server.start();
  const there = await begin(quick);
  // As if a server of another version had handed it out: this one does it again, or nobody would ever claim it.
  await postgres.psql("UPDATE work SET version = '0.0.1'", 'anchord');
  await eventually(
    'it is handed out anew',
    async () => (await postgres.psql('SELECT version FROM work', 'anchord')) !== '0.0.1',
  );
  // Nobody is there: with a minute gone by the page says so, and the first worker to come takes it.
  await postgres.psql('UPDATE work SET open_t_ns = open_t_ns - 61000000000', 'anchord');
  const alarm = await eventually('an alarm', async () =>
    (await call('GET', '/api/v1/alarms', { expect: 200 })).json.items.find(({ id }) => id === 'jobs.no_worker'),
  );
  assert.match(alarm.text, /no worker has been seen for one minute/);
  const worker = await started('first');
  const job = await succeeds(there);
  assert.deepEqual([job.worker, job.attempts], ['first', 1]);
  assert.equal(await artifact_of(there), await artifact_of(here));
  assert.match(await artifact_of(there), /"signature":"made:/);
  await eventually('the alarm ends', async () =>
    (await call('GET', '/api/v1/alarms', { expect: 200 })).json.items.every(({ id }) => id !== 'jobs.no_worker'),
  );
  const looked = await run(['doctor', '--json', '--database', postgres.url('anchord'), '--data-dir', server.dataDir], {
    env: postgres.env,
  });
  assert.match(JSON.parse(looked.stdout).find(({ what }) => what === 'worker').seen, /^first, .*waiting for jobs/);
  assert.deepEqual(await worker.end(), { code: 0, signal: null });
  assert.equal(await postgres.psql('SELECT count(*) FROM worker', 'anchord'), '0');
});

test('a worker that is killed in the middle is taken over, and there is one result', async () => {
  const one = await started('one');
  const id = await begin(some_seconds);
  await one.freeze();
  const two = await started('two');
  await one.end('SIGKILL');
  await two.freeze();
  await taken_over(id, two);
  two.thaw();
  const job = await succeeds(id);
  assert.deepEqual([job.worker, job.attempts], ['two', 2]);
  assert.equal(await models_of(id), 1);
  const events = (await call('GET', '/api/v1/events', { expect: 200 })).json.items;
  const told = events.find(({ code }) => code === 'job.taken_over');
  assert.match(told.text, /worker one no longer answered; attempt 2 of 3 is of two/);
  await two.end();
});

test('a worker that slept for longer than its lease finds its job taken, and stores nothing', async () => {
  const sleeper = await started('sleeper');
  const id = await begin(some_seconds);
  await sleeper.freeze();
  const other = await started('other');
  sleeper.child.kill('SIGSTOP');
  await other.freeze();
  await taken_over(id, other);
  sleeper.child.kill('SIGCONT');
  sleeper.thaw();
  await sleeper.says('job taken over');
  other.thaw();
  const job = await succeeds(id);
  assert.deepEqual([job.worker, job.attempts], ['other', 2]);
  assert.equal(await models_of(id), 1);
  assert.ok(!sleeper.log.includes('job done'), sleeper.log);
  await sleeper.end();
  await other.end();
});

test('a run is canceled on its worker, whose process ends with it', async () => {
  const worker = await started('canceled');
  const id = await begin(endless);
  await computes(id, worker);
  assert.equal(worker.computing().length, 1);
  await call('DELETE', `/api/v1/jobs/${id}`);
  await becomes(id, 'is canceled', ({ state }) => state === 'canceled');
  await eventually('nothing computes', () => worker.computing().length === 0);
  // Canceled before anybody has it: at once.
  await worker.end();
  const waits = await begin(endless);
  await call('DELETE', `/api/v1/jobs/${waits}`);
  await becomes(waits, 'is canceled', ({ state }) => state === 'canceled');
});

test('neither a killed server nor a restarted database loses a run', async () => {
  const worker = await started('patient');
  const id = await begin(some_seconds);
  await worker.freeze();
  await server.kill();
  await postgres.stop();
  await postgres.start();
  worker.thaw();
  await server.start();
  const job = await succeeds(id);
  assert.equal(job.worker, 'patient');
  assert.equal(await models_of(id), 1);
  await worker.end();
});

test('three attempts that die are enough, and the job says what they died of', async () => {
  const worker = await started('unlucky');
  const id = await begin(endless);
  for (let attempt = 1; attempt <= 3; ++attempt) {
    await becomes(id, `begins ${attempt} times`, (job) => job.attempts === attempt && job.progress.stage === 'search');
    process.kill(Number(worker.computing()[0]), 'SIGKILL');
  }
  const job = await becomes(id, 'fails', ({ state }) => state === 'failed');
  assert.match(job.problem.detail, /signal 9 .*no memory left.*attempt 3, the last one/);
  // Begun anew by a person it has three attempts again.
  await call('POST', `/api/v1/training-runs/${id}/restart`, { expect: 202 });
  await becomes(id, 'runs again', (again) => again.state === 'running' && again.attempts === 1);
  await call('DELETE', `/api/v1/jobs/${id}`);
  await becomes(id, 'is canceled', ({ state }) => state === 'canceled');
  await worker.end();
});
