// ./dev cluster: comes up, answers through HAProxy, trains on the worker, goes on when the server that has the database is killed, ends with
// all it started and begins again with the same rows.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { hostname, tmpdir } from 'node:os';
import { delimiter, join } from 'node:path';
import { after, before, test } from 'node:test';
import { quick } from './learning_bodies.mjs';
import { free_tcp_port } from './ports.mjs';
import { binary, eventually, root, run } from './server.mjs';

const absent = [
  ['haproxy', [...process.env.PATH.split(delimiter), '/usr/sbin'].some((at) => existsSync(join(at, 'haproxy')))],
  ['postgresql-15', existsSync('/usr/lib/postgresql/15/bin/initdb')],
].filter(([, there]) => !there);
if (absent.length > 0) {
  console.log(`SKIPPED: Debian packages ${absent.map(([name]) => name)} are not installed`);
  process.exit(0);
}

const folder = mkdtempSync(join(tmpdir(), 'anchord cluster '));
let ports, url, cluster, token;

/** As at a terminal: a process group of its own, which Ctrl-C reaches as a whole. */
function start() {
  const env = {
    ...process.env,
    ANCHORD_BINARY: binary,
    ANCHORD_CLUSTER_DIR: folder,
    ANCHORD_CLUSTER_PORTS: ports.join(' '),
  };
  const child = spawn('./dev', ['cluster'], { cwd: root, env, detached: true, stdio: ['ignore', 'ignore', 'pipe'] });
  cluster = { child, log: '', exited: new Promise((done) => child.once('exit', (code) => done(code))) };
  child.stderr.setEncoding('utf8').on('data', (text) => (cluster.log += text));
  return eventually('the cluster is up', () => {
    assert.equal(child.exitCode, null, cluster.log);
    return cluster.log.includes('the cluster is up');
  }, 180_000); // prettier-ignore
}
/** Process ids of it and of everything below it. */
function family(pid) {
  const children = readdirSync('/proc').filter((name) => {
    if (!/^\d+$/.test(name)) return false;
    try {
      return new RegExp(`^PPid:\\s+${pid}$`, 'm').test(readFileSync(`/proc/${name}/status`, 'utf8'));
    } catch {
      return false; // it ended meanwhile
    }
  });
  return [pid, ...children.flatMap((child) => family(Number(child)))];
}
/** Names of those that are there still. */
const alive = (pids) =>
  pids.flatMap((pid) => {
    try {
      const status = readFileSync(`/proc/${pid}/status`, 'utf8');
      return /^State:\s+Z/m.test(status) ? [] : [/^Name:\s+(.*)$/m.exec(status)[1]];
    } catch {
      return [];
    }
  });
async function end(signal) {
  const all = family(cluster.child.pid);
  assert.ok(all.length >= 7, 'PostgreSQL and its sessions, two servers, a worker, HAProxy');
  process.kill(-cluster.child.pid, signal);
  const code = await cluster.exited;
  assert.deepEqual(alive(all), []);
  return code;
}

/** Through HAProxy, as a client that trusts the authority of the cluster. */
async function through(path, json) {
  const args = ['-sS', '--max-time', '20', '--cacert', join(folder, 'tls/ca.pem'), '-w', '\n%{http_code}'];
  args.push('-H', `Authorization: Bearer ${token}`);
  if (json) args.push('-H', 'Content-Type: application/json', '-d', JSON.stringify(json));
  return new Promise((done) => {
    execFile('curl', [...args, url + path], (error, stdout) => {
      const end = stdout.lastIndexOf('\n');
      const status = error ? 0 : Number(stdout.slice(end + 1));
      done({ status, text: stdout.slice(0, end), json: () => JSON.parse(stdout.slice(0, end)) });
    });
  });
}
/** What doctor shows of the database. */
async function seen() {
  const address = `postgresql://anchord@127.0.0.1:${ports[3]}/anchord`;
  const { stdout } = await run(['doctor', '--json', '--database', address, '--data-dir', join(folder, 'first')], {
    env: { PGPASSFILE: join(folder, 'secrets/server.pgpass') },
  });
  const all = JSON.parse(stdout),
    database = all.find(({ what }) => what === 'database').seen;
  const pid = (what) => Number(new RegExp(`, ${what} [^,/]+/(\\d+)`).exec(database)?.[1]);
  return { holder: pid('server'), standby: pid('standby'), worker: all.find(({ what }) => what === 'worker')?.seen };
}
const made = async (path, json) => {
  const answer = await through(path, json);
  assert.ok(answer.status >= 200 && answer.status < 300, `${path}: ${answer.status} ${answer.text}`);
  return answer.json();
};

before(async () => {
  ports = [];
  while (ports.length < 5) ports.push(await free_tcp_port());
  url = `https://127.0.0.1:${ports[0]}`;
  await start();
  token = readFileSync(join(folder, 'first/admin.token'), 'utf8').trim();
});
after(async () => {
  cluster?.child.kill('SIGTERM');
  await cluster?.exited;
  rmSync(folder, { recursive: true, force: true });
});

test('it answers through HAProxy, to who has a token', async () => {
  assert.equal((await through('/readyz')).status, 200);
  assert.equal((await through('/api/v1/missions')).status, 200);
  const right = token;
  token = 'anc_wrong';
  assert.equal((await through('/api/v1/missions')).status, 401);
  token = right;
  const { holder, standby, worker } = await seen();
  assert.ok(holder > 0 && standby > 0 && holder !== standby);
  assert.match(worker, /waiting for jobs/);
  const asked = await run(
    ['healthcheck', '--worker', '--database', `postgresql://anchord_worker@127.0.0.1:${ports[3]}/anchord`],
    {
      env: { PGPASSFILE: join(folder, 'secrets/worker.pgpass') },
    },
  );
  assert.equal(asked.code, 0, asked.stderr);
  assert.ok(asked.stdout.startsWith(`worker ${hostname()}/`), asked.stdout);
});

test('a training run is of the worker', async () => {
  await made('/api/v1/campaigns', { name: 'campaign' });
  const csv = readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8');
  const [head, ...rows] = csv.trim().split('\n');
  assert.ok(head && rows.length > 10);
  await new Promise((done, fail) => {
    const args = ['-fsS', '--cacert', join(folder, 'tls/ca.pem'), '-H', `Authorization: Bearer ${token}`];
    args.push('-H', 'Content-Type: text/csv', '--data-binary', `@${join(root, 'docs/examples/campaign.csv')}`);
    execFile('curl', [...args, `${url}/api/v1/campaigns/campaign/samples`], (error) => (error ? fail(error) : done()));
  });
  await made('/api/v1/datasets', {
    name: 'set',
    campaigns: ['campaign'],
    aggregation: 'none',
    split: { test: ['room 6'] },
  });
  const { id } = await made('/api/v1/training-runs', quick);
  const job = await eventually('the job ends', async () => {
    const one = (await through(`/api/v1/jobs/${id}`)).json();
    return !['queued', 'running'].includes(one.state) && one;
  }, 60_000, 200); // prettier-ignore
  assert.equal(job.state, 'succeeded');
  assert.ok(job.worker.startsWith(`${hostname()}/`), job.worker); // a run of the server has "server" before it
});

test('when the server that has the database is killed the other one answers, and the killed one comes back to stand by', async () => {
  const { id } = await made('/api/v1/sites', { name: 'kept', origin: { lon: 3.7, lat: 51, h_m: 50 } });
  const before_it = await seen(),
    since = performance.now();
  process.kill(before_it.holder, 'SIGKILL');
  await eventually('it answers again', async () => (await through(`/api/v1/sites/${id}`)).status === 200, 30_000, 100);
  console.log(`answers again after ${((performance.now() - since) / 1000).toFixed(1)} s`);
  const after_it = await eventually('the other one stands by', async () => {
    const now = await seen();
    return now.standby > 0 && now.standby !== before_it.standby && now;
  }, 30_000, 200); // prettier-ignore
  assert.equal(after_it.holder, before_it.standby);
  assert.notEqual(after_it.standby, before_it.holder);
  assert.match(cluster.log, /(first|second) ended, and is started again/);
});

test('Ctrl-C ends all of it in order, and a second start goes on with the same rows', async () => {
  assert.equal(await end('SIGINT'), 130);
  const last = readFileSync(join(folder, 'postgresql.log'), 'utf8');
  assert.match(last, /received fast shutdown request[^]*database system is shut down/);
  for (const name of ['first', 'second', 'worker'])
    assert.match(
      readFileSync(join(folder, `${name}.log`), 'utf8')
        .trim()
        .split('\n')
        .at(-1),
      /"stopped"/,
      name,
    );
  await start();
  assert.ok((await through('/api/v1/sites')).json().items.some(({ name }) => name === 'kept'));
  assert.equal(await end('SIGTERM'), 143);
});
