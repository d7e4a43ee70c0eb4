// Bundles over a link that is cut within them: what arrived is not sent again, by `anchord sync` both ways, by curl, past kills of either end;
// and what an upload in parts refuses.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { crc32, deflateSync } from 'node:zlib';
import { LinkProxy } from './gateway.mjs';
import { binary, eventually, run, startServer } from './server.mjs';
import { counted, forwarding, json, ok, rows, stranger } from './sync_parts.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord sync cut '));
const k_drip = 32_000; // bytes a second: 256 kbit/s
let field, centre;

/** Numbers that are the same in each run (a linear congruential generator), in [0, 1). */
function chance(seed) {
  let state = seed;
  return () => (state = (state * 1_103_515_245 + 12_345) % 2_147_483_648) / 2_147_483_648;
}

/** A way to a server on which each connection breaks after some bytes of both directions. */
async function cutting(port, from, to, seed) {
  const random = chance(seed);
  const proxy = { cuts: 0, toServer: 0, toClient: 0 };
  const server = createServer((client) => {
    const upstream = connect(port, '127.0.0.1');
    let left = from + random() * (to - from);
    const end = () => {
      client.destroy();
      upstream.destroy();
    };
    const pass = (bytes, on, key) => {
      const some = bytes.subarray(0, Math.ceil(Math.min(bytes.length, left)));
      proxy[key] += some.length;
      left -= some.length;
      on.write(some);
      if (left > 0) return;
      ++proxy.cuts;
      setTimeout(end, 5);
      client.pause();
      upstream.pause();
    };
    client.on('data', (bytes) => pass(bytes, upstream, 'toServer'));
    upstream.on('data', (bytes) => pass(bytes, client, 'toClient'));
    for (const socket of [client, upstream]) socket.on('error', end).on('close', end);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  proxy.url = `http://127.0.0.1:${server.address().port}`;
  proxy.close = () => server.close();
  return proxy;
}

/** A finished flight of rows that hardly get smaller in a zip file. */
async function noisy(server, seed, n, site) {
  const random = chance(seed);
  const mission = {
    name: `noisy ${seed}`,
    frame: 'wgs84',
    track_point: 'gnss_antenna',
    tags: [],
    ...(site && { site }),
  };
  const { id } = await ok(server, '/api/v1/missions?devices=false', { json: mission });
  for (let i = 0; i < n; i += 5000) {
    const batch = Array.from({ length: 5000 }, (_, k) => ({
      t_us: Date.now() * 1000 + k,
      seq: i + k,
      tag: '0x6e01',
      anchor: `0x6a${(16 + Math.floor(random() * 8)).toString(16)}`,
      distance_m: 5 + random() * 90,
      rss_dbm: -60 - random() * 40,
    }));
    await ok(server, `/api/v1/ranges?mission=${id}`, rows(batch));
  }
  await ok(server, `/api/v1/missions/${id}/actions`, { json: { action: 'finish' } });
  return id;
}
/** Grey noise, which hardly gets smaller either. */
function noise_png(width, height, random) {
  const part = (type, content) => {
    const named = Buffer.concat([Buffer.from(type), content]);
    const out = Buffer.alloc(named.length + 8);
    out.writeUInt32BE(content.length, 0);
    named.copy(out, 4);
    out.writeUInt32BE(crc32(named), named.length + 4);
    return out;
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.writeUInt8(8, 8); // bits, of grey
  const rows = Buffer.alloc((width + 1) * height, 0).map((_, i) => (i % (width + 1) === 0 ? 0 : 256 * random()));
  const signature = Buffer.from('89504e470d0a1a0a', 'hex');
  return Buffer.concat([signature, part('IHDR', head), part('IDAT', deflateSync(rows)), part('IEND', Buffer.alloc(0))]);
}
/** What the notes of the field say of the centre is from here on of this address. */
function known_as(url) {
  const path = join(field.dataDir, 'sync.json');
  const { schema, ...of } = JSON.parse(readFileSync(path, 'utf8'));
  writeFileSync(path, JSON.stringify({ schema, [url]: Object.assign({}, ...Object.values(of)) }));
}
const bundle_of = async (server, id) =>
  Buffer.from(await (await server.fetch(`/api/v1/missions/${id}/bundle`)).arrayBuffer());
const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const words = (way, url, ...args) => [
  ...['sync', way, url, '--token-file', join(folder, 'token'), '--data-dir', field.dataDir],
  ...args,
];
const left_over = () => readdirSync(field.dataDir).filter((name) => name.startsWith('sync-part-'));
const k_questions = 40_000; // bytes of all that is asked beside a bundle

async function token(name, roles) {
  return (await ok(centre, '/api/v1/tokens', { json: { name, roles } })).token;
}

before(async () => {
  field = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  centre = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  writeFileSync(join(folder, 'token'), centre.token + '\n');
});
after(async () => {
  await field?.dispose();
  await centre?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('up, over a link that breaks every 50 to 200 kB, one run brings a flight and sends hardly a byte twice', async () => {
  const id = await noisy(field, 1, 30_000);
  const { length } = await bundle_of(field, id);
  assert.ok(length > 600_000, `${length} bytes`);
  const proxy = await cutting(centre.port, 50_000, 200_000, 3);
  const { code, stdout, stderr } = await run(words('--to', proxy.url));
  proxy.close();
  assert.equal(code, 0, stdout + stderr);
  assert.ok(proxy.cuts >= 3, `${proxy.cuts} cuts`);
  assert.ok(proxy.toServer < 1.2 * length + k_questions, `${proxy.toServer} bytes for a bundle of ${length}`);
  assert.deepEqual(await counted(centre), await counted(field));
  const [there, here] = await Promise.all(
    [centre, field].map((one) => ok(one, `/api/v1/ranges?mission=${id}&limit=50`)),
  );
  const values = (page) => page.items.map((row) => [row.seq, row.anchor, row.distance_m, row.rss_dbm]);
  assert.deepEqual(values(there), values(here));
  assert.deepEqual(readdirSync(join(centre.dataDir, 'spool-uploads')), [], 'nothing of it stays');
});

// A server that is killed loses what it had not read of a part: 256 KiB, and what the sockets hold.
test('up, at 1 Mbit/s, kill -9 of the sync and of the centre cost only what was on the way', async () => {
  const id = await noisy(field, 2, 70_000);
  const { length } = await bundle_of(field, id);
  const proxy = await new LinkProxy(centre.port).start();
  proxy.bytesPerS = k_drip * 4;
  known_as(proxy.url);
  const killed = spawn(binary, words('--to', proxy.url), { stdio: 'ignore' });
  const ended = new Promise((done) => killed.once('exit', done));
  await eventually('a third is on its way', () => proxy.toServer > length / 3, 60_000);
  killed.kill('SIGKILL');
  await ended;
  const through = run(words('--to', proxy.url));
  await eventually('two thirds are on their way', () => proxy.toServer > (length * 2) / 3, 60_000);
  await centre.kill();
  await centre.start();
  const { code, stdout, stderr } = await through;
  proxy.close();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stderr, /going on after \d\.\d MB of/);
  assert.ok(proxy.toServer < 1.2 * length + k_questions, `${proxy.toServer} bytes for a bundle of ${length}`);
  assert.deepEqual(await counted(centre), await counted(field));
});

// Five plans, so that what the sockets of a killed end hold is a small part of them.
test('down, over a link that breaks and past kill -9 of both ends, the rest alone comes', async () => {
  const origin = { lon: 3.713, lat: 51.023, h_m: 55 };
  const site = await ok(centre, '/api/v1/sites', { json: { name: 'Big plans', origin } });
  const building = await ok(centre, '/api/v1/buildings', { json: { site: site.id, name: 'B' } });
  const random = chance(5);
  for (let level = 0; level < 5; ++level) {
    const floor = await ok(centre, '/api/v1/floors', { json: { building: building.id, name: `F${level}`, level } });
    const path = `/api/v1/floors/${floor.id}`;
    const etag = (await centre.fetch(path)).headers.get('etag');
    await ok(centre, `${path}/plan`, {
      method: 'PUT',
      headers: { 'if-match': etag, 'content-type': 'image/png' },
      body: noise_png(600, 500, random),
    });
  }
  const made = await centre.fetch(`/api/v1/sites/${site.id}/bundle?flights=false`);
  const { byteLength: length } = await made.arrayBuffer();
  assert.ok(length > 500_000, `${length} bytes`);
  const drip = await new LinkProxy(centre.port).start();
  const options = ['--site', 'Big plans'];
  drip.bytesPerS = k_drip * 4;
  const killed = spawn(binary, words('--from', drip.url, ...options), { stdio: 'ignore' });
  const ended = new Promise((done) => killed.once('exit', done));
  await eventually('a third is on its way', () => drip.toClient > length / 3, 60_000);
  killed.kill('SIGKILL');
  await ended;
  assert.ok(left_over().length > 0, 'what came is kept');
  await centre.kill();
  await centre.start();
  const through = run(words('--from', drip.url, ...options, '--wait', '20'));
  await eventually('more is on its way', () => drip.toClient > (length * 2) / 3, 60_000);
  await drip.cut();
  await drip.restore();
  const { code, stdout, stderr } = await through;
  const sum = drip.toClient;
  drip.close();
  assert.equal(code, 0, stdout + stderr);
  assert.ok(sum < 1.2 * length + k_questions, `${sum} bytes for a bundle of ${length}`);
  const digest = async (server) =>
    /sha256:([0-9a-f]{64})\./.exec(
      (await server.fetch(`/api/v1/sites/${site.id}/bundle?flights=false`)).headers.get('etag'),
    )[1];
  assert.equal(await digest(field), await digest(centre));
  assert.deepEqual(left_over(), []);
});

test('down, a guest network that wants a sign-in within a bundle is waited out, and what came stays', async () => {
  const origin = { lon: 3.713, lat: 51.023, h_m: 55 };
  const site = await ok(centre, '/api/v1/sites', { json: { name: 'Behind a hotel', origin } });
  const building = await ok(centre, '/api/v1/buildings', { json: { site: site.id, name: 'B' } });
  const floor = await ok(centre, '/api/v1/floors', { json: { building: building.id, name: 'F0', level: 0 } });
  const path = `/api/v1/floors/${floor.id}`;
  await ok(centre, `${path}/plan`, {
    method: 'PUT',
    headers: { 'if-match': (await centre.fetch(path)).headers.get('etag'), 'content-type': 'image/png' },
    body: noise_png(600, 500, chance(8)),
  });
  const half = 150_000,
    ranges = [];
  let until_ms = 0;
  const change = (req, res, back) => {
    const bundle = req.url.startsWith(`/api/v1/sites/${site.id}/bundle`);
    if (!back && Date.now() < until_ms) {
      res.writeHead(200, { 'content-type': 'text/html' }).end('<html>Welcome to our guest network</html>');
      return true;
    }
    if (!back && bundle) ranges.push(req.headers.range);
    if (!back || !bundle || until_ms) return false;
    until_ms = Infinity;
    let left = half;
    res.writeHead(back.statusCode, back.headers);
    back.on('data', (bytes) => {
      res.write(bytes.subarray(0, left));
      left -= Math.min(left, bytes.length);
      if (left > 0 || until_ms !== Infinity) return;
      until_ms = Date.now() + 3000;
      setTimeout(() => res.destroy(), 200);
    });
    return true;
  };
  await stranger(forwarding(centre, change), async (url) => {
    const { code, stdout, stderr } = await run(words('--from', url, '--site', 'Behind a hotel', '--wait', '30'));
    assert.equal(code, 0, stdout + stderr);
    assert.match(stderr, /a web page answers \(200\), not the server/);
  });
  assert.deepEqual(ranges, [undefined, `bytes=${half}-`]);
  assert.deepEqual(left_over(), []);
});

test('curl goes on with a flight and with a site of ours, byte for byte; a range of another version is not mixed in', async () => {
  const id = (await ok(centre, '/api/v1/missions')).items.find((one) => one.name === 'noisy 1').id;
  const whole = await bundle_of(centre, id);
  const proxy = await cutting(centre.port, 100_000, 300_000, 11);
  const file = join(folder, 'by curl');
  const bearer = ['-sS', '-H', `Authorization: Bearer ${centre.token}`];
  const curl = (...args) =>
    new Promise((done) => execFile('curl', [...bearer, ...args], (error) => done(error?.code ?? 0)));
  let calls = 0;
  while ((await curl('--continue-at', '-', '-o', file, `${proxy.url}/api/v1/missions/${id}/bundle`)) !== 0)
    assert.ok(++calls < 50, 'it never ends');
  proxy.close();
  assert.ok(proxy.cuts >= 2, `${proxy.cuts} cuts`);
  assert.ok(readFileSync(file).equals(whole));
  const path = `/api/v1/missions/${id}/bundle`;
  const answer = await centre.fetch(path);
  const etag = answer.headers.get('etag');
  await answer.arrayBuffer();
  for (const [headers, status, length] of [
    [{ range: 'bytes=5-9', 'if-range': etag }, 206, 5],
    [{ range: 'bytes=-7' }, 206, 7],
    [{ range: 'bytes=0-' }, 206, whole.length],
    [{ range: 'bytes=5-9', 'if-range': '"sha256:other"' }, 200, whole.length],
    [{ range: 'bytes=0-1,4-5' }, 200, whole.length],
    [{ range: 'lines=1-2' }, 200, whole.length],
    [{ range: 'bytes=9-5' }, 200, whole.length],
    [{ 'if-none-match': etag }, 304, 0],
  ]) {
    const got = await centre.fetch(path, { headers });
    const bytes = await got.arrayBuffer();
    assert.deepEqual([got.status, bytes.byteLength], [status, length], JSON.stringify(headers));
  }
  const beyond = await centre.fetch(path, { headers: { range: `bytes=${whole.length}-` } });
  assert.deepEqual([beyond.status, beyond.headers.get('content-range')], [416, `bytes */${whole.length}`]);
  await beyond.text();
  const other = await token('reader of parts', ['viewer']);
  const theirs = await centre.fetch(path, { token: other, headers: { range: 'bytes=5-9', 'if-range': etag } });
  assert.equal(theirs.status, 200, 'what was kept for another token is not theirs');
  await theirs.arrayBuffer();
});

test('an upload is its token’s alone, is bounded, and nothing is imported before the digest of the whole agrees', async () => {
  const [one, two] = [await token('one', ['engineer']), await token('two', ['engineer'])];
  const body = Buffer.alloc(1000, 7);
  const uploads = '/api/v1/bundles/uploads';
  const begin = (who, bytes, digest) => centre.fetch(uploads, { token: who, json: { bytes, sha256: digest } });
  const begun = await (await begin(one, 1000, sha256(body))).json();
  const path = `${uploads}/${begun.id}`;
  const patch = (who, at, bytes) =>
    centre.fetch(path, {
      token: who,
      method: 'PATCH',
      headers: { 'content-type': 'application/offset+octet-stream', 'upload-offset': String(at) },
      body: bytes,
    });
  assert.notEqual(
    (await (await begin(two, 1000, sha256(body))).json()).id,
    begun.id,
    'the same bundle, another upload',
  );
  for (const method of ['GET', 'DELETE']) assert.equal((await centre.fetch(path, { token: two, method })).status, 404);
  assert.equal((await patch(two, 0, body)).status, 404);
  assert.equal((await centre.fetch(`${path}/import`, { token: two, method: 'POST' })).status, 404);
  assert.equal((await patch(one, 1, body.subarray(1))).status, 409, 'no gap');
  assert.equal((await patch(one, 0, Buffer.alloc(999))).status, 204);
  assert.equal((await patch(one, 0, body)).status, 409, 'not twice');
  assert.equal((await centre.fetch(path, { token: one, method: 'HEAD' })).headers.get('upload-offset'), '999');
  assert.equal((await patch(one, 999, Buffer.alloc(2))).status, 413);
  assert.equal((await patch(one, 999, Buffer.alloc(1))).status, 204);
  const refused = await centre.fetch(`${path}/import`, { token: one, method: 'POST' });
  assert.equal(refused.status, 422);
  assert.match((await refused.json()).detail, /does not have the SHA-256 that was announced/);
  assert.equal((await centre.fetch(path, { token: one })).status, 404);

  assert.equal((await begin(one, 2 ** 31 + 1, sha256('x'))).status, 422);
  const ids = [];
  for (let i = 0; i < 6; ++i) ids.push((await (await begin(one, 10, sha256(`small ${i}`))).json()).id);
  const alive = [];
  for (const id of ids) alive.push((await centre.fetch(`${uploads}/${id}`, { token: one })).status);
  assert.deepEqual(alive.filter((status) => status === 200).length, 4, 'no token has more than four');
  assert.equal(alive.at(-1), 200);
  for (let i = 0; i < 3; ++i) await begin(one, 2 ** 31, sha256(`large ${i}`));
  const mine = readdirSync(join(centre.dataDir, 'spool-uploads')).filter((name) => name.endsWith('.json'));
  const sum = mine.reduce((n, name) => {
    const { token: whose, bytes } = JSON.parse(readFileSync(join(centre.dataDir, 'spool-uploads', name), 'utf8'));
    n[whose] = (n[whose] ?? 0) + bytes;
    return n;
  }, {});
  for (const bytes of Object.values(sum)) assert.ok(bytes <= 2 ** 32, `${bytes} announced by one token`);
});

test('two that send the same flight at once bring it once; an older centre takes it whole, and that is said', async () => {
  const id = await noisy(field, 3, 10_000);
  const bytes = await bundle_of(field, id);
  known_as(centre.url);
  const both = await Promise.all([run(words('--to', centre.url)), run(words('--to', centre.url))]);
  for (const { code, stdout, stderr } of both) assert.equal(code, 0, stdout + stderr);
  assert.deepEqual(await counted(centre), await counted(field));
  await noisy(field, 4, 10_000);
  const older = forwarding(centre, (req, res, back) => {
    if (back || !req.url.startsWith('/api/v1/bundles/uploads')) return false;
    json(res, 404, { detail: 'no such path' });
    return true;
  });
  const got = await stranger(older, (url) => {
    known_as(url);
    return run(words('--to', url));
  });
  assert.equal(got.code, 0, got.stdout + got.stderr);
  assert.match(got.stderr, /does not take bundles in parts \(it is older than this program\)/);
  assert.deepEqual(await counted(centre), await counted(field));
  assert.ok(bytes.length > 131_072, `${bytes.length} bytes are sent in parts`);
});
