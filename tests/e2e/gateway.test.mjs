// The gateway as the aircraft has it, over bad links, bad answers and its own sudden end: nothing that it kept is lost, nothing is stored twice.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { createServer, request } from 'node:http';
import { join } from 'node:path';
import { test } from 'node:test';
import {
  Feeder,
  GatewayProcess,
  LinkProxy,
  gatewayToken,
  recordingMission,
  storedCount,
  storedNumbers,
} from './gateway.mjs';
import { linkOffThenSlow } from './gateway_link.mjs';
import { clockAhead } from './other_clock.mjs';
import { eventually, startServer } from './server.mjs';

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** A server, a tag, a link and a gateway; all of it ends with the work. */
async function rig(work, { token = true, args = [] } = {}) {
  const server = await startServer({ auth: 'on' });
  const feeder = await new Feeder().start();
  const proxy = await new LinkProxy(server.port).start();
  const gateway = new GatewayProcess({
    to: proxy.url,
    token: token ? await gatewayToken(server) : null,
    feeder,
    args,
  });
  try {
    await work({ server, feeder, proxy, gateway });
  } finally {
    feeder.close();
    await gateway.dispose();
    proxy.close();
    await server.dispose();
  }
}
const recordsInto = (gateway, mission) =>
  eventually('the gateway knows the mission', async () => (await gateway.status()).mission.id === mission, 20_000);
/** So many rows a second, of which more than `stored` are there; their mission. */
async function flows({ server, feeder, gateway }, rowsPerS, stored) {
  const mission = await recordingMission(server);
  await gateway.start();
  await recordsInto(gateway, mission);
  await eventually('the tag is there', () => feeder.connected);
  feeder.run(rowsPerS);
  await eventually('rows arrive', async () => (await storedCount(server, mission)) > stored);
  return mission;
}
const drained = (gateway, deadlineMs = 60_000) =>
  eventually('all rows have left', async () => (await gateway.status()).outbox.rows === 0, deadlineMs, 100);
async function everyRowOnce(server, mission, feeder) {
  // The newest rows may still be on their way from the tag to the outbox.
  await eventually('all have come', async () => (await storedCount(server, mission)) >= feeder.sent.length, 10_000);
  const numbers = await storedNumbers(server, mission);
  assert.equal(new Set(numbers).size, feeder.sent.length, 'every row');
  assert.equal(numbers.length, feeder.sent.length, 'none twice');
}

test('with the link off and then slow nothing is lost, live rows come first and the rest at the speed of the link', async (t) => {
  const got = await linkOffThenSlow({ offS: 12, onS: 10, drainS: 120, note: (text) => t.diagnostic(text) });
  t.diagnostic(JSON.stringify(got));
  assert.ok(got.waiting > 12 * 300 * 0.9, `${got.waiting} rows waited`);
  assert.ok(got.liveAfterS < 10, `live after ${got.liveAfterS} s`);
  assert.ok(got.worstLiveAgeS < 10, `live rows ${got.worstLiveAgeS} s old while the backlog went`);
  assert.ok(got.used > 0.6, `${(100 * got.used).toFixed(0)} % of the link used while rows waited`);
});

test('a link that swallows everything is noticed, and live is back within 10 s', () =>
  rig(async ({ server, feeder, proxy, gateway }) => {
    const mission = await flows({ server, feeder, gateway }, 100, 0);
    proxy.silence();
    await eventually('the link is lost', async () => (await gateway.status()).link.state === 'lost', 15_000);
    await sleep(3_000);
    await proxy.restore();
    const back = Date.now();
    await eventually(
      'live again',
      async () => (await gateway.status()).outbox.newest_delivered_us > back * 1000,
      10_000,
    );
    feeder.pause();
    await drained(gateway);
    await everyRowOnce(server, mission, feeder);
  }));

test('a link whose answers take two seconds is filled all the same: what waits goes, and more rows than come', (t) =>
  rig(async ({ server, feeder, proxy, gateway }) => {
    const mission = await flows({ server, feeder, gateway }, 100, 0);
    await proxy.cut();
    await sleep(8_000);
    proxy.delayMs = 1_000;
    await proxy.restore();
    const waiting = (await gateway.status()).outbox.rows;
    t.diagnostic(`${waiting} rows wait`);
    assert.ok(waiting > 500, `${waiting}`);
    // In the time of one round trip 200 more come, and those that are on their way wait for their answer.
    await eventually('the backlog has gone', async () => (await gateway.status()).outbox.rows < 500, 45_000, 250);
    await sleep(6_000);
    const { rows } = (await gateway.status()).outbox;
    assert.ok(rows < 900, `${rows} rows wait again`);
    proxy.delayMs = 0;
    feeder.pause();
    await drained(gateway);
    await everyRowOnce(server, mission, feeder);
  }));

test('kill -9 at random instants loses no row that was kept and stores none twice', (t) =>
  rig(async ({ server, feeder, proxy, gateway }) => {
    const mission = await recordingMission(server);
    await gateway.start();
    await recordsInto(gateway, mission);
    let kept = 0;
    for (let round = 0; round < 8; round++) {
      await eventually('the tag is there', () => feeder.connected, 20_000);
      feeder.run(400);
      if (round % 2 === 1) await proxy.cut();
      await sleep(300 + Math.random() * 1200);
      if (round % 2 === 1) await proxy.restore();
      await sleep(Math.random() * 700);
      kept = Math.max(kept, (await gateway.status()).rows.kept);
      await gateway.kill();
      feeder.pause();
      await gateway.start();
      const after = (await gateway.status()).rows.kept;
      assert.ok(after >= kept, `${kept} rows were kept, ${after} after kill -9`);
    }
    await drained(gateway);
    const { rows } = await gateway.status();
    const numbers = await storedNumbers(server, mission);
    t.diagnostic(`${rows.kept} rows kept, ${rows.duplicates} of them sent twice`);
    assert.ok(rows.kept > 1000);
    assert.equal(numbers.length, rows.kept, 'every kept row is at the server');
    assert.equal(new Set(numbers).size, rows.kept, 'none twice');
    assert.equal(rows.accepted + rows.duplicates, rows.kept);
    assert.equal(rows.rejected, 0);
  }));

/** In front of a server: answers as told, or hands on. */
async function moodyServer(server) {
  const mood = { answer: null, times: [] };
  const front = createServer((incoming, outgoing) => {
    if (incoming.method === 'POST') mood.times.push(Date.now());
    const told = incoming.method === 'POST' ? mood.answer?.(incoming) : null;
    if (told) {
      incoming.resume();
      incoming.on('end', () => outgoing.writeHead(told.status, told.headers).end(told.body ?? '{}'));
      return;
    }
    const onward = request(
      { port: server.port, host: '127.0.0.1', method: incoming.method, path: incoming.url, headers: incoming.headers },
      (answer) => answer.pipe(outgoing.writeHead(answer.statusCode, answer.headers)),
    );
    onward.on('error', () => outgoing.destroy());
    incoming.pipe(onward);
  });
  await new Promise((done) => front.listen(0, '127.0.0.1', done));
  return {
    mood,
    url: `http://127.0.0.1:${front.address().port}`,
    close: () => front.closeAllConnections() ?? front.close(),
  };
}

test('each refusal of the server has its answer: wait, say what to do, cut in pieces, write down; and every row arrives', () =>
  rig(async ({ server, feeder, gateway }) => {
    const { mood, url, close } = await moodyServer(server);
    gateway.to = url;
    const mission = await recordingMission(server);
    try {
      await gateway.start();
      await recordsInto(gateway, mission);
      await eventually('the tag is there', () => feeder.connected);
      feeder.run(50);

      mood.answer = () => ({ status: 401, headers: { 'content-type': 'application/problem+json' } });
      await eventually('the token is refused', async () => (await gateway.status()).link.state === 'unauthorized');
      const refused = (await gateway.status()).alarms.find((alarm) => alarm.code === 'gateway.refused');
      assert.match(refused.text, /anchord token create/);
      assert.equal((await gateway.cli()).code, 1);
      mood.answer = () => ({ status: 403, headers: {} });
      await eventually(
        'the role is missing',
        async () => /403/.test((await gateway.status()).link.reason ?? ''),
        20_000,
      );

      for (const status of [429, 503]) {
        mood.times.length = 0;
        mood.answer = () => ({ status, headers: { 'retry-after': '3' } });
        await eventually(
          `${status}`,
          async () => (await gateway.status()).link.reason?.startsWith(`${status}`),
          45_000,
        );
        const first = mood.times.at(-1);
        await eventually('it asks again', () => mood.times.at(-1) > first, 10_000);
        assert.ok(mood.times.at(-1) - first >= 3000, `after ${mood.times.at(-1) - first} ms, told were 3 s`);
      }

      mood.answer = (incoming) =>
        Number(incoming.headers['content-length']) > 1500 ? { status: 413, headers: {} } : null;
      await eventually('all goes again in small pieces', async () => (await gateway.status()).outbox.rows < 30, 60_000);
      mood.answer = () => ({
        status: 200,
        headers: { 'content-type': 'text/html' },
        body: '<html>please log in</html>',
      });
      await eventually(
        'a login page is no answer',
        async () => (await gateway.status()).link.state === 'refused',
        20_000,
      );
      mood.answer = null;
      await eventually('the link is up', async () => (await gateway.status()).link.state === 'up', 45_000);
      feeder.pause();
      await drained(gateway);
      await everyRowOnce(server, mission, feeder);

      // The same identity with other content at the server: rejected there, written down here, once.
      const row = { t_us: Date.now() * 1000, tag: '0x6e01', anchor: '101', distance_m: 9.5, seq: 900_001 };
      const sent = await server.fetch(`/api/v1/ranges?mission=${mission}`, { json: row });
      assert.equal(sent.status, 200, await sent.text());
      feeder.raw(`{"t":${row.t_us},"n":${row.seq},"to":101,"mm":7000,"dbm":-80.5}\n`);
      await eventually('one row is rejected', async () => (await gateway.status()).rows.rejected === 1, 20_000);
      const [rejected] = gateway.rejected();
      assert.equal(rejected.code, 'conflict');
      assert.equal(rejected.row.seq, '900001');
      assert.deepEqual(await gateway.alarms(), ['gateway.rows_rejected']);
      assert.equal((await gateway.status()).outbox.rows, 0);
    } finally {
      close();
    }
  }));

test('a full outbox keeps what it has, says so, and takes rows again when the link is back', () =>
  rig(
    async ({ server, feeder, proxy, gateway }) => {
      const mission = await recordingMission(server);
      await gateway.start();
      await recordsInto(gateway, mission);
      await eventually('the tag is there', () => feeder.connected);
      await proxy.cut();
      for (let i = 0; i < 40; i++) {
        feeder.burst(500);
        await sleep(20);
      }
      await eventually('it is full', async () => (await gateway.alarms()).includes('gateway.full'), 20_000);
      assert.equal((await fetch(`${gateway.url}/readyz`)).status, 503);
      assert.equal((await fetch(`${gateway.url}/healthz`)).status, 200);
      const { outbox } = await gateway.status();
      assert.ok(outbox.bytes <= outbox.max_bytes);
      await proxy.restore();
      await eventually('room again', async () => (await fetch(`${gateway.url}/readyz`)).status === 200, 30_000);
      await drained(gateway);
      await eventually(
        'all have come',
        async () => (await storedCount(server, mission)) === feeder.sent.length,
        30_000,
      );
      await everyRowOnce(server, mission, feeder);
      assert.deepEqual(await gateway.alarms(), []);
    },
    { args: ['--max-mib', '1'] },
  ));

/** The files of this process may be no longer than so many bytes from now on, as on a disk that is full; '' lifts that. */
const limitFiles = (child, bytes) => execFileSync('prlimit', ['--pid', `${child.pid}`, `--fsize=${bytes}:`]);

test('a disk that takes nothing more stops no row while there is a link, and the gateway says so until it does', () =>
  rig(async ({ server, feeder, gateway }) => {
    const mission = await flows({ server, feeder, gateway }, 300, 100);
    limitFiles(gateway.child, 0);
    await eventually('it says so', async () => (await gateway.alarms()).includes('gateway.full'), 20_000);
    assert.equal((await fetch(`${gateway.url}/readyz`)).status, 503);
    const before = await storedCount(server, mission);
    await sleep(6_000);
    const meanwhile = (await storedCount(server, mission)) - before;
    assert.ok(meanwhile > 6 * 300 * 0.7, `${meanwhile} rows came while the disk took none`);
    const status = await gateway.status();
    assert.equal(status.rows.lost, 0);
    assert.ok(status.outbox.live_age_s < 3, `${status.outbox.live_age_s} s`);
    feeder.pause();
    await drained(gateway);
    // Nothing comes any more that would show that the disk works again.
    limitFiles(gateway.child, 'unlimited');
    await eventually('ready', async () => (await fetch(`${gateway.url}/readyz`)).status === 200, 10_000);
    feeder.burst(50);
    await drained(gateway);
    await everyRowOnce(server, mission, feeder);
    await eventually('no alarm stands', async () => (await gateway.alarms()).length === 0, 20_000);
    const counted = await gateway.status();
    assert.equal(counted.rows.kept, feeder.sent.length);
    assert.equal(counted.rows.accepted + counted.rows.duplicates, feeder.sent.length);
    assert.equal(counted.rows.duplicates, 0);
    // What was deleted while nothing could be is not sent by the next process.
    assert.equal((await gateway.kill('SIGTERM')).code, 0);
    await gateway.start(['--mission', mission]);
    assert.equal((await gateway.status()).outbox.rows, 0);
  }));

test('rows that are in memory alone when the link goes are on the disk once that takes them', () =>
  rig(async ({ server, feeder, proxy, gateway }) => {
    const mission = await recordingMission(server);
    await gateway.start();
    await recordsInto(gateway, mission);
    await eventually('the tag is there', () => feeder.connected);
    feeder.burst(100);
    await everyRowOnce(server, mission, feeder);
    await drained(gateway);
    await proxy.cut();
    limitFiles(gateway.child, 0);
    feeder.burst(500);
    await eventually('they wait in memory', async () => (await gateway.status()).outbox.rows_in_memory === 500, 20_000);
    limitFiles(gateway.child, 'unlimited');
    await eventually('they are on the disk', async () => (await gateway.status()).outbox.rows_in_memory === 0, 40_000);
    assert.equal((await gateway.status()).outbox.rows, 500);
    await gateway.kill();
    await proxy.restore();
    await gateway.start(['--mission', mission]);
    await drained(gateway);
    await everyRowOnce(server, mission, feeder);
  }));

test('an outbox that is gone or empty is refused with what to do, and made anew only where that is asked for', () =>
  rig(async ({ server, feeder, gateway }) => {
    const mission = await recordingMission(server);
    await gateway.start();
    await recordsInto(gateway, mission);
    await eventually('the tag is there', () => feeder.connected);
    feeder.burst(20);
    await everyRowOnce(server, mission, feeder);
    await gateway.kill('SIGTERM');
    await eventually('the tag is left', () => !feeder.connected);
    const file = join(gateway.dataDir, 'outbox.db');
    for (const spoil of [() => writeFileSync(file, ''), () => rmSync(file)]) {
      spoil();
      gateway.log = '';
      await assert.rejects(gateway.start());
      assert.match(gateway.log, /outbox\.db is missing or empty.*--new-outbox/s);
      assert.ok(!existsSync(file) || statSync(file).size === 0, 'nothing was made');
    }
    await gateway.start(['--new-outbox']);
    await recordsInto(gateway, mission);
    await eventually('the tag is there', () => feeder.connected);
    feeder.burst(20);
    await everyRowOnce(server, mission, feeder);
  }));

test('without a server at the start rows wait for their mission, which a person names', () =>
  rig(async ({ server, feeder, proxy, gateway }) => {
    await proxy.cut();
    await gateway.start();
    await eventually('the tag is there', () => feeder.connected);
    feeder.burst(200);
    await eventually('rows wait', async () => (await gateway.status()).outbox.rows_without_mission === 200);
    assert.deepEqual((await gateway.status()).mission, { id: null, from: 'unassigned' });
    await proxy.restore();
    const told = await eventually('it says what to do', async () =>
      (await gateway.status()).alarms.find((alarm) => alarm.code === 'gateway.no_mission'),
    );
    assert.match(told.text, /--mission ID/);
    assert.equal((await gateway.kill('SIGTERM')).code, 0);
    const mission = await recordingMission(server);
    await gateway.start(['--mission', mission]);
    await drained(gateway);
    await everyRowOnce(server, mission, feeder);
    await eventually('no alarm stands', async () => (await gateway.alarms()).length === 0, 20_000);
    const { code, stdout } = await gateway.cli();
    assert.equal(code, 0);
    assert.match(stdout, new RegExp(`mission +${mission} \\(given\\)`));
    assert.match(stdout, /200 kept, 200 accepted/);
  }));

test('a clock that is not the server’s is said, with how far it is off, until it is set', () =>
  rig(async ({ gateway, feeder }) => {
    gateway.env = clockAhead(7200);
    await gateway.start();
    const told = await eventually('it says so', async () =>
      (await gateway.status()).alarms.find((alarm) => alarm.code === 'gateway.clock'),
    );
    const [, off_s] = /^the clock of this machine is (\d+) s ahead of the server's.*\(NTP\)$/.exec(told.text);
    assert.ok(off_s > 7190 && off_s <= 7200, told.text);
    await gateway.kill('SIGTERM');
    gateway.env = {};
    await gateway.start();
    await eventually('the tag is there', () => feeder.connected);
    await eventually('the server answers', async () => (await gateway.status()).link.state === 'up');
    assert.deepEqual(await gateway.alarms(), []);
  }));

test('its metrics are well formed, and its pages are for this machine alone', () =>
  rig(async ({ gateway }) => {
    await gateway.start();
    const metrics = await (await fetch(`${gateway.url}/metrics`)).text();
    for (const name of ['link_up', 'outbox_rows', 'outbox_bytes', 'rows_kept_total', 'rows_lost_total', 'alarms'])
      assert.match(metrics, new RegExp(`^anchord_gateway_${name} \\d`, 'm'));
    assert.equal((await fetch(`${gateway.url}/status`, { method: 'POST' })).status, 405);
    assert.equal((await fetch(`${gateway.url}/api/v1/missions`)).status, 404);
    const port = new URL(gateway.url).port;
    const foreign = await new Promise((done) =>
      request({ port, host: '127.0.0.1', path: '/status', headers: { host: 'evil.example' } }, (answer) => {
        answer.resume();
        done(answer.statusCode);
      }).end(),
    );
    assert.ok(foreign >= 400, `${foreign} to a foreign name`);
    await gateway.kill('SIGTERM');
    const { code, stderr } = await gateway.cli();
    assert.equal(code, 1);
    assert.match(stderr, /no gateway is running on/);
  }));
