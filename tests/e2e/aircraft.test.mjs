// A flight through the real server and the simulated aircraft, MAVLink over TCP between them (ArduPilot's own
// simulator serves TCP too), measurements over REST: start, the
// server killed in the air and started again (hold first), resume, land.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { after, before, test } from 'node:test';
import { hall_outline } from './flight.mjs';
import { free_tcp_port } from './ports.mjs';
import { binary, eventually, startServer } from './server.mjs';

let server, aircraft, mission, plan, lease;
const get = async (path) => (await server.fetch(path)).json();
const send = async (path, json) => {
  const answer = await server.fetch(path, {
    method: 'POST',
    headers: { 'content-type': 'application/json' },
    body: JSON.stringify(json),
  });
  return { status: answer.status, json: await answer.json() };
};
const procedure = () => get(`/api/v1/missions/${mission}/procedure`);
const act = (action, more = {}) => send(`/api/v1/missions/${mission}/actions`, { action, lease, ...more });
const accepted = async (answer) => {
  assert.equal(answer.status, 202, JSON.stringify(answer.json));
  return eventually(
    `command ${answer.json.action} is accepted`,
    async () => {
      const found = (await procedure()).commands.find((c) => c.number === answer.json.number);
      assert.notEqual(found?.state, 'refused', JSON.stringify(found));
      return found?.state === 'accepted';
    },
    60_000,
  );
};

before(async () => {
  const port = await free_tcp_port();
  server = await startServer({ auth: 'off', args: ['--drone-address', `tcp://127.0.0.1:${port}`] });
  let said = '';
  aircraft = spawn(
    binary,
    ['simulate', 'drone', '--mavlink', `tcp-listen://127.0.0.1:${port}`, '--url', server.url, '--ready', '2'],
    { stdio: ['pipe', 'ignore', 'pipe'] },
  );
  aircraft.stdin.write('parameter FS_GCS_TIMEOUT 60\n'); // a slow restart of the server is not what its failsafe is for here
  aircraft.stderr.setEncoding('utf8').on('data', (text) => (said += text));
  mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(said)?.[1]);
});
after(async () => {
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

test('planned from the outline, checked, started', async () => {
  const made = await send('/api/v1/plans/generate', {
    name: 'Hall',
    outline: hall_outline,
    building_height_m: 8,
    settings: { max_height_m: 14 },
  });
  assert.equal(made.status, 200);
  plan = (await send('/api/v1/plans', made.json.plan)).json.id;
  const list = () => get(`/api/v1/missions/${mission}/checklist?plan=${plan}`);
  assert.equal((await send(`/api/v1/missions/${mission}/checklist`, { plan })).status, 200);
  await eventually(
    'RTK has been fixed for 10 s',
    async () => (await list()).items.find((i) => i.id === 'rtk').state === 'ok',
    60_000,
    500,
  );
  for (const item of (await list()).items.filter((i) => i.state !== 'ok')) {
    assert.ok(item.manual || item.overridable, JSON.stringify(item));
    assert.equal((await send(`/api/v1/missions/${mission}/checklist/${item.id}`, { reason: 'a test' })).status, 200);
  }
  lease = (await send(`/api/v1/missions/${mission}/control`, { action: 'take' })).json.lease;
  await accepted(await act('start', { plan }));
  await eventually('the first anchors are heard', async () => (await procedure()).anchors.length > 3, 60_000, 250);
});

test('killed in the air: hold before anything else, then on', async () => {
  await server.kill();
  await server.start();
  const back = await eventually(
    'the flight is back',
    async () => {
      const p = await procedure();
      return p.step === 'hold' && p.drone.mode === 'BRAKE' && p;
    },
    30_000,
    100,
  );
  assert.match(back.reason, /restarted/);
  lease = (await send(`/api/v1/missions/${mission}/control`, { action: 'take' })).json.lease;
  await accepted(await act('resume'));
  await accepted(await act('land'));
  await eventually('it has landed', async () => (await procedure()).step === 'done', 60_000, 250);
});
