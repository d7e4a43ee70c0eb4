// A running server and a real Eclipse Mosquitto: what mosquitto_sub reads after a flight, when the broker is killed and
// comes back, and when the server is killed.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { connect } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { promisify } from 'node:util';
import { ndjson, simulatedFlight } from './flight.mjs';
import { free_tcp_port } from './ports.mjs';
import { eventually, root, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord mqtt '));
let server, broker, port, anchors;

function startBroker() {
  const file = join(folder, 'mosquitto.conf');
  writeFileSync(file, `listener ${port} 127.0.0.1\nallow_anonymous true\npersistence false\n`);
  broker = spawn('/usr/sbin/mosquitto', ['-c', file], { stdio: 'ignore' });
}
const killBroker = () =>
  new Promise((done) => {
    broker.once('exit', done);
    broker.kill('SIGKILL');
  });
process.on('exit', () => broker?.kill('SIGKILL'));

/** Payload by topic of what a new subscriber gets within `seconds`. */
async function retained(filter, seconds = 1) {
  const args = ['-h', '127.0.0.1', '-p', String(port), '-t', filter, '-W', String(seconds), '-F', '%t\t%p'];
  const { stdout } = await promisify(execFile)('mosquitto_sub', args, { maxBuffer: 1 << 26 }).catch((end) => end);
  return new Map(
    stdout
      .split('\n')
      .filter(Boolean)
      .map((line) => line.split('\t')),
  );
}
const post = async (path, json, headers) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};
const system = async () => (await (await server.fetch('/api/v1/system')).json()).mqtt;

before(async () => {
  port = await free_tcp_port();
  startBroker();
  server = await startServer({ args: ['--mqtt-host=127.0.0.1', `--mqtt-port=${port}`] });
  const flight = await simulatedFlight({ duration: 60 });
  const rows = (list) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(list) });
  const site = (await post('/api/v1/sites', { name: 'Hall #1' })).id;
  const mission = (await post('/api/v1/missions', { ...flight.mission, site })).id;
  for (const what of ['fixes', 'ranges'])
    assert.equal((await server.fetch(`/api/v1/${what}?mission=${mission}`, rows(flight[what]))).status, 200);
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const solved = await post('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' });
  await post(`/api/v1/calibrations/${solved.id}/publish`, {});
  anchors = (await (await server.fetch('/api/v1/anchors')).json()).features;
  assert.ok(anchors.length >= 3, `${anchors.length} anchors`);
});
after(async () => {
  await server?.dispose();
  broker?.kill('SIGKILL');
  rmSync(folder, { recursive: true, force: true });
});

test('a subscriber that comes later reads anchors, estimates, mission, alarms and that the server is there', async () => {
  const topics = await eventually('all is published', async () => {
    const read = await retained('anchord/#');
    const count = (part) => [...read.keys()].filter((topic) => topic.includes(part)).length;
    const server = ['status', 'alarms', 'revision'].every((topic) => read.has(`anchord/_server/${topic}`));
    return (
      count('/anchors/') === anchors.length && count('/estimates/') >= 3 && count('/mission') === 1 && server && read
    );
  });
  for (const { properties, geometry } of anchors) {
    const one = JSON.parse(topics.get(`anchord/Hall %231/anchors/${properties.network_id}`));
    assert.deepEqual(one.geometry, geometry);
  }
  assert.equal(JSON.parse(topics.get('anchord/_server/status')).state, 'online');
  assert.ok(Array.isArray(JSON.parse(topics.get('anchord/_server/alarms'))));
  assert.equal(JSON.parse(topics.get('anchord/_server/revision')).anchors, anchors.length);
  assert.equal(JSON.parse(topics.get('anchord/Hall %231/mission')).state, 'finished');
  const estimates = [...topics.keys()].filter((topic) => topic.startsWith('anchord/Hall %231/estimates/'));
  assert.ok(estimates.length >= 3, String([...topics.keys()]));
  assert.ok('h95_m' in JSON.parse(topics.get(estimates[0])), topics.get(estimates[0]));
});

test('tags of other makers measure by a mapping from a TOML file: over the broker, and line by line over TCP', async () => {
  const mapping = join(folder, 'tags.toml');
  const page = readFileSync(join(root, 'docs/integration.md'), 'utf8');
  const sample = page.slice(page.indexOf('`tags.toml`:')).split('\n').slice(2);
  // Without the clock of the device: these messages have no time.
  const values = sample.slice(0, sample.indexOf('')).filter((line) => !line.includes('time ='));
  assert.ok(values.length >= 6, 'the mapping of the page');
  const add = async (kind, address, lines) => {
    writeFileSync(mapping, lines.join('\n'));
    const words = ['devices', '--data-dir', server.dataDir, 'add', kind, address, `mapping_file=${mapping}`];
    const made = await run(words);
    assert.equal(made.code, 0, made.stderr);
    return made.stdout.trim();
  };
  const device = async (id) => (await server.fetch(`/api/v1/devices/${id}`)).json();
  const tag_port = await free_tcp_port();
  const mqtt = await add('mqtt', `tcp://127.0.0.1:${port}`, ['topic = "uwb/+"', ...values]);
  const line = await add('ndjson', `tcp-listen://127.0.0.1:${tag_port}`, values);
  const body = { name: 'other makers', frame: 'wgs84', track_point: 'tag_antenna' };
  const mission = (await post('/api/v1/missions', body)).id;
  const message = (id) =>
    `{"id":"${id}","r":[{"to":"6A3C","mm":7412,"dbm":-84.3},{"to":"6A3D","mm":"8000"},{"to":"6A3E"}]}`;
  await eventually('the broker answers', async () => (await device(mqtt)).state === 'talking');
  await promisify(execFile)('mosquitto_pub', [
    '-h',
    '127.0.0.1',
    '-p',
    `${port}`,
    '-t',
    'uwb/1',
    '-m',
    message('6E01'),
  ]);
  const tag = await eventually(
    'it listens',
    () =>
      new Promise((done) => {
        const socket = connect(tag_port, '127.0.0.1', () => done(socket)).on('error', () => done(null));
      }),
  );
  tag.write(`${message('6E02')}\nnonsense\n`);
  await eventually(
    'two ranges each',
    async () => (await device(mqtt)).counters.ranges + (await device(line)).counters.ranges === 4,
  );
  assert.deepEqual((await device(mqtt)).dropped, { bad_distance: 1 });
  await eventually('the fault is counted', async () => (await device(line)).dropped.not_json === 1);
  const stored = async () => (await (await server.fetch(`/api/v1/ranges?mission=${mission}`)).json()).items;
  const rows = await eventually('they are stored', async () => {
    const items = await stored();
    return items.length === 4 && items;
  });
  const one = rows.find((row) => row.tag === '0x6e01' && row.anchor === '0x6a3c');
  assert.equal(one.distance_m, 7.412);
  assert.equal(one.rss_dbm, -84.3);
  tag.destroy();
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const wrong = await run([
    'devices',
    '--data-dir',
    server.dataDir,
    'settings',
    line.slice(0, 36),
    'mapping={"tag":"id"}',
  ]);
  assert.equal(wrong.code, 1);
  assert.match(wrong.stderr, /mapping\/tag: "id" is not a JSON pointer/);
});

test('a broker that is away is seen in /system, on /metrics and as an alarm, and gets everything when it is back', async () => {
  assert.equal((await system()).state, 'connected');
  await killBroker();
  const away = await eventually('the loss is seen', async () => {
    const now = await system();
    return now.state === 'disconnected' && now;
  });
  assert.ok(away.reason, JSON.stringify(away));
  assert.match(await (await server.fetch('/metrics')).text(), /^anchord_mqtt_connected 0$/m);
  const standing = async () =>
    (await (await server.fetch('/api/v1/alarms')).json()).items.some(({ id }) => id === 'mqtt.disconnected');
  await eventually('the alarm', standing, 20_000);
  startBroker();
  await eventually('the alarm goes', async () => !(await standing()), 60_000);
  const topics = await eventually('everything is there again', async () => {
    const read = await retained('anchord/#');
    return [...read.keys()].filter((topic) => topic.includes('/anchors/')).length === anchors.length && read;
  });
  assert.equal(JSON.parse(topics.get('anchord/_server/status')).state, 'online');
});

test('the broker says that the server is gone, killed or stopped', async () => {
  const status = async () => JSON.parse((await retained('anchord/_server/status')).get('anchord/_server/status')).state;
  assert.equal(await status(), 'online');
  await server.kill();
  await eventually('the last will', async () => (await status()) === 'offline');
  await server.start();
  await eventually('it is back', async () => (await status()) === 'online');
  await server.stop();
  assert.equal(await status(), 'offline');
});

test('a password does not go to another machine in the clear, and settings that cannot work are named', async () => {
  const password = join(folder, 'password');
  writeFileSync(password, 'secret\n', { mode: 0o600 });
  const why = async (...args) => {
    const { code, stderr } = await run(['serve', '--data-dir', join(folder, 'none'), '--listen=127.0.0.1:0', ...args]);
    assert.equal(code, 2, stderr);
    return stderr;
  };
  const login = ['--mqtt-user=anchord', `--mqtt-password-file=${password}`];
  assert.match(await why('--mqtt-host=192.0.2.1', ...login), /mqtt\.password_file: .* unencrypted; set mqtt\.ca_file/);
  assert.match(await why('--mqtt-host=a', '--mqtt-prefix=a/#'), /mqtt\.prefix: /);
  assert.match(await why('--mqtt-host=a', '--mqtt-port=70000'), /mqtt\.port: 70000 is above 65535/);
  assert.match(await why('--mqtt-host=a', '--mqtt-ca-file=/nowhere.pem'), /mqtt\.ca_file: \/nowhere\.pem/);
  assert.match(await why('--mqtt-host=a', login[1]), /mqtt\.password_file: a password needs mqtt\.user/);
});
