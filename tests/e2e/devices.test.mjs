// Devices as their operator meets them, at both doors of the real binary: simulated ones on ptys and TCP, found, asked to blink, watched for
// a clock that is none, recorded; the recording played into the same and into another server.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { binary, eventually, run, startServer } from './server.mjs';

let folder, simulator, server;
const made = {}; // id by name
const get = async (path, from = server) => (await from.fetch(path)).json();
const device = (name) => get(`/api/v1/devices/${made[name]}`);
/** Without a difference of a thousand impulse responses. */
const same = (a, b) => assert.equal(a.length === b.length && a.find((row, i) => row !== b[i]), undefined);
const cli = (...words) => run(['devices', '--data-dir', server.dataDir, ...words]);

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  const scenario = {
    schema: 'anchord.scenario/1',
    name: 'two tags and a rover',
    seed: 5,
    tags: [
      { name: 'good', id: '0x6e01' },
      { name: 'mad', id: '0x6e02', clock_drift_ppm: 900 },
    ],
    rovers: [{ name: 'rover', format: 'ubx', port: 'tcp', rate_hz: 10 }],
    radio: { loss_chance: 0, sensitivity_dbm: -130 },
  };
  writeFileSync(join(folder, 'scenario.json'), JSON.stringify(scenario));
  simulator = spawn(binary, ['simulate', join(folder, 'scenario.json'), '--json', '--links', folder], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const served = [];
  await new Promise((done, fail) => {
    createInterface({ input: simulator.stdout }).on('line', (line) => served.push(JSON.parse(line)) === 3 && done());
    simulator.once('exit', (code) => fail(new Error(`anchord simulate ended with ${code}`)));
  });
  server = await startServer();
  for (const { kind, name, address } of served) {
    const { code, stdout, stderr } = await cli('add', kind, address, '--name', name);
    assert.equal(code, 0, stderr);
    made[name] = stdout.trim();
  }
});

after(async () => {
  simulator?.kill('SIGTERM');
  await server?.dispose();
  if (folder) rmSync(folder, { recursive: true, force: true });
});

test('every device talks, and says so once in the log', async () => {
  for (const name of Object.keys(made)) {
    await eventually(`${name} talks`, async () => (await device(name)).state === 'talking', 20_000);
  }
  assert.equal((await device('good')).network_id, '0x6e01');
  await eventually('ranges', async () => (await device('good')).counters.ranges > 20, 20_000);
  for (const name of Object.keys(made)) {
    assert.equal(server.log.split(`device \\"${name}\\" is talking`).length - 1, 1, server.log);
  }
});

test('identify makes lights blink, of the tag or of an anchor, over REST and by command', async () => {
  const answer = await server.fetch(`/api/v1/devices/${made.good}/actions`, { json: { action: 'identify' } });
  const { result } = await answer.json();
  assert.equal(answer.status, 200);
  assert.equal(result.lights, 'blinked');
  assert.equal(result.network_id, '0x6e01');
  const tag = await cli('identify', 'good');
  assert.equal(tag.code, 0, tag.stderr);
  assert.equal(JSON.parse(tag.stdout).lights, 'blinked');
  const anchor = await cli('identify', 'good', '0x6a21');
  assert.equal(anchor.code, 0, anchor.stderr);
  assert.deepEqual(JSON.parse(anchor.stdout), { lights: 'blinked', network_id: '0x6a21' });
  const rover = await cli('identify', 'rover');
  assert.equal(rover.code, 1);
  assert.match(rover.stderr, /GNSS receiver does not support the command "identify"/);
  await eventually('talking as before', async () => (await device('good')).state === 'talking');
});

test('a device is set up with its settings by one command, and what is wrong with one is said', async () => {
  const caster = await run([
    'devices',
    'add',
    'ntrip',
    'tcp://127.0.0.1:1',
    'mount=RTCM3',
    'enabled=false',
    '--name',
    'caster',
    '--data-dir',
    server.dataDir,
  ]);
  assert.equal(caster.code, 0, caster.stderr);
  const { name, enabled, options } = await get(`/api/v1/devices/${caster.stdout.trim()}`);
  assert.deepEqual([name, enabled, options.mount], ['caster', false, 'RTCM3']);
  assert.equal((await cli('remove', 'caster')).code, 0);
  const lidar = await cli('add', 'lidar', 'tcp://127.0.0.1:1');
  assert.equal(lidar.code, 1);
  assert.match(lidar.stderr, /kind/);
});

test('a recorded flight, played again, is the same rows: known to its own server, made anew on another', async () => {
  const body = { name: 'flight', frame: 'wgs84', track_point: 'gnss_antenna' };
  const mission = (await (await server.fetch('/api/v1/missions', { json: body })).json()).id;
  await eventually(
    'ranges of the flight',
    async () => (await get(`/api/v1/ranges?limit=60&mission=${mission}`)).items.length >= 60,
    30_000,
  );
  await server.fetch(`/api/v1/missions/${mission}/actions`, { json: { action: 'finish' } });
  const rows = async (from, of) => {
    const lines = [];
    for (const path of ['fixes?', 'ranges?cir=true&']) {
      lines.push(...(await (await from.fetch(`/api/v1/${path}format=ndjson&mission=${of}`)).text()).trim().split('\n'));
    }
    return lines.map((line) => line.replace(/^\{"id":\d+,/, '{').replaceAll(of, 'MISSION')).sort();
  };
  const recordings = join(server.dataDir, 'recordings'),
    file = join(recordings, readdirSync(recordings).sort()[0]);
  const out = await run(['replay', file, '--out', join(folder, 'rows')]);
  assert.equal(out.code, 0, out.stderr);
  const derived = ['fixes', 'ranges'].flatMap((name) =>
    readFileSync(join(folder, 'rows', `${name}.ndjson`), 'utf8')
      .trim()
      .split('\n'),
  );
  // What came up to the finish is on its way to the database for a moment.
  let live = [];
  await eventually(
    'every derived row is stored',
    async () => (live = await rows(server, mission)).length >= derived.length,
    10_000,
    100,
  );
  same(derived.map((line) => line.replaceAll(mission, 'MISSION')).sort(), live);
  assert.ok(live.length >= 60 && live.some((row) => row.includes('"cir":{')), `${live.length} rows`);

  const again = await run(['replay', file, '--url', server.url]);
  assert.equal(again.code, 0, again.stderr);
  assert.match(again.stderr, new RegExp(`\\b0 rows accepted, ${live.length} duplicates, 0 rejected`));
  same(await rows(server, mission), live);

  const other = await startServer();
  try {
    const { code, stderr } = await run(['replay', file, '--url', other.url, '--name', 'played', '--speed', '20']);
    assert.equal(code, 0, stderr);
    assert.match(stderr, new RegExp(`${live.length} rows accepted, 0 duplicates, 0 rejected`));
    const [copy] = (await get('/api/v1/missions', other)).items;
    assert.deepEqual([copy.name, copy.state], ['played', 'finished']);
    same(await rows(other, copy.id), live);
  } finally {
    await other.dispose();
  }
  assert.equal((await run(['replay', file, '--url', server.url, '--loop'])).code, 2);
});

test('a second flight gets no rows of the devices until it takes them, and gives them back', async () => {
  const body = { frame: 'wgs84', track_point: 'gnss_antenna' };
  const make = async (more) => (await server.fetch('/api/v1/missions', { json: { ...body, ...more } })).json();
  const n_ranges = async (mission) => (await get(`/api/v1/missions/${mission.id}`)).n_ranges;
  const finish = (mission) => server.fetch(`/api/v1/missions/${mission.id}/actions`, { json: { action: 'finish' } });
  const first = await make({ name: 'first' });
  assert.deepEqual(first.devices, { recording: true, held_by: null });
  await eventually('ranges of the first', async () => (await n_ranges(first)) > 5, 30_000);
  const second = await make({ name: 'second' });
  assert.deepEqual(second.devices, { recording: false, held_by: { mission: first.id, name: 'first' } });
  const before = await n_ranges(first);
  await eventually('the first goes on', async () => (await n_ranges(first)) > before + 5, 30_000);
  assert.equal(await n_ranges(second), 0);
  const { lease } = await (
    await server.fetch(`/api/v1/missions/${first.id}/control`, { json: { action: 'take' } })
  ).json();
  const third = await make({ name: 'third', take_devices: true, lease });
  assert.equal(third.devices.recording, true);
  await eventually('ranges of the third', async () => (await n_ranges(third)) > 5, 30_000);
  await finish(third);
  const handed_back = await n_ranges(first);
  await eventually('the first has them back', async () => (await n_ranges(first)) > handed_back + 5, 30_000);
  assert.equal(await n_ranges(second), 0);
  await finish(second);
  await finish(first);
});

test('a device clock that drifts raises an alarm, and it is over with the device', async () => {
  const skew = async () => (await get('/api/v1/alarms')).items.find((alarm) => alarm.id === 'clock.skew');
  await eventually('the alarm', skew, 60_000);
  assert.match(JSON.stringify(await skew()), /mad.*drifts by more than 200 ppm/);
  const { clock } = await device('mad');
  assert.ok(clock.skewed && clock.drift_ppm > 500, JSON.stringify(clock));
  assert.equal((await device('good')).clock.skewed, false);
  const { code, stderr } = await cli('settings', 'mad', 'enabled=false');
  assert.equal(code, 0, stderr);
  await eventually('no alarm', async () => !(await skew()), 10_000);
});
