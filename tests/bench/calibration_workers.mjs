// Calibrations of a centre with and without a worker, on PostgreSQL: processor time of the server's process, of the children that solve for it,
// of the worker's, and of the database, each for one calibration.
//   node tests/bench/calibration_workers.mjs [N] [SECONDS OF FLIGHT]        ANCHORD_BINARY names the server
import { readdirSync, readFileSync } from 'node:fs';
import { ndjson, simulatedFlight } from '../e2e/flight.mjs';
import { startPostgres } from '../e2e/postgres.mjs';
import { startServer } from '../e2e/server.mjs';
import { allow_workers, endWorkers, startWorker } from '../e2e/worker.mjs';

const n = Number(process.argv[2] ?? 10),
  duration = Number(process.argv[3] ?? 1200);

/** User and system seconds of a process, and of its children that have ended. */
function used(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ')[1].split(' ').map(Number);
  return { own: (fields[11] + fields[12]) / 100, children: (fields[13] + fields[14]) / 100 };
}
function of_database() {
  let sum = 0;
  for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      if (readFileSync(`/proc/${pid}/comm`, 'utf8').startsWith('postgres')) sum += used(pid).own;
    } catch {
      // it ended while we looked
    }
  }
  return sum;
}

const postgres = await startPostgres();
await postgres.psql('CREATE DATABASE anchord');
const args = ['--rate-per-s', '100000', '--rate-burst', '100000'];
const on_postgres = { auth: 'off', args: [...args, '--database', postgres.url('anchord')], env: postgres.env };
const flight = await simulatedFlight({ duration });
console.log(`${n} calibrations of ${flight.ranges.length} ranges and ${flight.fixes.length} positions`);
console.log('| where | s | server | its children | worker and its children | database |');
console.log('| --- | --- | --- | --- | --- | --- |');

async function measure(where, server, worker) {
  const send = async (path, body, type = 'application/json') => {
    const answer = await server.fetch(path, { method: 'POST', headers: { 'content-type': type }, body });
    if (!answer.ok) throw new Error(`${path}: ${answer.status} ${(await answer.text()).slice(0, 300)}`);
    return answer.json();
  };
  const { id: mission } = await send('/api/v1/missions', JSON.stringify(flight.mission));
  for (const rows of ['fixes', 'ranges'])
    for (let from = 0; from < flight[rows].length; from += 20_000)
      await send(
        `/api/v1/${rows}`,
        ndjson(flight[rows].slice(from, from + 20_000).map((row) => ({ ...row, mission }))),
        'application/x-ndjson',
      );
  await send(`/api/v1/missions/${mission}/actions`, JSON.stringify({ action: 'finish' }));
  await new Promise((done) => setTimeout(done, 5000)); // what a landing starts by itself
  const look = () => ({
    at: performance.now() / 1000,
    server: used(server.pid),
    worker: worker ? used(worker.child.pid) : { own: 0, children: 0 },
    database: of_database(),
  });
  const before = look();
  for (let i = 0; i < n; i++) {
    const { id } = await send('/api/v1/calibrations', JSON.stringify({ missions: [mission] }));
    let job;
    do {
      await new Promise((done) => setTimeout(done, 100));
      job = await (await server.fetch(`/api/v1/jobs/${id}`)).json();
    } while (job.state === 'queued' || job.state === 'running');
    if (job.state !== 'succeeded') throw new Error(JSON.stringify(job));
    if (worker && job.worker !== worker.name) throw new Error(`solved by ${job.worker}`);
  }
  const after = look();
  const each = (of) => ((of(after) - of(before)) / n).toFixed(2);
  console.log(
    `| ${where} | ${each((x) => x.at)} | ${each((x) => x.server.own)} | ${each((x) => x.server.children)} | ` +
      `${each((x) => x.worker.own + x.worker.children)} | ${each((x) => x.database)} |`,
  );
}

try {
  let server = await startServer({ auth: 'off', args });
  await measure('SQLite, the server', server);
  await server.dispose();
  server = await startServer(on_postgres);
  await measure('PostgreSQL, the server', server);
  await allow_workers(postgres);
  await measure('PostgreSQL, a worker', server, await startWorker(postgres, 'bench'));
  await server.dispose();
} finally {
  await endWorkers();
  await postgres.dispose();
}
