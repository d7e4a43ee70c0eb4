// The server on a real PostgreSQL: from the first row to what is published and exported, over a restart of the database in flight, and
// what is said when it cannot be used.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { ndjson, simulatedFlight } from './flight.mjs';
import { LiveClient } from './live.mjs';
import { startPostgres } from './postgres.mjs';
import { binary, eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord postgres e2e '));
let postgres, server, flight;
const get = async (path) => (await server.fetch(path)).json();
const post = async (path, json, headers) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};
const rows = (list) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(list) });
const serve = (url, { env = postgres.env, data = 'never served' } = {}) =>
  run(['serve', '--listen', '127.0.0.1:0', '--data-dir', join(folder, data), '--database', url], { env });

before(async () => {
  postgres = await startPostgres();
  await postgres.psql('CREATE DATABASE anchord');
  server = await startServer({ args: ['--database', postgres.url('anchord')], env: postgres.env });
  flight = await simulatedFlight({ duration: 60 });
  flight.ranges = flight.ranges.filter((row) => row.distance_m > 0); // Pozyx's failures
});
after(async () => {
  await server?.dispose();
  await postgres?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a flight is measured, calibrated, published and exported, and nothing of it is in a file of SQLite', async () => {
  const site = (await post('/api/v1/sites', { name: 'Hall' })).id;
  const mission = (await post('/api/v1/missions', { ...flight.mission, site })).id;
  for (const what of ['fixes', 'ranges']) {
    const answer = await server.fetch(`/api/v1/${what}?mission=${mission}`, rows(flight[what]));
    assert.equal((await answer.json()).accepted, flight[what].length);
    const again = await server.fetch(`/api/v1/${what}?mission=${mission}`, rows(flight[what]));
    assert.equal((await again.json()).duplicates, flight[what].length);
  }
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const solved = await post('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' });
  await post(`/api/v1/calibrations/${solved.id}/publish`, {});
  assert.ok((await get('/api/v1/anchors')).features.length >= 3);
  for (const path of ['/api/v1/anchors?format=gpkg', `/api/v1/missions/${mission}/bundle`]) {
    const answer = await server.fetch(path);
    assert.equal(answer.status, 200, `${path}: ${answer.status}`);
    assert.ok((await answer.arrayBuffer()).byteLength > 1000, path);
  }
  assert.equal(await postgres.psql('SELECT count(*) FROM uwb_range', 'anchord'), String(flight.ranges.length));
  assert.equal(existsSync(join(server.dataDir, 'anchord.db')), false);
});

test('backups are left to PostgreSQL, and a command that would open a file of SQLite is refused', async () => {
  const asked = await server.fetch('/api/v1/backups', { json: {} });
  assert.equal(asked.status, 422);
  assert.match((await asked.json()).detail, /pg_dump/);
  await server.stop();
  const at = ['--data-dir', server.dataDir];
  for (const [words, says] of [
    [['backup', ...at], /pg_dump/],
    [['token', 'list', ...at], /--database/],
    [['serve', '--listen', '127.0.0.1:0', ...at], /--database/],
  ]) {
    const ended = await run(words);
    assert.notEqual(ended.code, 0, words.join(' '));
    assert.match(ended.stderr, says);
  }
  assert.equal(existsSync(join(server.dataDir, 'anchord.db')), false);
  const there = [...at, '--database', postgres.url('anchord')];
  const made = await run(['token', 'create', '--name', 'reader', '--role', 'viewer', ...there], { env: postgres.env });
  assert.equal(made.code, 0, made.stderr);
  assert.equal(await postgres.psql('SELECT name FROM token', 'anchord'), 'reader');
  const looked = await run(['doctor', ...there], { env: postgres.env });
  assert.match(looked.stdout, /PostgreSQL 15/);
  await server.start();
});

test('a database that cannot be used ends the start with what to do, and the password is never said', async () => {
  await postgres.psql("CREATE DATABASE latin ENCODING 'LATIN1' TEMPLATE template0");
  await postgres.psql('CREATE DATABASE newer');
  await postgres.psql(
    'CREATE TABLE schema_migration (number BIGINT, name TEXT COLLATE "C", sha256_hex TEXT COLLATE "C");' +
      "INSERT INTO schema_migration SELECT n, 'x', 'x' FROM generate_series(1, 999) n",
    'newer',
  );
  for (const [url, options, says] of [
    [postgres.url('anchord', { port: 1 }), {}, /Connection refused/],
    [
      postgres.url('anchord'),
      { env: { PGPASSFILE: postgres.passfile('wrong password') } },
      /authentication failed.*pgpass/,
    ],
    [postgres.url('anchord'), { env: { PGPASSFILE: '/nowhere', HOME: '/nowhere' } }, /password.*pgpass/],
    [postgres.url('absent'), {}, /"absent" does not exist/],
    [postgres.url('latin'), {}, /LATIN1.*createdb --encoding=UTF8/],
    [postgres.url('newer'), {}, /is not the one with which|newer/],
    [postgres.url('anchord', { user: `anchord:${encodeURIComponent(postgres.password)}` }), {}, /pgpass/],
    ['mysql://anchord@127.0.0.1/anchord', {}, /postgresql:\/\//],
  ]) {
    const ended = await serve(url, options);
    assert.ok([1, 2].includes(ended.code), `${url}: ${ended.code}`);
    assert.match(ended.stderr, says);
    assert.doesNotMatch(ended.stderr + ended.stdout, /secret|wrong password/);
  }
  assert.doesNotMatch(server.log + JSON.stringify(await get('/api/v1/system')), /secret/);
});

test('a restart of the database in flight: 503 while it is away, the flight goes on, and no row is missing', async () => {
  const simulator = spawn(binary, ['simulate', 'demonstration', '--json', '--seed', '7'], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  try {
    const devices = [];
    await new Promise((done) => {
      createInterface({ input: simulator.stdout }).on('line', (line) => devices.push(JSON.parse(line)) === 2 && done());
    });
    for (const { kind, address } of devices) await post('/api/v1/devices', { kind, address });
    const mission = (await post('/api/v1/missions', { ...flight.mission, name: 'cut off' })).id;
    const stored = async () =>
      Number(
        await postgres.psql(
          `SELECT count(*) FROM uwb_range WHERE mission_key = (SELECT max(mission_key) FROM mission)`,
          'anchord',
        ),
      );
    await eventually('rows are stored', async () => (await stored()) > 50, 30_000, 200);

    const live = await LiveClient.open(server);
    live.send({ op: 'sub', id: 1, topic: 'ranges' });
    const { sub } = await live.next('ack', (m) => m.op === 'ack' && m.id === 1);
    await postgres.stop();
    await eventually('not ready', async () => (await server.fetch('/readyz')).status === 503);
    const refused = await server.fetch(`/api/v1/ranges?mission=${mission}`, rows(flight.ranges.slice(0, 5)));
    assert.equal(refused.status, 503);
    assert.ok(Number(refused.headers.get('retry-after')) >= 1);
    const from = live.messages.length;
    let count = 0;
    await live.next('fifty ranges without a database', (m) => m.op === 'data' && m.sub === sub && ++count > 50, {
      from,
      deadlineMs: 30_000,
    });

    await postgres.start();
    await eventually('ready again', async () => (await server.fetch('/readyz')).status === 200, 20_000);
    const given = await server.fetch(`/api/v1/ranges?mission=${mission}`, rows(flight.ranges.slice(0, 5)));
    assert.equal((await given.json()).accepted, 5);
    await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
    simulator.kill('SIGTERM');
    const ranges = (text, name) => Number(new RegExp(`^${name}(?:\\{[^}]*\\})? (\\d+)`, 'm').exec(text)?.[1]);
    const metrics = await (await server.fetch('/metrics')).text();
    assert.equal(ranges(metrics, 'anchord_device_rows_lost_total'), 0);
    // Every range that was sent live is stored, those of the outage too.
    const seen = new Set();
    for (const m of live.messages)
      if (m.op === 'data' && m.sub === sub) for (const one of [m.data].flat()) seen.add(one.t_us);
    await eventually('all are stored', async () => {
      const all = new Set(
        (await postgres.psql(`SELECT t_ns / 1000 FROM uwb_range`, 'anchord')).split('\n').map(Number),
      );
      return [...seen].every((t_us) => all.has(t_us));
    });
    assert.ok(seen.size > 50);
    await live.close();
  } finally {
    simulator.kill('SIGTERM');
  }
});
