// Calibrations on workers of other processes, over a real PostgreSQL: what is stored is the same wherever it was solved; workers that
// are killed, results that were tampered with, cancel, and restarts of the server.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { deflateSync, inflateSync } from 'node:zlib';
import { Contract, checked } from './contract.mjs';
import { ndjson, simulatedFlight } from './flight.mjs';
import { startPostgres } from './postgres.mjs';
import { eventually, startServer } from './server.mjs';
import { allow_workers, endWorkers, startWorker } from './worker.mjs';

const contract = new Contract();
let postgres, server, call, mission;
const started = (name) => startWorker(postgres, name);
/** Takes some seconds: long enough to be interrupted. */
const slow = { iterations: 20 };

const job_of = async (id) => (await call('GET', `/api/v1/jobs/${id}`, { expect: 200 })).json;
const begin = async (more = {}) =>
  (await call('POST', '/api/v1/calibrations', { expect: 202, json: { missions: [mission], ...more } })).json.id;
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
const ends = (id) => becomes(id, 'ends', ({ state }) => !['queued', 'running'].includes(state));
const succeeds = async (id) => {
  const job = await ends(id);
  assert.equal(job.state, 'succeeded', JSON.stringify(job));
  return job;
};
const held_by = (id, worker, attempts) =>
  becomes(id, `is held by ${worker.name}`, (job) => job.worker === worker.name && job.attempts === attempts);
const solved = (worker) => eventually('it is solved', () => worker.log.includes('job done'), 120_000);
const hex = (id) => id.replaceAll('-', '');
const stored = async (id) =>
  Number(await postgres.psql(`SELECT count(*) FROM calibration WHERE encode(id, 'hex') = '${hex(id)}'`, 'anchord'));
/** All of a calibration, and what only its report shows, but for what is of its run. */
async function whole(id) {
  const { json } = await call('GET', `/api/v1/calibrations/${id}`, { expect: 200 });
  for (const key of ['id', 'created_at', 'worker', 'attempts']) {
    assert.ok(key in json, key);
    delete json[key];
  }
  const evidence = await postgres.psql(
    `SELECT md5(evidence_json) FROM calibration JOIN calibration_evidence USING (calibration_key) WHERE encode(id, 'hex') = '${hex(id)}'`,
    'anchord',
  );
  return JSON.stringify(json).replaceAll(id, 'ID') + evidence;
}
async function run_here(value) {
  await server.stop();
  server.env.ANCHORD_JOBS_RUN_HERE = value;
  await server.start();
}

before(async () => {
  postgres = await startPostgres();
  await postgres.psql('CREATE DATABASE anchord');
  server = await startServer({
    args: ['--database', postgres.url('anchord')],
    env: { ...postgres.env, ANCHORD_JOBS_LEASE_S: '1' },
  });
  call = checked(server, contract);
  await allow_workers(postgres);
  const flight = await simulatedFlight({ duration: 120 });
  mission = (await call('POST', '/api/v1/missions', { expect: 201, json: flight.mission })).json.id;
  for (const rows of ['fixes', 'ranges'])
    await call('POST', `/api/v1/${rows}`, {
      expect: 200,
      headers: { 'content-type': 'application/x-ndjson' },
      body: ndjson(flight[rows].map((row) => ({ ...row, mission }))),
    });
  await call('POST', `/api/v1/missions/${mission}/actions`, { json: { action: 'finish' } });
});
after(async () => {
  await endWorkers();
  await server?.dispose();
  await postgres?.dispose();
});

test('a worker stores the very calibration that the server stores', async () => {
  await succeeds(await begin()); // from here on the kit has its profile
  const here = await begin({ iterations: 5 });
  assert.match((await succeeds(here)).worker, /^server /);
  await run_here('off');
  const worker = await started('first');
  const there = await begin({ iterations: 5 });
  const done = await succeeds(there);
  assert.deepEqual([done.worker, done.attempts], ['first', 1]);
  const { json } = await call('GET', `/api/v1/calibrations/${there}`, { expect: 200 });
  assert.deepEqual([json.worker, json.attempts], ['first', 1]);
  assert.ok(json.anchors.length > 3 && json.anchors.every(({ enu_m }) => enu_m));
  assert.equal(await whole(there), await whole(here));
  const published = await call('POST', `/api/v1/calibrations/${there}/publish`, {
    json: { reason: 'a test', anchors: json.anchors.map(({ network_id }) => network_id) },
  });
  assert.ok([200, 201].includes(published.status), published.text);
  assert.equal(await postgres.psql('SELECT count(*) FROM work', 'anchord'), '0');
  await worker.end();
});

test('a worker that is killed in the middle is taken over, and there is one calibration', async () => {
  const one = await started('one');
  const id = await begin(slow);
  await one.freeze();
  const two = await started('two');
  await one.end('SIGKILL');
  await two.freeze();
  await held_by(id, two, 2);
  two.thaw();
  const job = await succeeds(id);
  assert.deepEqual([job.worker, job.attempts], ['two', 2]);
  assert.equal(await stored(id), 1);
  const events = (await call('GET', '/api/v1/events', { expect: 200 })).json.items;
  const told = events.find(({ code, text }) => code === 'job.taken_over' && text.includes(id));
  assert.match(told.text, /\(calibration\): worker one no longer answered; attempt 2 of 3 is of two/);
  await two.end();
});

test('two workers solve two calibrations at once', async () => {
  const workers = [await started('left'), await started('right')];
  const ids = [await begin(slow), await begin(slow)];
  await Promise.all(workers.map((worker) => worker.freeze()));
  const jobs = await Promise.all(ids.map((id) => becomes(id, 'runs', ({ state }) => state === 'running')));
  assert.deepEqual(jobs.map(({ worker }) => worker).sort(), ['left', 'right']);
  workers.forEach((worker) => worker.thaw());
  const [a, b] = await Promise.all(ids.map(succeeds)).then(() => Promise.all(ids.map(whole)));
  assert.equal(a, b);
  await Promise.all(workers.map((worker) => worker.end()));
});

test('a calibration is canceled on its worker, whose process ends with it', async () => {
  const worker = await started('canceled');
  const id = await begin(slow);
  await worker.freeze();
  await held_by(id, worker, 1);
  await call('DELETE', `/api/v1/jobs/${id}`); // a solve that does not answer is killed
  await becomes(id, 'is canceled', ({ state }) => state === 'canceled');
  await eventually('nothing computes', () => worker.computing().length === 0);
  assert.equal(await stored(id), 0);
  await worker.end();
  // Canceled before anybody has it: at once.
  const waits = await begin(slow);
  await call('DELETE', `/api/v1/jobs/${waits}`);
  await becomes(waits, 'is canceled', ({ state }) => state === 'canceled');
  assert.equal(await postgres.psql('SELECT count(*) FROM work', 'anchord'), '0');
});

test('neither a killed server nor a restarted database loses a calibration', async () => {
  const worker = await started('patient');
  const id = await begin(slow);
  await worker.freeze();
  await held_by(id, worker, 1);
  await server.kill();
  await postgres.stop();
  await postgres.start();
  worker.thaw();
  await solved(worker);
  await server.start();
  assert.equal((await succeeds(id)).worker, 'patient');
  assert.equal(await stored(id), 1);
  await worker.end();
});

test('a server of another version reads the flights again and hands them out anew', async () => {
  const id = await begin();
  const waiting = () => postgres.psql('SELECT version FROM work', 'anchord');
  const version = await eventually('it waits', waiting);
  await server.stop();
  // As if the former version had handed out one, and solved another.
  await postgres.psql("UPDATE work SET version = '0.0.1', message = 'of another form'", 'anchord');
  await server.start();
  await eventually('it is handed out anew', async () => (await waiting()) === version);
  await postgres.psql("UPDATE work SET version = '0.0.1', state = 2, result = 'of another form'", 'anchord');
  await eventually('it is handed out anew', async () => (await waiting()) === version);
  const worker = await started('newer');
  await succeeds(id);
  await worker.end();
});

test('the server refuses what a worker made up, says what is wrong with it, and stores nothing', async () => {
  const worker = await started('honest');
  const source = await begin();
  await worker.freeze();
  await server.stop();
  worker.thaw();
  await solved(worker);
  const good = await postgres.psql('SELECT result FROM work', 'anchord');
  await server.start();
  await succeeds(source);
  await worker.end();
  /** Another job of the same flight ends with this. */
  const answered = async (result) => {
    const id = await begin();
    await eventually('it waits', () => postgres.psql('SELECT 1 FROM work', 'anchord'));
    await postgres.psql(
      `UPDATE work SET state = 2, worker = 'stranger', attempts = 1, result = '${result}'`,
      'anchord',
    );
    return { id, ...(await ends(id)) };
  };
  const changed = (change) => {
    const bytes = inflateSync(Buffer.from(good, 'base64'));
    return deflateSync(change(bytes) ?? bytes).toString('base64');
  };
  assert.equal((await answered(good)).state, 'succeeded', 'what is tampered with below is accepted as it was');
  // The answer: number of flights, number of anchors, then the first anchor's id and, where it is ok, 18 bytes on, its place.
  const anchor_at = 16;
  const strange = {
    'anchor 0xbeef: no range of the flight names it': (bytes) => void bytes.writeUInt32LE(0xbeef, anchor_at),
    'a number is not finite': (bytes) => void bytes.writeDoubleLE(NaN, anchor_at + 4 + 18),
    'at most 200 are allowed': (bytes) => void bytes.writeBigUInt64LE(1_000_000n, 0),
    'more than': (bytes) => Buffer.concat([bytes, Buffer.alloc(300 << 20)]),
    'cut off': (bytes) => bytes.subarray(0, bytes.length / 2),
  };
  for (const [why, change] of Object.entries(strange)) {
    const job = await answered(changed(change));
    assert.equal(job.state, 'failed', why);
    assert.match(job.problem.detail, /^the result of worker stranger is refused: .*; nothing of it is stored$/);
    assert.ok(job.problem.detail.includes(why), `${why}: ${job.problem.detail}`);
    assert.equal(await stored(job.id), 0, why);
  }
});

test('a worker that is not there keeps nobody waiting where the server may run jobs', async () => {
  const ghost = await started('ghost');
  await run_here('on');
  await ghost.end('SIGKILL'); // seen a moment ago
  assert.match((await succeeds(await begin())).worker, /^server /);
});
