// A flight with everything against it at once: a caster that answers in Latin-1, noise on a tag's port, a viewer who floods, a second operator
// who wants the aircraft, a stranger on the MAVLink port, a clock that steps 300 days, a disk that is full for 20 s, the server killed twice.
// The aircraft lands, every acknowledged row is stored once, no command comes from a stranger. How long `hold` takes is printed, not asserted.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { hall_outline, ndjson } from '../e2e/flight.mjs';
import { faketime, otherClock } from '../e2e/other_clock.mjs';
import { free_udp_port } from '../e2e/ports.mjs';
import { binary, eventually, startServer } from '../e2e/server.mjs';

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

let folder,
  server,
  aircraft,
  mission,
  lease,
  sideMission,
  flying = true;
const tokens = {};
const background = []; // attackers; each ends when `flying` does
const sockets = [];
const acknowledged = []; // rows of the side mission that were answered with 200
const waits = { hold: [], lease: [] }; // ms
let strangerReceived = 0;

/** One request; status 0 where the server is away. */
async function call(who, method, path, { json, headers, body } = {}) {
  try {
    const answer = await server.fetch(path, {
      method,
      token: tokens[who],
      json,
      headers,
      body,
      signal: AbortSignal.timeout(30_000),
    });
    const text = await answer.text();
    return {
      status: answer.status,
      headers: answer.headers,
      json: (answer.headers.get('content-type') ?? '').includes('json') && text ? JSON.parse(text) : undefined,
    };
  } catch {
    return { status: 0 };
  }
}
const procedure = async () => (await call('pilot', 'GET', `/api/v1/missions/${mission}/procedure`)).json;
const act = (action, more = {}) =>
  call('pilot', 'POST', `/api/v1/missions/${mission}/actions`, { json: { action, lease, ...more } });
async function takeControl() {
  lease = await eventually(
    'the pilot has control',
    async () =>
      (await call('pilot', 'POST', `/api/v1/missions/${mission}/control`, { json: { action: 'take', force: true } }))
        .json?.lease,
    20_000,
    100,
  );
}
/** The command is accepted by the aircraft; sent again while the server refuses or is away. */
async function command(action, more = {}) {
  let answer;
  await eventually(
    `${action} is taken`,
    async () => {
      const began = performance.now();
      answer = await act(action, more);
      if (answer.status === 202 && action === 'hold') waits.hold.push(performance.now() - began);
      if (answer.status === 409) await takeControl();
      return answer.status === 202;
    },
    30_000,
    200,
  );
  return eventually(
    `${action} is accepted`,
    async () => {
      const found = (await procedure())?.commands.find((c) => c.number === answer.json.number);
      assert.notEqual(found?.state, 'refused', JSON.stringify(found));
      return found?.state === 'accepted';
    },
    30_000,
    100,
  );
}
/** Runs `step` again and again until the flight is over; what it throws ends the test. */
function attack(step, pauseMs) {
  background.push(
    (async () => {
      while (flying) {
        await step();
        await sleep(pauseMs);
      }
    })(),
  );
}
function percentiles(list) {
  const sorted = [...list].sort((a, b) => a - b);
  const at = (p) => sorted[Math.min(sorted.length - 1, Math.floor(p * sorted.length))]?.toFixed(1);
  return `${sorted.length} answers, p50 ${at(0.5)} ms, p90 ${at(0.9)} ms, p99 ${at(0.99)} ms, worst ${at(1)} ms`;
}
async function listen(onConnection) {
  const tcp = createServer((socket) => {
    socket.on('error', () => {});
    onConnection(socket);
  });
  await new Promise((done) => tcp.listen(0, '127.0.0.1', done));
  sockets.push(tcp);
  return tcp.address().port;
}
const stepClock = (text) => writeFileSync(join(folder, 'clock'), text + '\n');
/** Every write of the server to a file fails as on a full disk (EFBIG) until it is lifted. */
const fillDisk = (full) =>
  execFileSync('prlimit', ['--pid', String(server.pid), `--fsize=${full ? '0' : 'unlimited'}:unlimited`]);

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  stepClock('+0d');
  assert.ok(faketime, 'libfaketime is not installed (package libfaketime)');
  const env = {
    ...otherClock(),
    FAKETIME_TIMESTAMP_FILE: join(folder, 'clock'),
    FAKETIME_CACHE_DURATION: '1',
  };
  const mavlink = await free_udp_port();
  server = await startServer({ auth: 'on', args: ['--drone-address', `udp://:${mavlink}`], env });
  tokens.admin = server.token;
  for (const [name, role] of [
    ['pilot', 'operator'],
    ['second', 'operator'],
    ['viewer', 'viewer'],
    ['gateway', 'gateway'],
  ]) {
    tokens[name] = (await call('admin', 'POST', '/api/v1/tokens', { json: { name, roles: [role] } })).json.token;
  }
  const both = (
    await call('admin', 'POST', '/api/v1/tokens', { json: { name: 'aircraft', roles: ['gateway', 'operator'] } })
  ).json.token;
  writeFileSync(join(folder, 'token'), both, { mode: 0o600 });
  let output = '';
  aircraft = spawn(
    binary,
    [
      'simulate',
      'drone',
      '--mavlink',
      `udp://127.0.0.1:${mavlink}`,
      '--url',
      server.url,
      '--token-file',
      join(folder, 'token'),
      '--ready',
      '2',
    ],
    { stdio: ['ignore', 'ignore', 'pipe'] },
  );
  aircraft.stderr.setEncoding('utf8').on('data', (chunk) => (output += chunk));
  mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(output)?.[1]);

  // A stranger speaks MAVLink 1 at the same port once the aircraft is there: a heartbeat of an autopilot and a request to disarm.
  await eventually(
    'the aircraft is there',
    async () => (await call('pilot', 'GET', '/api/v1/system')).json?.drone?.mode,
    20_000,
    100,
  );
  const stranger = createSocket('udp4');
  stranger.on('message', () => strangerReceived++);
  sockets.push(stranger);
  const heartbeat = mavlink1(0, 50, Buffer.from([0, 0, 0, 0, 2, 3, 81, 3, 3]));
  attack(() => new Promise((done) => stranger.send(heartbeat, mavlink, '127.0.0.1', done)), 50);
});

/** MAVLink 1 frame of system 66, component 1; the checksum is X.25 with the message's extra byte. */
function mavlink1(id, extra, payload) {
  const body = Buffer.concat([Buffer.from([payload.length, 0, 66, 1, id]), payload]);
  let crc = 0xffff;
  for (const byte of [...body, extra]) {
    let t = (byte ^ crc) & 0xff;
    t = (t ^ (t << 4)) & 0xff;
    crc = ((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4)) & 0xffff;
  }
  return Buffer.concat([Buffer.from([0xfe]), body, Buffer.from([crc & 0xff, crc >> 8])]);
}

after(async () => {
  flying = false;
  aircraft?.kill('SIGINT');
  for (const socket of sockets) socket.close();
  await server?.dispose();
  if (folder) rmSync(folder, { recursive: true, force: true });
});

test('everything hostile begins, and the flight starts all the same', async () => {
  const caster = await listen((socket) =>
    socket.once('data', () => socket.end(Buffer.from('ICY 4\xff\xfe1 Nicht erlaubt\r\n\r\n', 'latin1'))),
  );
  const noise = await listen((socket) => {
    const timer = setInterval(
      () => socket.write(Buffer.from(Array.from({ length: 200 }, () => Math.floor(Math.random() * 256)))),
      20,
    );
    socket.on('close', () => clearInterval(timer));
  });
  for (const json of [
    { kind: 'ntrip', name: 'caster', address: `tcp://127.0.0.1:${caster}`, options: { mount: 'RTCM3' } },
    { kind: 'pozyx', name: 'noise', address: `tcp://127.0.0.1:${noise}` },
  ])
    assert.equal((await call('pilot', 'POST', '/api/v1/devices', { json })).status, 201);

  const plan = await call('pilot', 'POST', '/api/v1/plans/generate', {
    json: { name: 'Hall', outline: hall_outline, building_height_m: 8, settings: { max_height_m: 14 } },
  });
  assert.equal(plan.status, 200, JSON.stringify(plan.json));
  const stored = (await call('pilot', 'POST', '/api/v1/plans', { json: plan.json.plan })).json.id;

  // A viewer: the dearest requests he may make, several at a time, each with a key that wants its answer kept.
  for (let i = 0; i < 6; i++) {
    attack(
      () =>
        call('viewer', 'POST', `/api/v1/plans/${stored}/validate`, {
          json: {},
          headers: { 'idempotency-key': crypto.randomUUID() },
        }),
      1,
    );
  }
  // A second operator: missions of his own, and commands without control.
  attack(async () => {
    const made = await call('second', 'POST', '/api/v1/missions', {
      json: {
        name: 'mine',
        kit: 'simulated',
        frame: 'wgs84',
        track_point: 'gnss_antenna',
        tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
      },
    });
    if (made.status === 201) await call('second', 'DELETE', `/api/v1/missions/${made.json.id}`);
    for (const action of ['land', 'abort', 'return']) {
      const answer = await call('second', 'POST', `/api/v1/missions/${mission}/actions`, { json: { action } });
      assert.notEqual(answer.status, 202, `${action} of a stranger was taken`);
    }
    assert.notEqual(
      (await call('second', 'DELETE', `/api/v1/missions/${mission}`)).status,
      204,
      'a flight in the air was deleted',
    );
  }, 300);

  await call('pilot', 'POST', `/api/v1/missions/${mission}/checklist`, { json: { plan: stored } });
  const checklist = async () =>
    (await call('pilot', 'GET', `/api/v1/missions/${mission}/checklist?plan=${stored}`)).json;
  await eventually(
    'RTK has been fixed for 10 s',
    async () => (await checklist())?.items.find((i) => i.id === 'rtk').state === 'ok',
    60_000,
    500,
  );
  for (const item of (await checklist()).items.filter((i) => i.state !== 'ok')) {
    assert.ok(item.manual || item.overridable, JSON.stringify(item));
    await call('pilot', 'POST', `/api/v1/missions/${mission}/checklist/${item.id}`, { json: { reason: 'a test' } });
  }
  await takeControl();
  await command('start', { plan: stored });
  await eventually('the aircraft is in the air', async () => (await procedure())?.drone?.in_air, 60_000, 250);

  // A gateway delivers rows of another flight and remembers what was acknowledged.
  sideMission = (
    await eventually(
      'a side mission',
      async () =>
        (
          await call('pilot', 'POST', '/api/v1/missions', {
            json: {
              name: 'side',
              kit: 'side',
              frame: 'wgs84',
              track_point: 'gnss_antenna',
              tags: [{ tag: '0x6e02', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
            },
          })
        ).json?.id,
      20_000,
    )
  ).toString();
  let seq = 0;
  attack(async () => {
    const rows = Array.from({ length: 20 }, () => ({
      t_us: 1_780_000_000_000_000 + seq * 10_000,
      seq: seq++,
      tag: '0x6e02',
      anchor: '0x6a21',
      distance_m: 5 + (seq % 100) / 50,
      rss_dbm: -80,
    }));
    const answer = await call('gateway', 'POST', `/api/v1/ranges?mission=${sideMission}`, {
      headers: { 'content-type': 'application/x-ndjson' },
      body: ndjson(rows),
    });
    if (answer.status === 200 && answer.json.accepted === rows.length) acknowledged.push(...rows.map((row) => row.seq));
  }, 100);
});

test('hold and resume are answered beside the flood', async () => {
  for (let i = 0; i < 15; i++) {
    await command('hold');
    await command('resume');
  }
});

test('the clock steps by 300 days and back', async () => {
  stepClock('+300d');
  await sleep(4_000);
  await command('hold');
  assert.ok((await procedure()).drone.in_air);
  await command('resume');
  stepClock('+0d');
  await sleep(4_000);
  await command('hold');
  await command('resume');
});

test('a disk that is full for 20 s does not take the aircraft from its pilot', async () => {
  fillDisk(true);
  const began = Date.now();
  await sleep(2_000);
  await command('hold');
  assert.equal((await call('viewer', 'GET', '/healthz')).status, 200);
  await sleep(Math.max(0, 20_000 - (Date.now() - began)));
  fillDisk(false);
  const before = acknowledged.length;
  await eventually('rows are acknowledged again', () => acknowledged.length > before, 30_000, 100);
  await command('resume');
});

test('killed twice: hold each time, then on', async () => {
  for (let i = 0; i < 2; i++) {
    await server.kill();
    await server.start();
    await eventually(
      'the aircraft is heard again',
      async () => (await call('pilot', 'GET', '/api/v1/system')).json?.drone?.mode,
      20_000,
      50,
    );
    const back = await eventually(
      'the flight is back',
      async () => {
        const p = await procedure();
        return p?.step === 'hold' && p.drone?.mode === 'BRAKE' && p;
      },
      40_000,
      100,
    );
    assert.match(back.reason, /restarted/);
    await takeControl();
    await command('resume');
  }
});

test('it lands; no acknowledged row is missing, none is there twice; the stranger got nothing', async () => {
  await command('land');
  const end = await eventually(
    'it has landed',
    async () => {
      const p = await procedure();
      return p && !p.drone.in_air && !p.drone.armed && p.status !== 'landing' && p;
    },
    90_000,
    250,
  );
  assert.ok(['done', 'aborted'].includes(end.status), `${end.status}: ${end.reason}`);
  flying = false;
  await Promise.all(background);
  const stored = new Map();
  for (let cursor = ''; cursor !== null;) {
    const page = (
      await call(
        'pilot',
        'GET',
        `/api/v1/ranges?mission=${sideMission}&limit=1000&fields=seq${cursor && `&cursor=${encodeURIComponent(cursor)}`}`,
      )
    ).json;
    for (const row of page.items) stored.set(row.seq, (stored.get(row.seq) ?? 0) + 1);
    cursor = page.next_cursor;
  }
  assert.ok(acknowledged.length > 500, `${acknowledged.length} rows were acknowledged`);
  assert.deepEqual(
    acknowledged.filter((seq) => stored.get(seq) !== 1),
    [],
  );
  assert.equal(strangerReceived, 0, 'the stranger on the MAVLink port got frames');
  console.log(`hold: ${percentiles(waits.hold)}; ${acknowledged.length} rows acknowledged`);
});
