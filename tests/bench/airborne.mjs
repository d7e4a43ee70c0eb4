// A simulated aircraft in the air on a server of its own, its operator in control: what benches of flying begin with.
import { spawn } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { hall_outline } from '../e2e/flight.mjs';
import { free_udp_port } from '../e2e/ports.mjs';
import { binary, eventually, startServer } from '../e2e/server.mjs';

export const origin = { lon: 3.7131, lat: 51.0231, h_m: 55.5 };
export const flight_plan = {
  name: 'Hall',
  building_height_m: 8,
  origin,
  settings: { keep_out_m: 4, max_height_m: 20 },
  outline: hall_outline,
  waypoints: [
    { lon: 3.713, lat: 51.02305, height_above_ground_m: 4 },
    { lon: 3.71362, lat: 51.02305, height_above_ground_m: 9 },
  ],
};

/** {server, mission, base, lease, tokens, must, as, stop} once it flies `plan`; on failure nothing is left behind. */
export async function airborne(plan = flight_plan) {
  const port = await free_udp_port();
  const server = await startServer({
    auth: 'on',
    args: ['--drone-address', `udp://:${port}`, '--rate-per-s', '100000', '--rate-burst', '100000'],
  });
  let aircraft;
  const stop = async () => {
    aircraft?.kill('SIGINT');
    await server.dispose();
  };
  const must = async (path, options, ...good) => {
    const answer = await server.fetch(path, options),
      text = await answer.text();
    if (!good.includes(answer.status))
      throw new Error(`${options?.json ? 'POST' : 'GET'} ${path}: ${answer.status} ${text.slice(0, 400)}`);
    return text ? JSON.parse(text) : null;
  };
  const token = async (...roles) => (await must('/api/v1/tokens', { json: { name: roles.join(), roles } }, 201)).token;
  try {
    const tokens = {
      pilot: await token('operator'),
      kit: await token('gateway', 'operator'),
      viewer: await token('viewer'),
      second: await token('operator'),
    };
    const file = join(server.dataDir, 'kit.token');
    writeFileSync(file, tokens.kit);
    let said = '';
    aircraft = spawn(
      binary,
      [
        'simulate',
        'drone',
        '--mavlink',
        `udp://127.0.0.1:${port}`,
        '--url',
        server.url,
        '--ready',
        '1',
        '--token-file',
        file,
      ],
      { stdio: ['ignore', 'ignore', 'pipe'] },
    );
    aircraft.stderr.setEncoding('utf8').on('data', (chunk) => (said += chunk));
    const mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(said)?.[1]);
    const base = `/api/v1/missions/${mission}`,
      as = (json) => ({ token: tokens.pilot, json });
    const flown = (await must('/api/v1/plans', as(plan), 201)).id;
    const list = async () => (await must(`${base}/checklist?plan=${flown}`, { token: tokens.pilot }, 200)).items;
    await must(`${base}/checklist`, as({ plan: flown }), 200);
    await eventually(
      'the aircraft is heard and its fixes come',
      async () => {
        const items = await list();
        // What is overridden here must not be what keeps the autopilot from arming.
        return (
          items.find((i) => i.id === 'arming').state === 'ok' &&
          items.filter((i) => i.state === 'failed').every((i) => i.overridable)
        );
      },
      30_000,
      200,
    );
    for (const item of (await list()).filter((i) => i.state !== 'ok'))
      await must(`${base}/checklist/${item.id}`, as({ reason: 'bench' }), 200);
    const { lease } = await must(`${base}/control`, as({ action: 'take' }), 200);
    await eventually(
      'the flight begins',
      async () => (await server.fetch(`${base}/actions`, as({ action: 'start', plan: flown, lease }))).status === 202,
      30_000,
      300,
    );
    await eventually(
      'the aircraft flies',
      async () => {
        const now = await must(`${base}/procedure`, { token: tokens.pilot }, 200);
        if (now.ended) throw new Error(`the flight ended: ${now.ended}`);
        return now.status === 'running' && now.drone?.in_air;
      },
      20_000,
      100,
    );
    return { server, mission, base, lease, tokens, must, as, stop };
  } catch (error) {
    await stop();
    throw error;
  }
}
