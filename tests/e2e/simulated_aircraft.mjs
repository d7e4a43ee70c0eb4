// A server with the simulated aircraft at the other end of MAVLink, its tag and rover through REST.
import { spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { binary, eventually, startServer } from './server.mjs';

/** The server, the mission that the aircraft made, and how the aircraft ends. */
export async function serverWithAircraft() {
  const socket = createSocket('udp4');
  await new Promise((done) => socket.bind(0, '127.0.0.1', done));
  const { port } = socket.address();
  await new Promise((done) => socket.close(done));
  const server = await startServer({ auth: 'off', args: ['--drone-address', `udp://:${port}`] });
  let said = '';
  const aircraft = spawn(
    binary,
    ['simulate', 'drone', '--mavlink', `udp://127.0.0.1:${port}`, '--url', server.url, '--ready', '2'],
    { stdio: ['ignore', 'ignore', 'pipe'] },
  );
  aircraft.stderr.setEncoding('utf8').on('data', (chunk) => (said += chunk));
  const mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(said)?.[1]);
  return { server, aircraft, mission };
}
