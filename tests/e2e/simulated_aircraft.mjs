// A server with the simulated aircraft at the other end of MAVLink, its tag and rover through REST; and its flight, started by another client.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { hall_outline } from './flight.mjs';
import { free_udp_port } from './ports.mjs';
import { binary, eventually, startServer } from './server.mjs';

/** The server, the mission that the aircraft made, and how the aircraft ends. */
export async function serverWithAircraft() {
  const port = await free_udp_port();
  const server = await startServer({ auth: 'off', args: ['--drone-address', `udp://:${port}`] });
  return { server, ...(await startAircraft(server.url, port)) };
}

/** One that speaks MAVLink to this UDP port. */
export async function startAircraft(url, port) {
  let said = '';
  const aircraft = spawn(
    binary,
    ['simulate', 'drone', '--mavlink', `udp://127.0.0.1:${port}`, '--url', url, '--ready', '2'],
    { stdio: ['ignore', 'ignore', 'pipe'] },
  );
  aircraft.stderr.setEncoding('utf8').on('data', (chunk) => (said += chunk));
  const mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(said)?.[1]);
  return { aircraft, mission };
}

/** Plans round the hall and starts, what may be confirmed confirmed; at work at a waypoint, nobody in control: the id of the plan. */
export async function startFlight(server, mission) {
  const get = async (path) => (await server.fetch(path)).json();
  const send = async (path, json) => {
    const answer = await server.fetch(path, { json });
    assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
    return answer.json();
  };
  const made = await send('/api/v1/plans/generate', {
    name: 'Hall',
    outline: hall_outline,
    building_height_m: 8,
    settings: { max_height_m: 14 },
  });
  const { id: plan } = await send('/api/v1/plans', made.plan);
  const list = () => get(`/api/v1/missions/${mission}/checklist?plan=${plan}`);
  await send(`/api/v1/missions/${mission}/checklist`, { plan });
  await eventually(
    'RTK has been fixed for 10 s',
    async () => (await list()).items.find((i) => i.id === 'rtk').state === 'ok',
    60_000,
    500,
  );
  const { lease } = await send(`/api/v1/missions/${mission}/control`, { action: 'take' });
  await eventually('everything that may be confirmed is green', async () => {
    for (const item of (await list()).items.filter((i) => i.state !== 'ok' && (i.manual || i.overridable)))
      await send(`/api/v1/missions/${mission}/checklist/${item.id}`, { reason: 'a test' });
    return (await list()).ready;
  });
  await send(`/api/v1/missions/${mission}/actions`, { action: 'start', lease, plan });
  const at_work = async () => (await get(`/api/v1/missions/${mission}/procedure`)).step === 'ranging';
  await eventually('it works at a waypoint', at_work, 90_000, 250);
  await send(`/api/v1/missions/${mission}/control`, { action: 'release', lease });
  return plan;
}
