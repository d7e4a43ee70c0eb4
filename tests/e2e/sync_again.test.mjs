// What was sent once already: rows that came late for a flight, corrections on either side, and a centre that came back from an older backup.
import assert from 'node:assert/strict';
import { createServer, request } from 'node:http';
import { cpSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { run, startServer } from './server.mjs';
import { counted, fly, ok, rows } from './sync_parts.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord sync again '));
const backup = join(folder, 'backup');
let field, centre, first, start_us;

const sync = (way, ...args) =>
  run(['sync', way, centre.url, '--token-file', join(folder, 'token'), '--data-dir', field.dataDir, ...args], {
    deadlineMs: 120_000,
  });
const up = async (...args) => {
  const got = await sync('--to', ...args);
  assert.equal(got.code, 0, got.stdout + got.stderr);
  return got;
};
const range = (i, distance_m = 12.5 + i / 1000) => ({
  t_us: start_us + 7_000_003 + i * 1000,
  seq: 900_000 + i,
  tag: '0x6e01',
  anchor: i % 2 ? '0x6a22' : '0x6abc', // one of them was not heard before
  distance_m,
});
const late = (server, flight, first_row, n) =>
  ok(server, `/api/v1/ranges?mission=${flight}`, rows(Array.from({ length: n }, (_, i) => range(first_row + i))));
const correct = async (server, flight, json) => {
  const path = `/api/v1/missions/${flight}`;
  const etag = (await server.fetch(path)).headers.get('etag');
  await ok(server, path, { method: 'PATCH', headers: { 'if-match': etag }, json });
};
const exclude = (server, flight, anchor) =>
  ok(server, `/api/v1/missions/${flight}/exclusions`, {
    json: { kind: 'ranges', since: start_us, anchor, reason: 'late' },
  });
const exclusions = async (server, flight) => (await ok(server, `/api/v1/missions/${flight}/exclusions`)).items;

/** What both have of a flight is the same, to the row. */
async function same(flight) {
  assert.deepEqual(await exclusions(centre, flight), await exclusions(field, flight));
  assert.deepEqual(await counted(centre), await counted(field));
  for (const what of ['ranges', 'fixes']) {
    const of = async (server) => {
      const answer = await server.fetch(`/api/v1/${what}?mission=${flight}`, {
        headers: { accept: 'application/x-ndjson' },
      });
      const text = await answer.text();
      assert.ok(answer.ok && text.length > 1000, text.slice(0, 300));
      return text
        .trim()
        .split('\n')
        .map((line) => ({ ...JSON.parse(line), id: 0, received_t_us: 0 }))
        .map((row) => JSON.stringify(row))
        .sort();
    };
    assert.deepEqual(await of(centre), await of(field), what);
  }
}

before(async () => {
  field = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  centre = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  writeFileSync(join(folder, 'token'), centre.token + '\n');
  const origin = { lon: 3.713, lat: 51.023, h_m: 55.4 };
  const site = await ok(field, '/api/v1/sites', { json: { name: 'Hall 3', origin } });
  await ok(field, '/api/v1/buildings', { json: { site: site.id, name: 'B1', height_m: 8 } });
  first = (await fly(field, 7, site.id)).id;
  start_us = (await ok(field, `/api/v1/ranges?mission=${first}&limit=1`)).items[0].t_us;
  await up();
});
after(async () => {
  await field?.dispose();
  await centre?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('rows that came late for a flight that was sent go with the next sync, once', async () => {
  const before = await ok(centre, `/api/v1/missions/${first}`);
  await late(field, first, 0, 40);
  const [fix] = (await ok(field, `/api/v1/fixes?mission=${first}&limit=1`)).items;
  const { lat, lon, h_m } = fix;
  await ok(field, `/api/v1/fixes?mission=${first}`, rows([{ t_us: start_us - 500_001, lat, lon, h_m, fix: 'fixed' }]));
  await exclude(field, first, '0x6a22');
  const { stdout, stderr } = await up();
  assert.match(stderr, /simulated 7": 43 rows stored/);
  assert.match(stdout, /flights: 1 sent, 0 already there/);
  const now = await ok(centre, `/api/v1/missions/${first}`);
  assert.deepEqual([now.n_ranges, now.n_fixes], [before.n_ranges + 40, before.n_fixes + 1]);
  await same(first);
  assert.match((await up()).stdout, /flights: 0 sent, 1 already there/);
  rmSync(join(field.dataDir, 'sync.json'));
  assert.match((await up()).stdout, /flights: 0 sent, 1 already there/);
  await same(first);
});

test('a guest network that wants a sign-in in the middle of a run is waited out, and named where it answers first', async () => {
  let seen = 0,
    from_request = 3,
    until_ms = null;
  const portal = createServer((asked, answer) => {
    if (seen++ >= from_request) {
      until_ms ??= Date.now() + 3000;
      if (Date.now() < until_ms) {
        answer.writeHead(200, { 'content-type': 'text/html' });
        answer.end('<html>Welcome to our guest network</html>');
        return;
      }
    }
    const { url, method, headers } = asked;
    asked.pipe(
      request({ host: '127.0.0.1', port: centre.port, path: url, method, headers }, (got) => {
        answer.writeHead(got.statusCode, got.headers);
        got.pipe(answer);
      }),
    );
  });
  await new Promise((done) => portal.listen(0, '127.0.0.1', done));
  try {
    await late(field, first, 500, 10);
    const through = () =>
      run(
        ['sync', '--to', `http://127.0.0.1:${portal.address().port}`, '--token-file', join(folder, 'token')].concat([
          '--data-dir',
          field.dataDir,
          '--wait',
          '30',
        ]),
        { deadlineMs: 120_000 },
      );
    const got = await through();
    assert.equal(got.code, 0, got.stdout + got.stderr);
    assert.match(got.stderr, /a web page answers \(200\), not the server/);
    await same(first);
    [seen, from_request, until_ms] = [0, 0, Infinity];
    const refused = await through();
    assert.equal(refused.code, 2, refused.stdout + refused.stderr);
    assert.match(refused.stderr, /is this the address of an anchord server/);
  } finally {
    portal.close();
  }
});

test('a flight that was corrected on both sides stays as it is there, is named, and its rows go', async () => {
  await correct(centre, first, { name: 'named at the centre' });
  await correct(field, first, { tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.5, 0, -0.3] }] });
  const declared = await ok(centre, `/api/v1/missions/${first}`);
  await late(field, first, 40, 10);
  const { stdout, stderr } = await up();
  assert.match(stdout, /flights: 1 sent/);
  assert.match(
    stderr,
    /mission [0-9a-f-]+ left out: it exists on this server with other content \(name\), which stays/,
  );
  assert.match(stderr, /mission_tag 0 left out: .*\(lever_arm_forward_m\), which stays/);
  const { tags, name } = await ok(centre, `/api/v1/missions/${first}`);
  assert.deepEqual({ tags, name }, { tags: declared.tags, name: 'named at the centre' });
  await same(first);
  assert.match((await up()).stdout, /flights: 0 sent, 1 already there/);
});

test('rows that came late at the centre, some of them sent to both, hinder nothing, and its bundle brings them back', async () => {
  await late(centre, first, 45, 15);
  await late(field, first, 60, 5);
  await up();
  assert.equal(
    (await ok(centre, `/api/v1/missions/${first}`)).n_ranges,
    (await ok(field, `/api/v1/missions/${first}`)).n_ranges + 10,
  );
  const body = Buffer.from(await (await centre.fetch(`/api/v1/missions/${first}/bundle`)).arrayBuffer());
  const headers = { 'content-type': 'application/vnd.anchord.bundle+zip' };
  const { added, left_out } = await ok(field, '/api/v1/bundles', { method: 'POST', headers, body });
  assert.deepEqual(added, { uwb_range: 10 });
  assert.ok(left_out.some(({ what }) => what === `mission ${first}`));
  await same(first);
});

test('a centre that came back from an older backup gets all that it lost, exclusions and floors too', async () => {
  const [building] = (await ok(field, '/api/v1/buildings')).items;
  const restore = async () => {
    await centre.stop();
    rmSync(centre.dataDir, { recursive: true });
    cpSync(backup, centre.dataDir, { recursive: true });
    await centre.start();
  };
  const save = async () => {
    await centre.stop();
    rmSync(backup, { recursive: true, force: true });
    cpSync(centre.dataDir, backup, { recursive: true });
    await centre.start();
  };
  await save();
  await late(field, first, 70, 8);
  await exclude(field, first, '0x6a21');
  const second = (await fly(field, 9)).id;
  await ok(field, '/api/v1/floors', { json: { building: building.id, name: 'Ground', level: 0 } });
  const floors = async (server) => (await ok(server, '/api/v1/floors')).items;
  await up();
  await same(first);
  await restore();
  assert.equal((await floors(centre)).length, 0);
  assert.match((await up()).stdout, /flights: 2 sent, 0 already there/);
  await same(first);
  await same(second);
  assert.deepEqual(await floors(centre), await floors(field));

  // What is not counted with the flight.
  await save();
  const [taken_back] = await exclusions(field, first);
  await ok(field, `/api/v1/missions/${first}/exclusions/${taken_back.id}/include`, {
    json: { reason: 'it was right' },
  });
  await exclude(field, second, '0x6a22');
  await up();
  await restore();
  assert.match((await up()).stdout, /flights: 2 sent, 0 already there/);
  await same(first);
  await same(second);
  assert.match((await up()).stdout, /flights: 0 sent, 2 already there/);
});

test('a measurement that differs is named and keeps its flight out, and no other', async () => {
  const other = (await fly(field, 11)).id;
  await up();
  await ok(field, `/api/v1/ranges?mission=${other}`, rows([range(0, 7), range(1)]));
  await ok(centre, `/api/v1/ranges?mission=${other}`, rows([range(0, 8)]));
  const before = await ok(centre, `/api/v1/missions/${other}`);
  await late(field, first, 80, 2);
  const { code, stdout, stderr } = await sync('--to');
  assert.equal(code, 1, stdout + stderr);
  assert.match(
    stdout,
    /FAILED .*409 uwb_range \d+ 0x6e01 0x6abc 0 900000 of mission .*\(distance_m\); nothing was imported/,
  );
  const { n_ranges } = await ok(centre, `/api/v1/missions/${other}`);
  assert.equal(n_ranges, before.n_ranges, 'none of its rows');
  const of = async (server) => (await ok(server, `/api/v1/missions/${first}`)).n_ranges;
  assert.equal(await of(centre), await of(field));
});
