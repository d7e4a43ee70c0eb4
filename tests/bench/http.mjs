// CPU time of the server per request, beside a bare Node server that does less (peer.mjs), turn by turn in one run.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { fileURLToPath } from 'node:url';
import { cpuSeconds, hammer, request } from './load.mjs';

const rounds = 5;
const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

async function startPeer() {
  const child = spawn(process.execPath, [fileURLToPath(new URL('peer.mjs', import.meta.url))], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const [port] = await once(child.stdout, 'data');
  return { child, pid: child.pid, port: Number(port) };
}

/** CPU us a request of `bytesFor(port)`, one connection. */
async function cost(pid, port, bytesFor, seconds) {
  const cpu = cpuSeconds(pid);
  const { count } = await hammer(port, bytesFor(port), { connections: 1, seconds });
  return ((cpuSeconds(pid) - cpu) / count) * 1e6;
}

/** measure(work, unit, ours, peer, beside): costs in `unit`, the peer's beside them. */
export async function http(server, ndjson, mission, measure) {
  const peer = await startPeer();
  try {
    const works = [
      ['GET /version', 'us', 1, (port) => request('GET', '/version', { port })],
      // The same rows again and again would be duplicates, dearer than new ones: a dry run checks and stores nothing.
      [
        'NDJSON of 1 000 ranges, checked',
        'us a row',
        1000,
        (port) => request('POST', '/api/v1/ranges?dry_run=true', { body: ndjson(1000, mission, ''), port }),
      ],
    ];
    for (const [work, unit, parts, bytesFor] of works) {
      const ours = [],
        theirs = [];
      for (let i = 0; i < rounds; i++) {
        ours.push((await cost(server.pid, server.port, bytesFor, 1)) / parts);
        theirs.push((await cost(peer.pid, peer.port, bytesFor, 1)) / parts);
      }
      measure(work, unit, median(ours), median(theirs), 'a bare Node server that only parses');
    }
  } finally {
    peer.child.kill();
  }
}
