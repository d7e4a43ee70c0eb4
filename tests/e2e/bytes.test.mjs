// Bytes of strangers against the real binary: a caster, a gpsd, an aircraft and clients that send what is no text. The server stays, says what it
// heard as UTF-8, starts again with what it kept, and every line of its log is one JSON object.
import assert from 'node:assert/strict';
import { createHash, randomBytes } from 'node:crypto';
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { LiveClient } from './live.mjs';
import { hall_outline } from './flight.mjs';
import { eventually, startServer } from './server.mjs';

const latin1 = (text) => Buffer.from(text, 'latin1');
let server;
const peers = [];
const get = async (path) => (await server.fetch(path)).json();

/** A TCP server that sends these bytes to whoever comes; its port. */
async function speaker(...pieces) {
  const socket = createServer((peer) => {
    peer.on('error', () => {});
    for (const piece of pieces) peer.write(piece);
  });
  await new Promise((done) => socket.listen(0, '127.0.0.1', done));
  peers.push(socket);
  return socket.address().port;
}

/** One request as bytes; {status, head, body} of its answer. */
function raw(bytes) {
  return new Promise((done, fail) => {
    const socket = connect(server.port, '127.0.0.1', () => socket.write(bytes));
    const got = [];
    socket.setTimeout(10_000, () => socket.destroy(new Error('no answer within 10 s')));
    socket.on('data', (chunk) => got.push(chunk));
    socket.on('error', fail);
    socket.on('end', () => {
      const all = Buffer.concat(got),
        end = all.indexOf('\r\n\r\n');
      done({
        status: Number(all.subarray(9, 12)),
        head: all.subarray(0, end).toString('latin1'),
        body: all.subarray(end + 4),
      });
    });
  });
}
const head = (line, ...headers) =>
  Buffer.concat([
    latin1(`${line} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n`),
    ...headers.map((h) => Buffer.concat([h, latin1('\r\n')])),
    latin1('\r\n'),
  ]);
/** Every answer's body is UTF-8 and JSON. */
function told({ status, body }) {
  const text = new TextDecoder('utf-8', { fatal: true }).decode(body);
  return { status, json: text === '' ? null : JSON.parse(text) };
}
function logIsJson() {
  for (const line of server.log.split('\n')) {
    if (line === '') continue;
    assert.doesNotThrow(() => JSON.parse(line), `not one JSON object: ${JSON.stringify(line)}`);
    assert.ok(!/\p{Cc}/u.test(line), `a control character in the log: ${JSON.stringify(line)}`);
  }
}

// --- MAVLink, as much as an aircraft needs to be heard ----------------------------------------------------------------
const EXTRA = { 0: 50, 1: 124, 33: 104, 245: 130, 253: 83 };
let sequence = 0;
function frame(id, payload) {
  const body = Buffer.concat([
    Buffer.from([payload.length, 0, 0, sequence++ & 255, 1, 1, id & 255, id >> 8, 0]),
    payload,
  ]);
  let crc = 0xffff;
  for (const byte of [...body, EXTRA[id]]) {
    let t = byte ^ (crc & 0xff);
    t = (t ^ (t << 4)) & 0xff;
    crc = ((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4)) & 0xffff;
  }
  return Buffer.concat([Buffer.from([0xfd]), body, Buffer.from([crc & 255, crc >> 8])]);
}
const heartbeat = () => frame(0, Buffer.from([4, 0, 0, 0, 2, 3, 81, 4, 3]));
function position() {
  const out = Buffer.alloc(28);
  out.writeInt32LE(510231000, 4);
  out.writeInt32LE(37131000, 8);
  out.writeInt32LE(60_000, 12);
  out.writeUInt16LE(65535, 26);
  return frame(33, out);
}
const on_ground = () => frame(245, Buffer.from([0, 1]));
const battery = () => frame(1, Buffer.concat([Buffer.alloc(30), Buffer.from([95])]));
const statustext = (bytes) => frame(253, Buffer.concat([Buffer.from([6]), bytes]));

let aircraft_says = Buffer.alloc(0);
before(async () => {
  const aircraft = createServer((peer) => {
    peer.on('error', () => {}).on('data', () => {});
    const timer = setInterval(
      () => peer.write(Buffer.concat([heartbeat(), position(), on_ground(), battery(), aircraft_says])),
      100,
    );
    peer.on('close', () => clearInterval(timer));
  });
  await new Promise((done) => aircraft.listen(0, '127.0.0.1', done));
  peers.push(aircraft);
  server = await startServer({
    args: [
      `--drone-address=tcp://127.0.0.1:${aircraft.address().port}`,
      '--log-level=debug',
      '--rate-burst=100000',
      '--rate-per-s=100000',
    ],
  });
});
after(async () => {
  for (const peer of peers) {
    peer.close();
    peer.closeAllConnections?.();
  }
  await server?.dispose();
});

test('a caster that answers in Latin-1 is told of in UTF-8, on REST and the live stream, and the server starts again with it', async () => {
  const port = await speaker(Buffer.from('ICY 4\xff\xfe1 Nicht erlaubt\r\n', 'latin1'));
  const live = await LiveClient.open(server);
  live.send({ op: 'sub', id: 1, topic: 'devices' });
  const made = await server.fetch('/api/v1/devices', {
    json: { kind: 'ntrip', name: 'caster', address: `tcp://127.0.0.1:${port}`, options: { mount: 'M' } },
  });
  assert.equal(made.status, 201, await made.clone().text());
  const { id } = await made.json();
  const said = 'the caster answers "ICY 4\ufffd\ufffd1 Nicht erlaubt"';
  const there = () => eventually('its status', async () => (await get(`/api/v1/devices/${id}`)).reason === said);
  await there();
  await live.next('the same on the live stream', (m) => JSON.stringify(m).includes('1 Nicht erlaubt'));
  await live.close();
  await server.restart();
  await there();
  assert.equal((await server.fetch('/readyz')).status, 200);
  assert.equal(
    (await get('/api/v1/alarms')).items.some((a) => a.id === 'server.task_failed'),
    false,
  );
  logIsJson();
});

test('a gpsd with broken strings and a receiver with broken sentences go on being read', async () => {
  const report = latin1(
    '{"class":"TPV","device":"/dev/\xe9\xff","mode":3,"time":"2024-06-13T09:20:00.000Z","lat":51.0,"lon":3.7}\r\n',
  );
  const port = await speaker(
    latin1('{"class":"VERSION","release":"\xff\xfe","rev":"x","proto_major":3,"proto_minor":14}\r\n'),
    report,
    latin1('{"class":"ERROR","message":"\x80\x9f"}\r\n'),
    latin1('$GPTXT,01,01,02,\xfc\x80 Antenne*00\r\n\xff\xfe\xfd'),
  );
  for (const format of ['gpsd', 'auto', 'nmea', 'llh']) {
    const made = await server.fetch('/api/v1/devices', {
      json: { kind: 'gnss', name: `r\u{9b}[2J ${format}`, address: `tcp://127.0.0.1:${port}`, options: { format } },
    });
    assert.equal(made.status, 201, await made.clone().text());
    const device = await made.json();
    await eventually(
      `${format} has heard it`,
      async () => (await get(`/api/v1/devices/${device.id}`)).counters.bytes_in > 50,
    );
    const again = await server.fetch(`/api/v1/devices/${device.id}`, {
      method: 'DELETE',
      headers: { 'if-match': made.headers.get('etag') },
    });
    assert.equal(again.status, 204);
  }
  logIsJson();
});

test('an aircraft whose texts hold 0x80 to 0xff is flown, and its text is UTF-8', async () => {
  aircraft_says = Buffer.concat(
    [
      Buffer.from(Array.from({ length: 50 }, (_, i) => 0x80 + i)),
      Buffer.from(Array.from({ length: 50 }, (_, i) => 0xce + i)),
    ].map(statustext),
  );
  const post = async (path, json) => {
    const answer = await server.fetch(path, { json });
    return { status: answer.status, json: await answer.json() };
  };
  const generated = await post('/api/v1/plans/generate', {
    name: 'Hall',
    outline: hall_outline,
    building_height_m: 8,
    settings: { max_height_m: 14 },
  });
  const plan = (await post('/api/v1/plans', generated.json.plan)).json.id;
  const mission = (await post('/api/v1/missions', { name: 'flight', frame: 'wgs84', track_point: 'tag_antenna' })).json
    .id;
  const lease = (await post(`/api/v1/missions/${mission}/control`, { action: 'take' })).json.lease;
  const list = () => get(`/api/v1/missions/${mission}/checklist?plan=${plan}`);
  await eventually(
    'the aircraft is heard',
    async () => (await list()).items.find((i) => i.id === 'drone').state === 'ok',
  );
  // A flight begins where the rover says that the aircraft is.
  const fix = {
    t_us: Date.now() * 1000,
    seq: 1,
    lon: 3.7131,
    lat: 51.023,
    h_m: 60,
    fix: 'fixed',
    sigma_m: [0.01, 0.01, 0.02],
  };
  const stored = await server.fetch(`/api/v1/fixes?mission=${mission}`, {
    method: 'POST',
    body: `${JSON.stringify(fix)}\n`,
    headers: { 'content-type': 'application/x-ndjson' },
  });
  assert.equal(stored.status, 200, await stored.text());
  await eventually('its place is known', async () => (await list()).items.find((i) => i.id === 'place').state === 'ok');
  for (const item of (await list()).items.filter((i) => i.state !== 'ok')) {
    assert.ok(item.manual || item.overridable, JSON.stringify(item));
    assert.equal((await post(`/api/v1/missions/${mission}/checklist/${item.id}`, { reason: 'a test' })).status, 200);
  }
  const started = await eventually('the flight begins', async () => {
    const answer = await post(`/api/v1/missions/${mission}/actions`, { action: 'start', plan, lease });
    return answer.status === 202 || !/position is not known/.test(answer.json.detail) ? answer : null;
  });
  assert.equal(started.status, 202, JSON.stringify(started.json));
  const { drone } = await eventually('its text', async () => {
    const now = await get(`/api/v1/missions/${mission}/procedure`);
    return now.drone?.text ? now : null;
  });
  assert.match(drone.text, /^\ufffd{40,50}$/);
  await post(`/api/v1/missions/${mission}/actions`, { action: 'abort', lease });
  aircraft_says = Buffer.alloc(0);
  logIsJson();
});

test('names, ids and paths with every odd byte are stored as text or refused in words', async () => {
  for (let byte = 0; byte < 256; ++byte) {
    const hex = byte.toString(16).padStart(2, '0');
    const body = Buffer.concat([
      latin1('{"name":"x'),
      Buffer.from([byte]),
      latin1('y","frame":"wgs84","track_point":"tag_antenna"}'),
    ]);
    const made = told(
      await raw(
        Buffer.concat([
          head(
            'POST /api/v1/missions',
            latin1('Content-Type: application/json'),
            latin1(`Content-Length: ${body.length}`),
          ),
          body,
        ]),
      ),
    );
    const plain = byte >= 0x20 && byte < 0x7f && byte !== 0x22 && byte !== 0x5c;
    assert.equal(made.status, plain ? 201 : byte === 0x7f ? 422 : 400, `${hex}: ${JSON.stringify(made.json)}`);
    const key = Buffer.concat([latin1('{"k'), Buffer.from([byte]), latin1('":1}')]);
    const unknown = told(
      await raw(
        Buffer.concat([
          head(
            'POST /api/v1/devices',
            latin1('Content-Type: application/json'),
            latin1(`Content-Length: ${key.length}`),
          ),
          key,
        ]),
      ),
    );
    assert.ok([400, 422].includes(unknown.status), `${hex}: ${unknown.status}`);
    const asked = [
      `/api/v1/devices/%${hex}`,
      `/api/v1/missions/%${hex}%c3`,
      `/api/v1/ranges?mission=%${hex}`,
      `/api/v1/alarms/%${hex}/ack`,
      `/%${hex}.html`,
    ].map(async (path) => {
      const answer = await raw(head(`GET ${path}`));
      assert.ok((answer.status >= 400 && answer.status < 500) || path.endsWith('.html'), `${path}: ${answer.status}`);
      if (/problem/.test(answer.head)) told(answer);
    });
    const odd = Buffer.concat([latin1('x'), Buffer.from([byte]), latin1('y')]);
    asked.push(
      ...['User-Agent', 'X-Request-Id', 'If-None-Match', 'Idempotency-Key', 'Content-Disposition', 'Cookie'].map(
        async (name) => {
          const answer = await raw(head('GET /api/v1/missions?limit=1', Buffer.concat([latin1(`${name}: `), odd])));
          assert.ok([200, 400].includes(answer.status), `${name} ${hex}: ${answer.status}`);
          told(answer);
        },
      ),
    );
    await Promise.all(asked);
  }
  for (const item of (await get('/api/v1/missions?limit=200')).items) assert.ok(item.name);
  logIsJson();
});

test('a WebSocket text that is no UTF-8 ends that socket alone, every odd one is answered', async () => {
  const other = await LiveClient.open(server);
  const key = randomBytes(16).toString('base64');
  const socket = connect(server.port, '127.0.0.1');
  socket.write(
    `GET /api/v1/ws HTTP/1.1\r\nHost: 127.0.0.1:${server.port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n` +
      `Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: anchord.v1\r\nSec-WebSocket-Key: ${key}\r\n\r\n`,
  );
  let got = Buffer.alloc(0);
  socket.on('data', (chunk) => (got = Buffer.concat([got, chunk]))).on('error', () => {});
  const accept = createHash('sha1').update(`${key}258EAFA5-E914-47DA-95CA-C5AB0DC85B11`).digest('base64');
  await eventually('it is open', () => got.includes(accept));
  const text = latin1('{"op":"sub","topic":"\xff\xfe"}');
  socket.write(Buffer.concat([Buffer.from([0x81, 0x80 | text.length, 0, 0, 0, 0]), text])); // masked with zeros
  await new Promise((done) => socket.once('close', done));
  assert.ok(got.includes(Buffer.from([0x03, 0xef])), 'closed with 1007');
  for (let code = 0; code < 0x180; ++code) other.send({ op: 'sub', id: code, topic: `t${String.fromCharCode(code)}` });
  for (let code = 0; code < 0x180; code += 0x7f)
    await other.next(`an answer to ${code}`, (m) => m.op === 'err' && m.id === code);
  await other.close();
  logIsJson();
});

test('what is kept of devices never keeps the server from starting: it says which, why and what to do', async () => {
  await server.dispose();
  server = await startServer();
  const made = await server.fetch('/api/v1/devices', {
    json: { kind: 'ntrip', name: 'caster', address: 'tcp://127.0.0.1:9', options: { mount: 'M' } },
  });
  assert.equal(made.status, 201, await made.text());
  await server.stop();
  const file = join(server.dataDir, 'devices.json');
  const kept = JSON.parse(readFileSync(file, 'utf8'));
  const entry = (id, more) =>
    JSON.stringify({
      id: `01890000-0000-7000-8000-00000000000${id}`,
      kind: 'gnss',
      name: `kept ${id}`,
      address: `tcp://127.0.0.1:${id}`,
      options: {},
      enabled: true,
      version: 1,
      ...more,
    });
  const entries = [
    JSON.stringify(kept.devices[0]),
    entry(1, { kind: 'lidar' }),
    entry(2, { options: { format: { no: 'word' } } }),
    entry(3, { address: 7 }),
    entry(4, { name: 'M@nchen' }),
    '17',
  ];
  writeFileSync(
    file,
    Buffer.from(`{"schema":"anchord.devices/1","devices":[${entries.join(',')}]}`.replace('M@', 'M\xfc'), 'latin1'),
  );
  await server.start();
  const { items } = await get('/api/v1/devices');
  const devices = items.filter((d) => d.id);
  assert.deepEqual(
    devices.map((d) => d.name),
    ['caster', 'kept 1', 'kept 2', 'kept 3', 'M\ufffdnchen', ''],
  );
  for (const [i, why] of [
    [1, /no driver for "lidar"/],
    [2, /format: must be one of/],
    [3, /address: not a string/],
    [5, /not an object/],
  ]) {
    assert.equal(devices[i].state, 'off');
    assert.match(devices[i].reason, /^not started: .*; correct its settings or remove it$/);
    assert.match(devices[i].reason, why);
  }
  assert.notEqual(devices[4].state, 'off');
  const alarm = await eventually('the alarm', async () =>
    (await get('/api/v1/alarms')).items.find((a) => a.id === 'device.not_started'),
  );
  assert.match(alarm.text, /kept 1.*lidar/);
  assert.ok(server.log.includes('no driver for'));
  // Removed one by one; what stood there is kept beside it.
  for (const device of devices.slice(1)) {
    const etag = (await server.fetch(`/api/v1/devices/${device.id}`)).headers.get('etag');
    assert.equal(
      (await server.fetch(`/api/v1/devices/${device.id}`, { method: 'DELETE', headers: { 'if-match': etag } })).status,
      204,
    );
  }
  await eventually(
    'the alarm is over',
    async () => !(await get('/api/v1/alarms')).items.some((a) => a.id === 'device.not_started'),
  );
  assert.deepEqual(
    readdirSync(server.dataDir).filter((name) => name.startsWith('devices.json.')),
    ['devices.json.unreadable-1'],
  );
  await server.stop();
  writeFileSync(file, latin1('\xff\xfe no list \x00'));
  await server.start();
  assert.deepEqual(
    (await get('/api/v1/devices')).items.filter((d) => d.id),
    [],
  );
  const spoilt = await eventually('the alarm of the file', async () =>
    (await get('/api/v1/alarms')).items.find((a) => a.id === 'device.not_started'),
  );
  assert.match(spoilt.text, /devices\.json: not a list of devices.*repair the file/);
  logIsJson();
});
