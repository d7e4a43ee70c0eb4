// Load from a second process on loopback: raw sockets, so that the generator costs little beside the server.
import { readFileSync } from 'node:fs';
import { connect } from 'node:net';

/** CPU seconds a process has used so far. */
export function cpuSeconds(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ')[1].split(' ');
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

export function percentile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

/** One connection that sends `request` again and again until `until` (ms); counts answers of `status`, times each. */
function worker(port, request, until, status, times) {
  return new Promise((done, fail) => {
    const socket = connect(port, '127.0.0.1');
    socket.setNoDelay(true);
    let sent = 0,
      pending = Buffer.alloc(0),
      need = -1;
    const fire = () => {
      sent = performance.now();
      socket.write(request);
    };
    socket.on('connect', fire);
    socket.on('error', fail);
    socket.on('data', (chunk) => {
      pending = pending.length ? Buffer.concat([pending, chunk]) : chunk;
      if (need < 0) {
        const end = pending.indexOf('\r\n\r\n');
        if (end < 0) return;
        const head = pending.toString('latin1', 0, end);
        if (!head.startsWith(`HTTP/1.1 ${status}`))
          return fail(new Error(head + pending.toString('utf8', end, end + 500)));
        need = end + 4 + Number(/content-length: *(\d+)/i.exec(head)?.[1] ?? 0);
      }
      if (pending.length < need) return;
      pending = pending.subarray(need);
      need = -1;
      times.push(performance.now() - sent);
      if (performance.now() < until) fire();
      else {
        socket.destroy();
        done();
      }
    });
  });
}

/** {perSecond, p50Ms, p99Ms} of one request over `connections` connections for `seconds`. */
export async function hammer(port, request, { connections = 4, seconds = 3, status = 200 } = {}) {
  const times = [],
    start = performance.now();
  await Promise.all(
    Array.from({ length: connections }, () => worker(port, request, start + seconds * 1000, status, times)),
  );
  const took = (performance.now() - start) / 1000;
  return {
    perSecond: times.length / took,
    p50Ms: percentile(times, 0.5),
    p99Ms: percentile(times, 0.99),
    count: times.length,
  };
}

export function request(method, path, { body, type = 'application/x-ndjson', port } = {}) {
  const head = [`${method} ${path} HTTP/1.1`, `Host: 127.0.0.1:${port}`];
  if (body !== undefined) head.push(`Content-Type: ${type}`, `Content-Length: ${Buffer.byteLength(body)}`);
  return Buffer.from(head.join('\r\n') + '\r\n\r\n' + (body ?? ''));
}
