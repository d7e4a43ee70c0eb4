// A field server's work goes to the centre: over a link that is cut, by a sync that is killed, to a centre that dies or is none;
// and where both published, a person decides.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { LinkProxy } from './gateway.mjs';
import { placed_floor, room_png } from './room.mjs';
import { binary, eventually, run, startServer } from './server.mjs';
import { counted, fly, json, lossy, ok, published, rows, stranger } from './sync_parts.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord sync '));
let field, centre, proxy;
const flights = [];

const words_as = (token, to, ...args) => [
  ...['sync', '--to', to, '--token-file', join(folder, token), '--data-dir', field.dataDir],
  ...args,
];
const words = (to, ...args) => words_as('token', to, ...args);
const sync = (...args) => run(words(proxy.url, ...args), { deadlineMs: 120_000 });

before(async () => {
  field = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  centre = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  proxy = await new LinkProxy(centre.port).start();
  writeFileSync(join(folder, 'token'), centre.token + '\n');
  flights.push(await fly(field, 7));
});
after(async () => {
  proxy?.close();
  await field?.dispose();
  await centre?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a dry run lists what would go and sends nothing', async () => {
  const { code, stdout, stderr } = await sync('--dry-run');
  assert.deepEqual([code, stdout], [0, ''], stderr);
  assert.match(stderr, /flight "simulated 7": would send \d+\.\d MB/);
  assert.equal((await ok(centre, '/api/v1/missions')).items.length, 0);
});

/** An anchord by its version and its token, and something else from there on. */
const impostor = (rest) => (req, res) => {
  if (req.url === '/version') json(res, 200, { version: '0.1.0' });
  else if (req.url === '/api/v1/me') json(res, 200, { name: 'crew', roles: ['engineer'] });
  else if (req.url.startsWith('/api/v1/calibrations?')) json(res, 200, { items: [], next_cursor: null });
  else rest(req, res);
};

test('a centre that is none, or an older one, or full, is refused in words and nothing counts as sent', async () => {
  const half = (res) => {
    res.writeHead(200, { 'content-type': 'application/json', 'content-length': '5000' });
    res.write('{"mission": "');
    setTimeout(() => res.destroy(), 20);
  };
  for (const [what, answer, code, said] of [
    [
      'a login page',
      (_, res) => res.end('<html>please log in</html>'),
      2,
      /not a JSON object: is this the address of an anchord server/,
    ],
    ['not an object', (_, res) => json(res, 200, [1]), 2, /is this the address/],
    ['an object of others', (_, res) => json(res, 200, { version: 3 }), 2, /no version: is this the address/],
    ['500', (_, res) => json(res, 500, { detail: 'broken' }), 1, /500 broken/],
    ['half a body', (_, res) => half(res), 1, /did not answer in time, or closed the connection/],
    [
      'a viewer',
      (req, res) => json(res, 200, req.url === '/version' ? { version: '1' } : { name: 'v', roles: ['viewer'] }),
      2,
      /the token of v does not have the role engineer/,
    ],
    [
      '404 for bundles',
      impostor((_, res) => json(res, 404, { detail: 'no such path' })),
      1,
      /does not accept flight bundles .*update it/,
    ],
    [
      '507 for bundles',
      impostor((_, res) => json(res, 507, { detail: 'no space' })),
      1,
      /507 no space; the disk of that server is full/,
    ],
    ['200 with nothing', impostor((_, res) => json(res, 200, {})), 2, /does not belong to the bundle that was sent/],
    [
      '200 with rubbish',
      impostor((_, res) => res.end('\u0000\u00ff{')),
      2,
      /does not belong to the bundle that was sent/,
    ],
    ['half an answer to a bundle', impostor((_, res) => half(res)), 1, /closed the connection/],
  ]) {
    const got = await stranger(answer, (url) => run(words(url, '--wait', '1'), { deadlineMs: 60_000 }));
    assert.equal(got.code, code, `${what}: ${got.stdout}${got.stderr}`);
    assert.match(got.stderr, said, what);
    assert.ok(!existsSync(join(field.dataDir, 'sync.json')), what);
  }
});

test('lists of a centre that have no end or hold no objects end the sync', async () => {
  for (const [models, said] of [
    [{ items: [7] }, /not a JSON object: is this/],
    [{ items: 'x' }, /not a list: is this/],
    [{ items: [], next_cursor: 'again' }, /the list has no end/],
  ]) {
    const answer = impostor((req, res) => {
      if (req.url.startsWith('/api/v1/models')) return json(res, 200, models);
      return json(res, 422, { detail: 'not this one' });
    });
    const got = await stranger(answer, (url) => run(words(url, '--wait', '1'), { deadlineMs: 60_000 }));
    assert.equal(got.code, 2, got.stderr);
    assert.match(got.stderr, said);
  }
});

test('over a link that is cut it stops, and goes on where it was; everything is there once, under its own id', async () => {
  proxy.bytesPerS = 40_000;
  const cut = sync('--wait', '2');
  await eventually('the flight is on its way', () => proxy.toServer > 20_000, 30_000);
  await proxy.cut();
  const stopped = await cut;
  assert.equal(stopped.code, 1, stopped.stderr);
  assert.match(stopped.stderr, /run the command again to continue/);
  await proxy.restore();
  proxy.bytesPerS = 0;
  const { code, stdout, stderr } = await sync();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 1 sent, 0 already there/);
  assert.deepEqual(await counted(centre), await counted(field));
  assert.deepEqual(await published(centre), await published(field));
});

test('again it finds everything there, also without its notes', async () => {
  for (const notes of [true, false]) {
    if (!notes) rmSync(join(field.dataDir, 'sync.json'));
    const { code, stdout } = await sync();
    assert.equal(code, 0);
    assert.match(stdout, /flights: 0 sent, 1 already there/);
    assert.match(stdout, /anchors: 0 published/);
    assert.deepEqual(await counted(centre), await counted(field));
  }
});

test('a model that no flight brought, and a calibration of two flights, come once; only what is new is sent', async () => {
  const contract = await (await fetch(`${field.url}/api/v1/openapi.json`)).json();
  const artifact = contract.paths['/api/v1/models'].post.requestBody.content['application/json'].example;
  await ok(field, '/api/v1/models', { json: artifact });
  flights.push(await fly(field, 5));
  const missions = flights.map((flight) => flight.id);
  await ok(field, '/api/v1/calibrations', { json: { missions }, headers: { prefer: 'wait=120' } });
  const { code, stdout, stderr } = await sync();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 1 sent, 1 already there.*\nmodels: 1 sent, 0 already there\n/);
  assert.deepEqual(await counted(centre), await counted(field));
  flights.push(await fly(field, 6)); // its kit learned something, which is in the bundles of all its flights
  const next = await sync();
  assert.equal(next.code, 0, next.stdout + next.stderr);
  assert.match(next.stdout, /flights: 1 sent, 2 already there.*\nmodels: 0 sent, 1 already there\n/);
  await ok(field, '/api/v1/calibrations', { json: { missions }, headers: { prefer: 'wait=120' } });
  assert.match((await sync()).stdout, /flights: 1 sent, 2 already there/, 'one bundle brings a later calibration');
  proxy.toServer = 0;
  assert.equal((await sync()).code, 0);
  assert.ok(proxy.toServer < 20_000, `${proxy.toServer} bytes to find that all is there`);
  assert.deepEqual(await counted(centre), await counted(field));
});

test('what moved on in the field moves on at the centre without a question, while rows come in', async () => {
  flights.push(await fly(field, 9));
  const json = { name: 'in the air', frame: 'wgs84', track_point: 'gnss_antenna', tags: [] };
  const live = (await ok(field, '/api/v1/missions?devices=false', { json })).id;
  let sent = 0;
  let running = true;
  const feeding = (async () => {
    for (; running; sent += 50) {
      const batch = Array.from({ length: 50 }, (_, i) => ({
        t_us: Date.now() * 1000 + i,
        seq: sent + i,
        tag: '0x6e01',
        anchor: '0x6a22',
        distance_m: 10 + (i % 7),
      }));
      const report = await ok(field, `/api/v1/ranges?mission=${live}`, rows(batch));
      assert.equal(report.accepted, 50);
      // 2000 rows a second: without a pause it takes all that the token they share may ask.
      await new Promise((done) => setTimeout(done, 25));
    }
  })();
  const { code, stdout, stderr } = await sync();
  running = false;
  await feeding;
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 1 sent, 3 already there, 1 not finished/);
  assert.deepEqual(await published(centre), await published(field));
  assert.ok(sent >= 50);
  await ok(field, `/api/v1/missions/${live}/actions`, { json: { action: 'finish' } });
  assert.equal((await sync()).code, 0);
  assert.equal((await ok(centre, `/api/v1/missions/${live}`)).n_ranges, sent);
  assert.deepEqual(await counted(centre), await counted(field));
});

test('killed at any moment, with a centre that is killed as well, it brings everything once', async () => {
  flights.push(await fly(field, 17));
  proxy.bytesPerS = 5_000; // some minutes for a bundle
  proxy.toServer = 0;
  const stopped = spawn(binary, words(proxy.url), { stdio: 'ignore' });
  const end = new Promise((done) => stopped.once('exit', (code, signal) => done(signal)));
  await eventually('the flight is on its way', () => proxy.toServer > 5_000, 30_000);
  stopped.kill('SIGINT');
  assert.equal(await Promise.race([end, new Promise((done) => setTimeout(done, 5_000, 'late'))]), 'SIGINT');
  proxy.bytesPerS = 400_000;
  let kills = 0;
  for (let ms = 20; ms < 1500; ms += 90) {
    const child = spawn(binary, words(proxy.url), { stdio: 'ignore' });
    const ended = new Promise((done) => child.once('exit', (code, signal) => done(signal)));
    await new Promise((done) => setTimeout(done, ms));
    child.kill('SIGKILL');
    if ((await ended) === 'SIGKILL') ++kills;
  }
  assert.ok(kills > 5, `${kills} kills`);
  flights.push(await fly(field, 19));
  proxy.toServer = 0;
  const through = sync('--wait', '60');
  await eventually('the flight is on its way', () => proxy.toServer > 20_000, 30_000);
  await centre.kill();
  await centre.start();
  const { code, stdout, stderr } = await through;
  proxy.bytesPerS = 0;
  assert.equal(code, 0, stdout + stderr);
  assert.deepEqual(await counted(centre), await counted(field));
  assert.deepEqual(await published(centre), await published(field));
  assert.equal((await sync()).code, 0);
  assert.deepEqual(await counted(centre), await counted(field));
});

test('an answer that is lost makes no second flight, model or revision', async () => {
  flights.push(await fly(field, 23));
  const lost = new Set();
  const { code, stdout, stderr } = await stranger(lossy(centre, lost), (url) =>
    run(words(url), { deadlineMs: 120_000 }),
  );
  assert.equal(code, 0, stdout + stderr);
  assert.ok(
    [...lost].some((url) => url.endsWith('/publish')),
    [...lost].join(' '),
  );
  assert.deepEqual(await counted(centre), await counted(field));
  assert.deepEqual(await published(centre), await published(field));
});

test('where both published it shows both positions and asks; centre leaves them, field changes them', async () => {
  const theirs = await fly(centre, 11);
  const ours = await fly(field, 13);
  const before = await published(centre);
  const here = await published(field);
  const asked = await sync();
  assert.equal(asked.code, 3, asked.stdout + asked.stderr);
  const [, id, of_field, of_centre, apart] =
    /CONFLICT anchors without a site\n {2}(0x\w+)\n {4}field +(.*)\n {4}centre +(.*)\n {4}apart +(\d+\.\d{3}) m\n/.exec(
      asked.stdout,
    );
  const [lon, lat] = here[id].at.coordinates;
  assert.ok(of_field.startsWith(`${lat.toFixed(9)}, ${lon.toFixed(9)}, `), of_field);
  assert.ok(of_centre.startsWith(`${before[id].at.coordinates[1].toFixed(9)}, `), of_centre);
  const difference_m = Math.hypot(
    (lat - before[id].at.coordinates[1]) * 111_250,
    (lon - before[id].at.coordinates[0]) * 111_320 * Math.cos((lat * Math.PI) / 180),
    here[id].at.coordinates[2] - before[id].at.coordinates[2],
  );
  assert.ok(Math.abs(difference_m - Number(apart)) < 0.01, `${difference_m} ${apart}`);
  assert.match(asked.stdout, /decide with --keep/);
  assert.deepEqual(await published(centre), before, 'nothing is decided by itself');
  const at_centre = await counted(centre);
  assert.ok(
    at_centre.missions.some(([mission]) => mission === ours.id),
    'the flight went all the same',
  );

  const origin = { lon: 3.713, lat: 51.023, h_m: 55.4 };
  const site = await ok(field, '/api/v1/sites', { json: { name: 'Hall 3', origin } });
  const etag = (await field.fetch(`/api/v1/anchors/${id}`)).headers.get('etag');
  const patch = { method: 'PATCH', headers: { 'if-match': etag }, json: { site: site.id } };
  await ok(field, `/api/v1/anchors/${id}`, patch);
  const one = await sync('--keep', 'Hall 3=field');
  assert.equal(one.code, 3, one.stdout + one.stderr);
  assert.match(one.stdout, /anchors: 1 published/);
  assert.doesNotMatch(one.stdout, /CONFLICT Hall 3/);
  before[id] = here[id];
  assert.deepEqual(await published(centre), before, 'the anchor of that site alone');

  const left = await sync('--keep', 'centre');
  assert.equal(left.code, 0, left.stdout + left.stderr);
  assert.deepEqual(await published(centre), before);
  assert.ok(Object.values(before).some((one) => one.calibration === theirs.calibration));

  const kept = await sync('--keep', 'field');
  assert.equal(kept.code, 0, kept.stdout + kept.stderr);
  assert.deepEqual(await published(centre), here);
  const revisions = (await counted(centre)).revisions.length;
  const again = await sync('--keep', 'field');
  assert.equal(again.code, 0, again.stdout);
  assert.match(again.stdout, /anchors: 0 published/);
  assert.equal((await counted(centre)).revisions.length, revisions);
  const [newest] = (await ok(centre, '/api/v1/revisions?limit=1')).items;
  assert.match(newest.note, /anchord sync from http.*: kept instead of revision \d+ of the centre/);
});

test('buildings, floors and their plans go with their site, once', async () => {
  const points = [
    [100, 100, 0, 0],
    [700, 100, 30, 0],
    [100, 500, 0, -20],
  ];
  const floor = await placed_floor(field, { origin: { lon: 3.713, lat: 51.023, h_m: 55 }, png: room_png(), points });
  const path = `/api/v1/floors/${floor.id}`;
  const dry = await sync('--keep', 'centre', '--dry-run');
  assert.match(dry.stderr, /site [0-9a-f-]+ with its floors: would send/);
  assert.equal((await centre.fetch(path)).status, 404);
  const sent = await sync('--keep', 'centre');
  assert.equal(sent.code, 0, sent.stdout + sent.stderr);
  assert.deepEqual(await ok(centre, path), await ok(field, path));
  const there = Buffer.from(await (await centre.fetch(`${path}/plan`)).arrayBuffer());
  assert.ok(there.equals(room_png()), 'the picture, byte for byte');
  const tile = async (server) => Buffer.from(await (await server.fetch(`${path}/plan/tiles/0/0/0`)).arrayBuffer());
  assert.ok((await tile(centre)).equals(await tile(field)), 'its tiles too');
  const again = await sync('--keep', 'centre');
  assert.equal(again.code, 0, again.stderr);
  assert.doesNotMatch(again.stderr, /with its floors/);
});

test('what cannot go is refused with what to do', async () => {
  writeFileSync(join(folder, 'wrong'), 'anc_0123\n');
  const token = await run(words_as('wrong', proxy.url));
  assert.equal(token.code, 2, token.stderr);
  assert.match(token.stderr, /401 .*--token-file must give a file with a token of that server \(role engineer\)/);
  const keep = await sync('--keep', 'mine');
  assert.equal(keep.code, 2);
  assert.match(keep.stderr, /--keep mine: must be field, centre, or SITE=field/);
  const empty = await run(['sync', '--to', proxy.url, '--token-file', join(folder, 'token'), '--data-dir', folder]);
  assert.equal(empty.code, 1);
  assert.match(empty.stderr, /no server is running on/);
  await proxy.cut();
  const away = await sync('--wait', '1');
  await proxy.restore();
  assert.equal(away.code, 1);
  assert.match(away.stderr, /cannot reach .*trying again for 1 s\n[^]*run the command again to continue/);
});
