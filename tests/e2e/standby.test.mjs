// Two servers of one real PostgreSQL behind a real HAProxy: one has the database, the other takes over when it ends, however it ends.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { LiveClient } from './live.mjs';
import { free_tcp_port, free_udp_port } from './ports.mjs';
import { startPostgres } from './postgres.mjs';
import { eventually, root, run, Server } from './server.mjs';
import { startAircraft, startFlight } from './simulated_aircraft.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord standby '));
let postgres, proxy, front, udp, holder, waiting;

/** One that stands by; `there` resolves when it has the database. */
function standBy(port) {
  const args = ['--standby', '--database', postgres.url('anchord'), '--drone-address', `udp://:${udp}`];
  const server = new Server({ args, env: postgres.env });
  server.port = port;
  server.there = server.start(120_000);
  server.there.catch(() => {});
  return server;
}
const stands = (server) => eventually('it stands by', () => server.log.includes('standing by'), 20_000);
const rows_of = (mission) =>
  postgres
    .psql(
      `SELECT count(*), count(DISTINCT seq) FROM uwb_range JOIN mission USING (mission_key) WHERE id = '\\x${mission.replaceAll('-', '')}'`,
      'anchord',
    )
    .then((text) => text.split('|').map(Number));
const passed_s = (since) => (performance.now() - since) / 1000;

before(async () => {
  udp = await free_udp_port();
  postgres = await startPostgres();
  await postgres.psql('CREATE DATABASE anchord');
  const ports = [await free_tcp_port(), await free_tcp_port()],
    sample = readFileSync(join(root, 'docs/examples/haproxy.cfg'), 'utf8'),
    changes = [
      [/bind .* ssl crt .*/, (front = `127.0.0.1:${await free_tcp_port()}`)],
      ['127.0.0.1:8420', `127.0.0.1:${ports[0]}`],
      ['127.0.0.1:8421', `127.0.0.1:${ports[1]}`],
    ];
  let text = sample.replace(changes[0][0], `bind ${front}`);
  for (const [from, to] of changes.slice(1)) {
    assert.ok(text.includes(from), from);
    text = text.replace(from, to);
  }
  writeFileSync(join(folder, 'haproxy.cfg'), text);
  holder = standBy(ports[0]);
  await holder.there;
  waiting = standBy(ports[1]);
  await stands(waiting);
  proxy = spawn('haproxy', ['-f', join(folder, 'haproxy.cfg'), '-db'], { stdio: 'ignore' });
  await eventually('HAProxy has found it', () => fetch(`http://${front}/readyz`).then((r) => r.ok, () => false)); // prettier-ignore
});
after(async () => {
  proxy?.kill('SIGTERM');
  for (const server of [holder, waiting]) await server?.dispose();
  await postgres?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

const through = (path, init) => fetch(`http://${front}${path}`, { ...init, signal: AbortSignal.timeout(5000) });
async function made_mission(name) {
  const answer = await through('/api/v1/missions', {
    method: 'POST',
    headers: { 'content-type': 'application/json' },
    body: JSON.stringify({ name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] }),
  });
  assert.equal(answer.status, 201);
  return (await answer.json()).id;
}
/** Ranges numbered from `from`; true: they were acknowledged. */
async function sent(mission, from, n) {
  const list = Array.from({ length: n }, (_, i) => ({
    t_us: 1_790_000_000_000_000 + (from + i) * 1000,
    seq: from + i,
    tag: '0x6e01',
    anchor: '0x6a21',
    distance_m: 10,
  }));
  try {
    const answer = await through(`/api/v1/ranges?mission=${mission}`, {
      method: 'POST',
      headers: { 'content-type': 'application/x-ndjson' },
      body: list.map((row) => JSON.stringify(row)).join('\n'),
    });
    const { accepted = 0, duplicates = 0 } = answer.ok ? await answer.json() : {};
    return accepted + duplicates === n;
  } catch {
    return false;
  }
}
/** HAProxy looks twice a second. */
const found = () => eventually('HAProxy has found the holder', () => through('/readyz').then((r) => r.ok, () => false), 20_000, 100); // prettier-ignore
/** The one that ended starts again, and stands by. */
async function change_places(ended) {
  [holder, waiting] = [waiting, ended];
  const { port } = ended;
  await ended.dispose();
  waiting = standBy(port);
  await stands(waiting);
  await found();
}

test('the metrics of the one that has the database say whether another waits', async () => {
  const waits = async () => /^anchord_standby_waiting 1$/m.test(await (await holder.fetch('/metrics')).text());
  await eventually('the holder has heard of it', waits);
});

test('a second server that does not stand by is refused with what to do, and the first one goes on', async () => {
  const second = await run(
    ['serve', '--listen', '127.0.0.1:0', '--data-dir', join(folder, 'second'), '--database', postgres.url('anchord')],
    { env: postgres.env },
  );
  assert.equal(second.code, 1, second.stderr);
  assert.match(second.stderr, /has this database: stop it, or start this one with --standby/);
  assert.equal((await through('/readyz')).status, 200);
  const seen = await run(['doctor', '--database', postgres.url('anchord'), '--data-dir', join(folder, 'doctor')], {
    env: postgres.env,
  });
  assert.match(seen.stdout, new RegExp(`server \\S+/${holder.pid}, standby \\S+/${waiting.pid}`));
  const health = (...more) =>
    run(['healthcheck', '--url', `http://127.0.0.1:${waiting.port}`, ...more], { env: postgres.env });
  assert.equal((await health()).code, 1, 'it listens on no port');
  const healthy = await health('--database', postgres.url('anchord'));
  assert.equal(healthy.code, 0, healthy.stderr);
  assert.match(healthy.stdout, new RegExp(`standing by for \\S+/${holder.pid}`));
  const alone = await run(['serve', '--standby', '--data-dir', join(folder, 'alone')]);
  assert.equal(alone.code, 2);
  assert.match(alone.stderr, /standby: a folder has one server; give --database/);
});

test('one that is killed under load is taken over from: no acknowledged row is missing, none is there twice', async () => {
  const mission = await made_mission('killed');
  const acknowledged = [];
  let next = 0;
  for (; next < 2000; next += 100) if (await sent(mission, next, 100)) acknowledged.push(next);
  assert.equal(acknowledged.length, 20);
  const live = await LiveClient.open({ url: `http://${front}` });
  live.send({ op: 'sub', id: 1, topic: 'events' });
  const ended = holder,
    since = performance.now();
  const killing = new Promise((done) => setTimeout(done, 150)).then(() => ended.kill());
  const open = new Set();
  for (let from = next; performance.now() - since < 4000; from = next += 100)
    if (!(await sent(mission, from, 100))) {
      open.add(from);
      await new Promise((done) => setTimeout(done, 50));
    }
  await killing;
  await waiting.there;
  const taken_s = passed_s(since);
  assert.ok(taken_s < 12, `${taken_s} s`);
  console.log(`taken over after ${taken_s.toFixed(1)} s; ${open.size} batches were sent again`);
  for (const from of open) await eventually('the batch', () => sent(mission, from, 100), 20_000, 100);
  assert.deepEqual(await rows_of(mission), [next, next]);
  assert.equal((await (await through(`/api/v1/missions/${mission}`)).json()).state, 'recording');
  await live.closed; // and a client that connects again is with the other one
  const again = await LiveClient.open({ url: `http://${front}` });
  again.socket.terminate();
  await change_places(ended);
});

test('one that is stopped gives the database back: the other one need not wait', async () => {
  const ended = holder,
    since = performance.now();
  assert.equal((await ended.stop()).code, 0);
  await waiting.there;
  console.log(`stopped and taken over after ${passed_s(since).toFixed(1)} s`);
  assert.doesNotMatch(ended.log, /ending: another server has the database/);
  await change_places(ended);
});

test('one that stood still and comes back stores nothing more, and ends', async () => {
  const mission = await made_mission('stood still'),
    ended = holder,
    own = `http://127.0.0.1:${ended.port}/api/v1/ranges?mission=${mission}`;
  process.kill(ended.pid, 'SIGSTOP');
  // What comes to it while it stands still is in its sockets, and is the first that it does when it goes on.
  const body = JSON.stringify({ t_us: 1_790_000_000_000_000, seq: 1, tag: '0x6e01', anchor: '0x6a21', distance_m: 10 });
  const late = fetch(own, { method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body }).then(
    async (answer) => ({ status: answer.status, ...(await answer.json()) }),
    () => ({ status: 0 }),
  );
  await waiting.there;
  assert.deepEqual(await rows_of(mission), [0, 0]);
  process.kill(ended.pid, 'SIGCONT');
  const answer = await late;
  assert.ok(answer.status === 0 || answer.status === 503, JSON.stringify(answer));
  const { code } = await ended.exited;
  assert.equal(code, 1, 'a service manager starts it again');
  assert.match(ended.log, /ending: another server has the database/);
  assert.deepEqual(await rows_of(mission), [0, 0]);
  await found();
  assert.ok(await sent(mission, 1, 1), 'the other one takes the same row');
  await change_places(ended);
});

test('a flight in the air holds when its server is killed, and goes on when somebody resumes it on the other one', async () => {
  // The aircraft's link is of this machine: whoever has the database hears it.
  const { aircraft, mission } = await startAircraft(`http://${front}`, udp);
  try {
    await startFlight(holder, mission);
    const ended = holder,
      since = performance.now();
    await ended.kill();
    await waiting.there;
    const procedure = async () => (await waiting.fetch(`/api/v1/missions/${mission}/procedure`)).json();
    await eventually('it holds', async () => (await procedure()).status === 'hold', 20_000, 100);
    console.log(`in hold on the other server after ${passed_s(since).toFixed(1)} s`);
    const control = await waiting.fetch(`/api/v1/missions/${mission}/control`, { json: { action: 'take' } });
    const { lease } = await control.json();
    const resumed = await waiting.fetch(`/api/v1/missions/${mission}/actions`, { json: { action: 'resume', lease } });
    assert.equal(resumed.status, 202, await resumed.text());
    await eventually('it goes on', async () => (await procedure()).status === 'running', 20_000, 100);
    await change_places(ended);
  } finally {
    aircraft.kill('SIGINT');
  }
});

test('a database that cuts off all its sessions, as by a restart, ends neither of them', async () => {
  const others = 'SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid()';
  await postgres.psql(`${others} AND datname = 'anchord'`);
  await found();
  assert.ok(await made_mission('cut off'));
  assert.equal(holder.child.exitCode, null);
  assert.equal(waiting.child.exitCode, null);
});

test('one whose database answers nothing ends although a write of it is under way, and the other one takes over', async () => {
  const ended = holder,
    mission = await made_mission('hangs'),
    renewed = () => postgres.psql("SELECT lease_t_ns FROM server_lease WHERE standby <> ''", 'anchord');
  const before_it = await eventually('another one is seen to stand by', renewed);
  await eventually('the holder has seen it too', async () => (await renewed()) !== before_it);
  try {
    postgres.signalAll('SIGSTOP');
    assert.equal(await sent(mission, 1, 1), false);
    await eventually('it ends', () => ended.child.exitCode !== null, 60_000, 100);
  } finally {
    postgres.signalAll('SIGCONT');
  }
  assert.equal(ended.child.exitCode, 1);
  await eventually('its last line', () => ended.log.includes('ended without what it waited for'));
  await waiting.there;
  await found();
  assert.ok(await sent(mission, 1, 1));
  await change_places(ended);
});

test('while the database is away for longer than the lease the holder ends, and the other one takes over when it is back', async () => {
  const ended = holder,
    renewed = () => postgres.psql("SELECT lease_t_ns FROM server_lease WHERE standby <> ''", 'anchord');
  const before_it = await eventually('another one is seen to stand by', renewed);
  await eventually('the holder has seen it too', async () => (await renewed()) !== before_it);
  await postgres.stop();
  assert.equal((await ended.exited).code, 1);
  assert.match(ended.log, /out of reach, and another server stands by/);
  await postgres.start();
  await waiting.there;
  assert.match(ended.log, /ending: another server has the database/);
});
