// Before the trip the field server takes from the centre what the crew needs: over a link that is cut, with processes that are killed,
// from a centre that is none, and so that the way back up is without a question.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { crc32, deflateRawSync } from 'node:zlib';
import { hall_outline } from './flight.mjs';
import { LinkProxy } from './gateway.mjs';
import { placed_floor, room_png } from './room.mjs';
import { binary, eventually, run, startServer } from './server.mjs';
import { counted, fly, forwarding, json, lossy, ok, published, stranger } from './sync_parts.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord sync down '));
let field, centre, proxy, floor, site;

const points = [
  [100, 100, 0, 0],
  [700, 100, 30, 0],
  [100, 500, 0, -20],
];
async function tokenFile(name, roles, sites) {
  const made = await ok(centre, '/api/v1/tokens', { json: { name, roles, ...(sites && { sites }) } });
  writeFileSync(join(folder, name), made.token + '\n');
}
const words_as = (token, from, ...args) => [
  ...['sync', '--from', from, '--token-file', join(folder, token), '--data-dir', field.dataDir],
  ...args,
];
const words = (from, ...args) => words_as('reader', from, ...args);
const down = (...args) => run(words(proxy.url, ...args));
const up = () => run(['sync', '--to', proxy.url, '--token-file', join(folder, 'crew'), '--data-dir', field.dataDir]);
/** What came down, to compare with what is at the centre. */
const taken = async (server) => ({
  sites: (await ok(server, '/api/v1/sites')).items.map((one) => [one.id, one.name]).sort(),
  plans: (await ok(server, '/api/v1/plans')).items.map((one) => [one.id, one.name]).sort(),
  frames: (await ok(server, '/api/v1/frames')).items.map((one) => one.id).sort(),
  floors: (await ok(server, '/api/v1/floors')).items.map((one) => one.id).sort(),
  ...(await counted(server)),
});
const profile = async (server, kit) => (await ok(server, `/api/v1/devices/${kit}/profile`)).profile;
const plan_of = (id) => ({ name: 'Hall 3 outline', site: id, outline: hall_outline });
let kit, first;

before(async () => {
  field = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  centre = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  proxy = await new LinkProxy(centre.port).start();
  await tokenFile('reader', ['viewer']);
  await tokenFile('crew', ['engineer']);
  floor = await placed_floor(centre, { origin: { lon: 3.713, lat: 51.023, h_m: 55 }, png: room_png(), points });
  [site] = (await ok(centre, '/api/v1/sites')).items;
  await ok(centre, '/api/v1/plans', { json: plan_of(site.id) });
  first = await fly(centre, 7, site.id);
  kit = (await ok(centre, `/api/v1/missions/${first.id}`)).kit;
  const contract = await (await fetch(`${centre.url}/api/v1/openapi.json`)).json();
  const artifact = contract.paths['/api/v1/models'].post.requestBody.content['application/json'].example;
  const model = await ok(centre, '/api/v1/models', { json: artifact });
  await ok(centre, `/api/v1/models/${model.id}/promote`, { json: { reason: 'the first of this building' } });
});
after(async () => {
  proxy?.close();
  await field?.dispose();
  await centre?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a dry run lists what would be taken and takes nothing', async () => {
  const { code, stdout, stderr } = await down('--dry-run');
  assert.deepEqual([code, stdout], [0, ''], stderr);
  assert.match(stderr, /site "Hall": would be taken/);
  assert.match(stderr, /flight "simulated 7": would be taken/);
  assert.match(stderr, /model .*: would be taken/);
  assert.match(stderr, /profile of kit '.*': would be taken/);
  assert.match(stderr, /calibration .*: would publish/);
  const nothing = {
    sites: [],
    plans: [],
    frames: [],
    floors: [],
    missions: [],
    calibrations: [],
    models: [],
    revisions: [],
  };
  assert.deepEqual(await taken(field), nothing);
});
test('over a link that is cut it stops, and goes on with the next run; a token of role viewer is enough', async () => {
  proxy.bytesPerS = 60_000;
  const cut = down('--wait', '2');
  await eventually('the flight is on its way', () => proxy.toClient > 60_000, 30_000);
  await proxy.cut();
  const stopped = await cut;
  assert.equal(stopped.code, 1, stopped.stderr);
  assert.match(stopped.stderr, /what has arrived stays, run the command again to continue/);
  await proxy.restore();
  proxy.bytesPerS = 0;
  const { code, stdout, stderr } = await down();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /sites: \d taken.*\nflights: 1 taken\nmodels: 1 taken.*\nprofiles of kits: \d taken/);
  assert.deepEqual(await taken(field), await taken(centre));
  assert.deepEqual(await published(field), await published(centre));
  assert.deepEqual(await profile(field, kit), await profile(centre, kit));
  const path = `/api/v1/floors/${floor.id}`;
  assert.deepEqual(await ok(field, path), await ok(centre, path));
  const picture = Buffer.from(await (await field.fetch(`${path}/plan`)).arrayBuffer());
  assert.ok(picture.equals(room_png()), 'the picture, byte for byte');
});

test('again it takes nothing and hardly reads, and nothing of it goes back up', async () => {
  proxy.toClient = 0;
  const { code, stdout, stderr } = await down();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /sites: 0 taken, 1 already here\nflights: 0 taken\nmodels: 0 taken, 1 already here\n/);
  assert.match(stdout, /anchors: 0 published/);
  assert.ok(proxy.toClient < 100_000, `${proxy.toClient} bytes to find that all is here`);
  assert.deepEqual(await taken(field), await taken(centre));
  const path = `/api/v1/sites/${site.id}/bundle?flights=false`;
  const etag = (await centre.fetch(path)).headers.get('etag');
  const content = (tag) => tag.slice(0, tag.indexOf('.'));
  assert.equal(content(etag), content((await field.fetch(path)).headers.get('etag')), 'the same, wherever it is');
  for (const known of [etag, content(etag) + '"'])
    assert.equal((await centre.fetch(path, { headers: { 'if-none-match': known } })).status, 304, known);
  proxy.toServer = 0;
  const back = await up();
  assert.equal(back.code, 0, back.stdout + back.stderr);
  assert.match(back.stdout, /flights: 0 sent, 1 already there/);
  assert.ok(proxy.toServer < 20_000, `${proxy.toServer} bytes`);
});

test('what the crew flies then goes up without a conflict, and what the kit learned goes on there', async () => {
  const flown = await fly(field, 9, site.id);
  assert.notDeepEqual(await published(field), await published(centre));
  const { code, stdout, stderr } = await up();
  assert.equal(code, 0, stdout + stderr);
  assert.doesNotMatch(stdout, /CONFLICT|differs|FAILED/);
  assert.match(stdout, /flights: 1 sent, 1 already there/);
  assert.deepEqual(await published(centre), await published(field));
  assert.ok(Object.values(await published(centre)).some((one) => one.calibration === flown.calibration));
  assert.deepEqual(await profile(centre, kit), await profile(field, kit));
});

test('the active model of the centre is shown, and active here only when asked for, through the gate here', async () => {
  const active = async () => Object.values((await ok(field, '/api/v1/models/active')).models).filter(Boolean).length;
  assert.match((await down()).stderr, /active at the centre: not active here \(--activate-models\)/);
  assert.equal(await active(), 0);
  const gate = await down('--activate-models');
  assert.equal(gate.code, 1, gate.stdout + gate.stderr);
  assert.match(gate.stdout, /FAILED model .* not active here: 422 .*give a reason/);
  assert.equal(await active(), 0);
  const asked = await down('--activate-models', '--reason', 'as at the centre');
  assert.equal(asked.code, 0, asked.stdout + asked.stderr);
  assert.equal(await active(), 1);
  const [promotion] = (await ok(field, '/api/v1/models/promotions')).items;
  assert.equal(promotion.reason, 'as at the centre');
  assert.match((await down('--activate-models')).stderr, /active at the centre: active here too/);
});

test('what is here in another version stays and is listed; what is new beside it comes', async () => {
  const [plan] = (await ok(field, '/api/v1/plans')).items;
  const renamed = async (server, path, json) => {
    const etag = (await server.fetch(path)).headers.get('etag');
    await ok(server, path, { method: 'PATCH', headers: { 'if-match': etag }, json });
  };
  await renamed(field, `/api/v1/sites/${site.id}`, { name: 'Hall of the crew' });
  await renamed(field, `/api/v1/plans/${plan.id}`, { name: 'Hall 3 outline, walked round' });
  const other = await ok(centre, '/api/v1/plans', { json: { ...plan_of(site.id), name: 'Another outline' } });
  for (const round of [1, 2]) {
    const { code, stdout, stderr } = await down();
    assert.equal(code, 0, stdout + stderr);
    assert.match(stdout, /differs: site 'Hall of the crew' stays as it is here: .*\(name\)/, `round ${round}`);
    assert.match(stdout, /differs: plan 'Hall 3 outline, walked round' stays as it is here/);
  }
  assert.equal((await ok(field, `/api/v1/sites/${site.id}`)).name, 'Hall of the crew');
  assert.equal((await ok(field, `/api/v1/plans/${plan.id}`)).name, 'Hall 3 outline, walked round');
  assert.equal((await ok(field, `/api/v1/plans/${other.id}`)).name, 'Another outline');
  await renamed(field, `/api/v1/sites/${site.id}`, { name: site.name });
});

test('only the sites that are named, and only what their positions rest on', async () => {
  const origin = { lon: 4.5, lat: 52.1, h_m: 40 };
  const far = await ok(centre, '/api/v1/sites', { json: { name: 'Far away', origin } });
  const near = await ok(centre, '/api/v1/sites', { json: { name: 'Near', origin } });
  const one = await down('--site', 'Far away');
  assert.equal(one.code, 0, one.stdout + one.stderr);
  assert.match(one.stdout, /sites: 1 taken, 0 already here\nflights: 0 taken/);
  assert.equal((await field.fetch(`/api/v1/sites/${far.id}`)).status, 200);
  assert.equal((await field.fetch(`/api/v1/sites/${near.id}`)).status, 404);
  const none = await down('--site', 'Nowhere');
  assert.equal(none.code, 2);
  assert.match(none.stderr, /--site Nowhere: .* has no site of this name or id that the token may read/);
  await ok(centre, '/api/v1/sites', { json: { name: 'Near', origin } });
  const two = await down('--site', 'Near');
  assert.equal(two.code, 2);
  assert.match(two.stderr, /--site Near: 2 sites have this name, give the id/);
  await tokenFile('bound', ['viewer'], [near.id]);
  const bound = await run(words_as('bound', proxy.url));
  assert.equal(bound.code, 0, bound.stdout + bound.stderr);
  assert.match(bound.stderr, /a token is bound to sites: models and profiles of kits do not go/);
  assert.match(bound.stdout, /sites: 1 taken/);
  assert.equal((await field.fetch(`/api/v1/sites/${near.id}`)).status, 200);
});

test('killed at any moment, with servers of both sides that are killed as well, it takes everything once', async () => {
  await fly(centre, 11, site.id);
  proxy.bytesPerS = 600_000;
  let kills = 0;
  for (let ms = 20; ms < 1200; ms += 110) {
    const child = spawn(binary, words(proxy.url), { stdio: 'ignore' });
    const ended = new Promise((done) => child.once('exit', (code, signal) => done(signal)));
    await new Promise((done) => setTimeout(done, ms));
    child.kill('SIGKILL');
    if ((await ended) === 'SIGKILL') ++kills;
  }
  assert.ok(kills > 4, `${kills} kills`);
  await fly(centre, 13, site.id);
  proxy.bytesPerS = 200_000;
  proxy.toClient = 0;
  const through = down('--wait', '60');
  await eventually('the flight is on its way', () => proxy.toClient > 100_000, 30_000);
  await centre.kill();
  await centre.start();
  await field.kill();
  await field.start();
  const { code, stdout, stderr } = await through;
  proxy.bytesPerS = 0;
  assert.equal(code, 0, stdout + stderr);
  assert.deepEqual(await published(field), await published(centre));
  const revisions = (await counted(field)).revisions;
  assert.equal(new Set(revisions).size, revisions.length, 'each calibration was published once');
  assert.equal((await down()).code, 0);
  assert.deepEqual((await counted(field)).revisions, revisions);
  assert.equal((await up()).code, 0);
  assert.deepEqual(await published(field), await published(centre));
  assert.ok(!readdirSync(field.dataDir).some((name) => name.endsWith('.part')), 'nothing is left behind');
});

test('an answer of the field that is lost makes no second flight, profile or revision', async () => {
  await fly(centre, 19, site.id);
  // A kit whose flights do not come: its profile does.
  const spare = { name: 'of the spare kit', kit: 'spare kit', frame: 'wgs84', track_point: 'gnss_antenna', tags: [] };
  const { id: other } = await ok(centre, '/api/v1/missions?devices=false', { json: spare });
  await ok(centre, `/api/v1/missions/${other}/actions`, { json: { action: 'finish' } });
  const learned = { ...(await profile(centre, kit)), kit: 'spare kit' };
  const put = { method: 'PUT', headers: { 'if-match': '*' }, json: learned };
  await ok(centre, '/api/v1/devices/spare%20kit/profile', put);
  const lost = new Set();
  writeFileSync(join(folder, 'field'), field.token + '\n');
  const { code, stdout, stderr } = await stranger(lossy(field, lost), (url) =>
    down('--url', url, '--url-token-file', join(folder, 'field')),
  );
  assert.equal(code, 0, stdout + stderr);
  for (const what of ['POST /api/v1/bundles', 'publish', 'profile'])
    assert.ok(
      [...lost].some((one) => one.endsWith(what)),
      `${what}: ${[...lost].join(', ')}`,
    );
  assert.deepEqual(await published(field), await published(centre));
  assert.deepEqual(await profile(field, 'spare%20kit'), learned);
  const { revisions } = await counted(field);
  assert.equal(new Set(revisions).size, revisions.length);
});

test('a position that rests on two flights brings both, and what else they were calibrated with stays away', async () => {
  const missions = [];
  for (const seed of [21, 25]) {
    const flight = await fly(centre, seed, site.id);
    missions.push(flight.id);
  }
  const solve = { json: { missions }, headers: { prefer: 'wait=120' } };
  const joint = await ok(centre, '/api/v1/calibrations', solve);
  await ok(centre, `/api/v1/calibrations/${joint.id}/publish`, { json: {} });
  const not_asked = await ok(centre, '/api/v1/calibrations', {
    json: { missions: [missions[0], first.id] },
    headers: { prefer: 'wait=120' },
  });
  await ok(centre, `/api/v1/calibrations/${not_asked.id}/publish`, { json: {} });
  await ok(centre, `/api/v1/calibrations/${joint.id}/publish`, { json: {} });
  const { code, stdout, stderr } = await down();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 2 taken/);
  assert.doesNotMatch(stdout, /differs: calibration/);
  assert.deepEqual(await published(field), await published(centre));
});

test('where both published, both positions are listed and a person decides', async () => {
  const theirs = await fly(centre, 15, site.id);
  await fly(field, 17, site.id);
  const here = await published(field);
  const asked = await down();
  assert.equal(asked.code, 3, asked.stdout + asked.stderr);
  assert.match(asked.stdout, /CONFLICT .*\n {2}0x\w+\n {4}field .*\n {4}centre .*\n {4}apart/);
  assert.deepEqual(await published(field), here, 'nothing is decided by itself');
  const left = await down('--keep', 'field');
  assert.equal(left.code, 0, left.stdout + left.stderr);
  assert.deepEqual(await published(field), here);
  const kept = await down('--keep', 'centre');
  assert.equal(kept.code, 0, kept.stdout + kept.stderr);
  const [now, there] = [await published(field), await published(centre)];
  const decided = Object.keys(there).filter((anchor) => there[anchor].calibration === theirs.calibration);
  assert.ok(decided.length > 0);
  for (const anchor of decided) assert.deepEqual(now[anchor], there[anchor], anchor);
  assert.equal((await up()).code, 0, 'and the way up has no question either');
  assert.deepEqual(await published(centre), await published(field));
});

/** An anchord with one site, and the rest as `rest` says. */
const id = '0197c1de-0000-7000-8000-000000000001';
const impostor = (rest) => (req, res) => {
  const path = req.url.replace(/\?.*/, '');
  if (path === '/version') json(res, 200, { version: '0.1.0' });
  else if (path === '/api/v1/me') json(res, 200, { name: 'crew', roles: ['viewer'], sites: null });
  else if (path === '/api/v1/sites') json(res, 200, { items: [{ id, name: 'S' }], next_cursor: null });
  else rest(req, res, path);
};
const bundle_answer = (bytes) =>
  impostor((_, res) => res.writeHead(200, { 'content-type': 'application/octet-stream' }).end(bytes));
/** A zip file of one entry. */
function zip_of(name, content) {
  const packed = deflateRawSync(content);
  const head = Buffer.alloc(26); // from the version needed to the length of the extra field
  head.writeUInt16LE(20, 0);
  head.writeUInt16LE(8, 4);
  head.writeUInt32LE(crc32(content), 10);
  head.writeUInt32LE(packed.length, 14);
  head.writeUInt32LE(content.length, 18);
  head.writeUInt16LE(name.length, 22);
  const local = Buffer.concat([Buffer.from('PK\x03\x04'), head, Buffer.from(name), packed]);
  const central = Buffer.concat([Buffer.from('PK\x01\x02\x14\0'), head, Buffer.alloc(14), Buffer.from(name)]);
  const end = Buffer.alloc(18);
  end.writeUInt16LE(1, 4);
  end.writeUInt16LE(1, 6);
  end.writeUInt32LE(central.length, 8);
  end.writeUInt32LE(local.length, 12);
  return Buffer.concat([local, central, Buffer.from('PK\x05\x06'), end]);
}
test('a centre that is none, older, forbidden or hostile is refused in words, and nothing changes here', async () => {
  const before_all = await taken(field);
  const real = Buffer.from(await (await centre.fetch(`/api/v1/sites/${site.id}/bundle?flights=false`)).arrayBuffer());
  const deep = '['.repeat(1_000_000);
  const endless = (res, head, piece) => {
    res.writeHead(200, { 'content-type': 'application/json' });
    res.write(head);
    const more = () => {
      while (!res.destroyed && res.write(piece));
    };
    res.on('drain', more).on('error', () => {});
    more();
  };
  for (const [what, answer, code, said] of [
    ['a login page', (_, res) => res.end('<html>log in</html>'), 2, /is this the address of an anchord server/],
    ['deep JSON', (_, res) => res.end(deep), 2, /is this the address of an anchord server/],
    ['a token that may not read', (_, res) => json(res, 403, { detail: 'no' }), 2, /403 no; --token-file .*viewer/],
    ['an older one', impostor((_, res) => json(res, 404, { detail: 'no such path' })), 1, /older than this program/],
    ['no zip file', bundle_answer('PK no'), 2, /is this the address/],
    ['half a zip file', bundle_answer(real.subarray(0, real.length / 2)), 2, /is this the address/],
    ['a zip bomb', bundle_answer(zip_of('manifest.json', Buffer.alloc(100 << 20))), 2, /more than 300 times/],
    ['broken JSON', bundle_answer(zip_of('manifest.json', Buffer.from('{"format":'))), 2, /is this the address/],
    ['the bundle of another site', bundle_answer(real), 2, /the bundle is of another site/],
    [
      'a list that never ends',
      (req, res) => {
        if (!req.url.startsWith('/api/v1/sites')) return impostor(() => {})(req, res);
        return endless(res, '{"items":[', '{"id":"x"},'.repeat(1000));
      },
      2,
      /longer than the \d+ bytes it may have/,
    ],
    [
      'ids that climb',
      (req, res) => {
        const items = [{ id: '../../tokens\r\nX: y', name: 'S' }];
        if (req.url.startsWith('/api/v1/sites?')) return json(res, 200, { items, next_cursor: null });
        return impostor((_, rest) => json(rest, 404, { detail: 'none' }))(req, res);
      },
      1,
      /older than this program/,
    ],
  ]) {
    const got = await stranger(answer, (url) => run(words(url, '--wait', '1'), { deadlineMs: 60_000 }));
    assert.equal(got.code, code, `${what}: ${got.stdout}${got.stderr}`);
    assert.match(got.stderr, said, what);
    assert.deepEqual(await taken(field), before_all, what);
  }
});

test('bundles of a forger are refused by the field as a whole', async () => {
  const flight = (await ok(centre, '/api/v1/missions?limit=100')).items.find((m) => m.state === 'finished');
  const of_flight = Buffer.from(await (await centre.fetch(`/api/v1/missions/${flight.id}/bundle`)).arrayBuffer());
  const of_site = Buffer.from(
    await (await centre.fetch(`/api/v1/sites/${site.id}/bundle?flights=false`)).arrayBuffer(),
  );
  const forged = Buffer.from(of_site);
  forged[forged.length >> 1] ^= 0x55;
  for (const [what, bytes] of [
    ['a flight in the place of a site', of_flight],
    ['a byte that was changed', forged],
  ]) {
    const before_all = await taken(field);
    const answer = forwarding(centre, (req, res, back) => {
      if (back || !/\/sites\/[^/]+\/bundle/.test(req.url)) return false;
      res.writeHead(200, { 'content-type': 'application/octet-stream' }).end(bytes);
      return true;
    });
    const got = await stranger(answer, (url) => run(words(url, '--site', site.name, '--wait', '1')));
    assert.ok([1, 2].includes(got.code), `${what}: ${got.code} ${got.stdout}${got.stderr}`);
    assert.match(got.stdout + got.stderr, /is this the address|422 .*Nothing was imported/, what);
    assert.deepEqual(await taken(field), before_all, what);
  }
});

/** A server that sends what `send` writes to the socket after the request, in the memory that a program may have. */
async function raw(send, memory_kib) {
  const server = createServer((socket) => {
    socket.on('error', () => {});
    socket.once('data', () => send(socket));
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const url = `http://127.0.0.1:${server.address().port}`;
  try {
    return await new Promise((done) => {
      const shell = `ulimit -v ${memory_kib}; exec "$@"`;
      const child = spawn('bash', ['-c', shell, 'bash', binary, ...words(url, '--wait', '1', '--timeout', '2')]);
      let stderr = '';
      child.stderr.setEncoding('utf8').on('data', (text) => (stderr += text));
      child.once('close', (code) => done({ code, stderr }));
    });
  } finally {
    server.close();
  }
}
const flood = (head, piece) => (socket) => {
  socket.write(head);
  const more = () => {
    while (!socket.destroyed && socket.write(piece));
  };
  socket.on('drain', more);
  more();
};

test('answers that come a drop at a time, or flood what is no body, end in bounded time and memory', async () => {
  const drop = (head) => (socket) => {
    socket.write(head);
    const timer = setInterval(() => socket.write('x'), 500);
    socket.on('close', () => clearInterval(timer));
  };
  const [slow_head, slow_body, long_head] = await Promise.all([
    raw(drop('HTTP/1.1 200 OK\r\nX-'), 2_000_000),
    raw(drop('HTTP/1.1 200 OK\r\nContent-Length: 1000000\r\n\r\n'), 2_000_000),
    raw(flood('HTTP/1.1 200 OK\r\nX: ', 'x'.repeat(65_536)), 2_000_000),
  ]);
  assert.equal(slow_head.code, 1, slow_head.stderr);
  assert.match(slow_head.stderr, /did not answer in time/);
  assert.equal(slow_body.code, 1, slow_body.stderr);
  assert.match(slow_body.stderr, /answers with less than 1000 bytes a second/);
  assert.equal(long_head.code, 1, long_head.stderr);
  assert.match(long_head.stderr, /sent more than \d+ MiB that are no answer/);
});

test('a full disk of the field, a token without a role and wrong options are named', async () => {
  const full = forwarding(field, (req, res, back) => {
    if (back || req.method !== 'POST' || req.url !== '/api/v1/bundles') return false;
    json(res, 507, { detail: 'no space is left' });
    return true;
  });
  await ok(centre, '/api/v1/sites', { json: { name: 'One more', origin: { lon: 4.5, lat: 52.1, h_m: 40 } } });
  const got = await stranger(full, (url) => down('--url', url, '--url-token-file', join(folder, 'field')));
  assert.equal(got.code, 1, got.stdout + got.stderr);
  assert.match(got.stderr, /507 no space is left; the disk of that server is full/);
  await tokenFile('drone', ['gateway']);
  const gateway = await run(words_as('drone', proxy.url));
  assert.equal(gateway.code, 2, gateway.stderr);
  assert.match(gateway.stderr, /does not have the role viewer|403/);
  for (const wrong of [
    ['sync', '--data-dir', field.dataDir],
    words(proxy.url, '--timeout', '0'),
    words(proxy.url, '--timeout', '3601'),
    words(proxy.url, '--timeout', 'soon'),
    words(proxy.url, '--to', proxy.url),
    ['sync', '--to', proxy.url, '--site', 'Hall', '--data-dir', field.dataDir],
  ])
    assert.equal((await run(wrong)).code, 2, wrong.join(' '));
  assert.ok(existsSync(join(field.dataDir, 'sync.json')));
});
