// Whole databases between SQLite and PostgreSQL: a flown flight there and back with the same rows, a copy that was killed and goes on, and
// what is refused.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, renameSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { ndjson, simulatedFlight } from './flight.mjs';
import { startPostgres } from './postgres.mjs';
import { binary, eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord database '));
const flown = join(folder, 'flown');
let postgres, mission, anchors;
const database = (...words) => run(['database', ...words], { env: postgres.env });
const address = async (name) => {
  await postgres.psql(`CREATE DATABASE ${name}`);
  return postgres.url(name);
};
/** Every row of every table as SQLite's own program prints it. */
const dump = (dir) => {
  const tables = "SELECT name FROM sqlite_schema WHERE type = 'table' AND name <> 'schema_migration' ORDER BY 1";
  const sql = (text, mode = 'list') =>
    execFileSync('sqlite3', ['-cmd', `.mode ${mode}`, join(dir, 'anchord.db'), text], {
      encoding: 'utf8',
      maxBuffer: 1 << 28,
    });
  return sql(tables)
    .trim()
    .split('\n')
    .map((table) => `${table}\n${sql(`SELECT * FROM ${table} ORDER BY 1, 2`, 'insert')}`)
    .join('\n');
};

before(async () => {
  postgres = await startPostgres();
  const server = await startServer({ dataDir: flown });
  const flight = await simulatedFlight({ duration: 60 });
  const samples = Buffer.from(Array.from({ length: 1016 * 4 }, (_, i) => (i * i) & 0xff)).toString('base64');
  flight.ranges.forEach((row, i) => {
    if (i % 3 === 0) row.cir = { n: 1016, dt_ps: 1001.6, first_path_idx: 744.2, rxpacc: 1001, b64: samples };
  });
  const post = async (path, json, headers) => (await server.fetch(path, { json, headers })).json();
  mission = (await post('/api/v1/missions', flight.mission)).id;
  for (const what of ['fixes', 'ranges']) {
    const headers = { 'content-type': 'application/x-ndjson' };
    await server.fetch(`/api/v1/${what}?mission=${mission}`, { method: 'POST', headers, body: ndjson(flight[what]) });
  }
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const solved = await post('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' });
  await post(`/api/v1/calibrations/${solved.id}/publish`, {});
  anchors = await (await server.fetch('/api/v1/anchors')).json();
  assert.ok(anchors.features.length >= 3);
  await server.stop();
});
after(async () => {
  await postgres?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a flown flight goes to PostgreSQL and back, and every row is the same', async () => {
  const there = await address('copied'),
    back = join(folder, 'back');
  for (const [from, to] of [
    [flown, there],
    [there, back],
  ]) {
    const copied = await database('copy', from, to);
    assert.equal(copied.code, 0, copied.stderr);
    const checked = await database('check', from, to);
    assert.equal(checked.code, 0, checked.stdout + checked.stderr);
    assert.match(checked.stdout, /tables, 0 differ/);
  }
  assert.ok(Number(await postgres.psql('SELECT count(*) FROM cir', 'copied')) > 300);
  assert.equal(dump(back) === dump(flown), true, 'a row differs');

  // Served where they came to, with the folder they came from; new rows get keys of their own.
  const args = ['--database', there];
  const server = await startServer({ dataDir: flown, args, env: postgres.env });
  assert.deepEqual(await (await server.fetch('/api/v1/anchors')).json(), anchors);
  const another = await server.fetch('/api/v1/missions', {
    json: { name: 'later', frame: 'wgs84', track_point: 'gnss_antenna' },
  });
  assert.equal(another.status, 201);
  await server.dispose();
  const differs = await database('check', there, back);
  assert.equal(differs.code, 1);
  assert.match(differs.stdout, /mission +2 rows, there 1/);

  // Home again into that folder, once its old file is out of the way.
  const refused = await database('copy', there, flown);
  assert.notEqual(refused.code, 0);
  renameSync(join(flown, 'anchord.db'), join(folder, 'old.db'));
  const home = await database('copy', there, flown);
  assert.equal(home.code, 0, home.stderr);
  assert.equal((await database('check', there, flown)).code, 0);
  rmSync(join(flown, 'anchord.db'));
  renameSync(join(folder, 'old.db'), join(flown, 'anchord.db'));
});

test('a copy that was killed goes on where it was; until then no server takes the database', async () => {
  for (const to of [await address('cut'), join(folder, 'cut')]) {
    // Killed as soon as a table that comes late is reached.
    const child = spawn(binary, ['database', 'copy', flown, to], { env: { ...process.env, ...postgres.env } });
    child.stderr.setEncoding('utf8').on('data', (text) => /^(cir|fix|uwb_range)$/m.test(text) && child.kill('SIGKILL'));
    const { signal } = await new Promise((done) => child.once('exit', (code, how) => done({ code, signal: how })));
    assert.equal(signal, 'SIGKILL');
    const at = to.includes('://') ? ['--data-dir', join(folder, 'none'), '--database', to] : ['--data-dir', to];
    const served = await run(['serve', '--listen', '127.0.0.1:0', ...at], { env: postgres.env });
    assert.notEqual(served.code, 0);
    assert.match(served.stderr, /database copy/);
    const other = await database('copy', join(folder, 'back'), to);
    assert.match(other.stderr, /was interrupted/);
    const resumed = await database('copy', flown, to);
    assert.equal(resumed.code, 0, resumed.stderr);
    assert.equal((await database('check', flown, to)).code, 0);
  }
});

test('a copy into rows, from nothing, or of a folder in use is refused, and changes nothing', async () => {
  const again = await database('copy', flown, postgres.url('copied'));
  assert.equal(again.code, 1);
  assert.match(again.stderr, /already has rows.*createdb/);
  const nothing = await database('copy', join(folder, 'nowhere'), await address('empty'));
  assert.equal(nothing.code, 2);
  assert.equal(existsSync(join(folder, 'nowhere')), false);
  const fresh = join(folder, 'fresh');
  const server = await startServer({ dataDir: fresh });
  const used = await database('copy', fresh, postgres.url('empty'));
  assert.match(used.stderr, /in use/);
  await server.dispose();
  const migrated = await database('migrate', postgres.url('empty'));
  assert.match(migrated.stdout, /^version \d+\n$/);
  await eventually(
    'nothing was copied',
    async () => (await postgres.psql('SELECT count(*) FROM mission', 'empty')) === '0',
  );
});

test('of a database that a server has nothing is changed, and what reads it says that the server writes', async () => {
  const there = await address('served'),
    served = join(folder, 'served');
  assert.equal((await database('copy', flown, there)).code, 0);
  const server = await startServer({ dataDir: served, args: ['--database', there], env: postgres.env });
  const rows = () =>
    postgres.psql('SELECT (SELECT count(*) FROM mission), (SELECT max(number) FROM schema_migration)', 'served');
  const before = await rows();
  for (const words of [
    ['copy', join(folder, 'back'), there],
    ['migrate', there],
  ]) {
    const refused = await database(...words);
    assert.equal(refused.code, 1, words[0] + refused.stdout);
    assert.match(refused.stderr, /server \S+.* has postgresql:.*\/served: stop it first/);
  }
  const says = /server \S+.* has postgresql:.*\/served and writes into it/;
  const checked = await database('check', there, flown);
  assert.match(checked.stderr, says);
  assert.match(checked.stdout, /tables, \d+ differ/);
  const away = join(folder, 'away');
  const copied = await database('copy', there, away);
  assert.equal(copied.code, 0, copied.stderr);
  assert.match(copied.stderr, says);
  assert.equal(await rows(), before);
  // Nor is it brought to a version that the server does not know.
  const newest = 'number = (SELECT max(number) FROM schema_migration)';
  await postgres.psql(`CREATE TABLE kept AS SELECT * FROM schema_migration WHERE ${newest}`, 'served');
  await postgres.psql(`DELETE FROM schema_migration WHERE ${newest}`, 'served');
  const older = await rows();
  const other = await database('check', there);
  assert.equal(other.code, 1, other.stdout);
  assert.match(other.stderr, /has postgresql:.*\/served at version \d+, not \d+: stop it first/);
  assert.equal(await rows(), older);
  assert.equal((await server.fetch('/api/v1/missions')).status, 200);
  // One that was killed has it until its lease ends.
  await server.kill();
  assert.equal((await database('migrate', there)).code, 1);
  await postgres.psql('INSERT INTO schema_migration SELECT * FROM kept; DROP TABLE kept', 'served');
  await eventually('its lease is over', async () => (await database('migrate', there)).code === 0, 20_000, 200);
  const alone = await database('check', there);
  assert.deepEqual([alone.code, alone.stderr], [0, '']);
  await server.dispose();
});

test('impulse responses in files go along with a backup and with a copy, and are never missing in silence', async () => {
  const files = (dir) => readdirSync(join(dir, 'cir-archive')).filter((name) => name.endsWith('.db'));
  const digest = async (server) => {
    const answer = await server.fetch(`/api/v1/missions/${mission}/ranges.gpkg`);
    const rows = await (await server.fetch(`/api/v1/ranges?mission=${mission}&cir=true&limit=1000`)).json();
    assert.equal(answer.status, 200);
    return JSON.stringify(rows.items.map((row) => row.cir ?? null));
  };
  let server = await startServer({ dataDir: flown });
  const before = await digest(server);
  const cli = (...words) => run([...words, '--data-dir', flown]);
  const moved = await cli('cir-archive', 'move', mission);
  assert.equal(moved.code, 0, moved.stderr);
  assert.match(moved.stdout, new RegExp(`RESPONSES IN[^]*${mission}.* file +\\d+ +\\d+\\n`));
  assert.match((await cli('cir-archive')).stdout, new RegExp(mission));
  const [listed] = JSON.parse((await cli('cir-archive', 'list', '--json')).stdout);
  assert.deepEqual([listed.here, listed.file], [true, `${mission}-1.db`]);
  assert.equal((await cli('cir-archive', 'move', '00000000-0000-7000-8000-000000000000')).code, 1);
  assert.equal(await digest(server), before);

  // A backup of the running server, elsewhere.
  const made = await cli('backup');
  assert.equal(made.code, 0, made.stderr);
  const backup = JSON.parse(made.stdout);
  assert.deepEqual([backup.complete, backup.cir_files, backup.cir_missing], [true, 1, []]);
  const file = join(flown, 'backups', backup.name);
  assert.match((await run(['backup', 'check', file])).stdout, /is complete\nwith 1 files/);
  assert.match(
    execFileSync('sha256sum', ['-c', `${backup.name}.sha256`], { cwd: join(flown, 'backups'), encoding: 'utf8' }),
    new RegExp(`cir-archive/${mission}-1\\.db: OK`),
  );
  await server.dispose();
  const elsewhere = join(folder, 'elsewhere');
  const restored = await run(['backup', 'restore', file, '--data-dir', elsewhere]);
  assert.equal(restored.code, 0, restored.stderr);
  rmSync(`${file}.sha256`);
  assert.match((await run(['backup', 'check', file])).stdout, /no digest was compared/);
  assert.deepEqual(files(elsewhere), files(flown));
  server = await startServer({ dataDir: elsewhere });
  assert.equal(await digest(server), before);
  await server.dispose();

  // A copy to PostgreSQL that is served with another folder, and back.
  const there = await address('archived'),
    beside = join(folder, 'beside'),
    home = join(folder, 'home');
  const copied = await database('copy', flown, there, '--to-data-dir', beside);
  assert.equal(copied.code, 0, copied.stderr);
  assert.match(copied.stdout, /1 files of impulse responses, \d+ bytes, in .*beside/);
  server = await startServer({ dataDir: beside, args: ['--database', there], env: postgres.env });
  assert.equal(await digest(server), before);
  await server.dispose();
  const unnamed = await database('copy', there, home);
  assert.match(unnamed.stderr, /--from-data-dir/);
  assert.equal((await database('copy', there, home, '--from-data-dir', beside)).code, 0);
  assert.equal((await database('check', there, home)).code, 0);

  // Without the file: the backup is made, and everybody is told what it lacks.
  rmSync(join(home, 'cir-archive'), { recursive: true });
  const less = await run(['backup', '--data-dir', home]);
  assert.equal(less.code, 1);
  assert.match(less.stderr, new RegExp(`is not complete: 1 files[^]*${mission}`));
  const without = join(
    home,
    'backups',
    readdirSync(join(home, 'backups')).find((name) => name.endsWith('.db')),
  );
  assert.equal((await run(['backup', 'check', without])).code, 1);
  const refused = await run(['backup', 'restore', without, '--data-dir', join(folder, 'new')]);
  assert.equal(refused.code, 2);
  assert.match(refused.stderr, /--without-cir-archive/);
  const lacking = await database('copy', home, await address('lacking'));
  assert.notEqual(lacking.code, 0);
  assert.match(lacking.stderr, /--without-cir-archive/);
});
