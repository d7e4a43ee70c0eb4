// A flight of a million ranges leaves the server as NDJSON, CSV and GeoPackage: how long, how many bytes, and what its resident memory rises to.
//   node tests/bench/exports.mjs [RANGES]        ANCHORD_BINARY names the server
// Fails where memory rises by more than `most_mib`, or grows with the number of rows: a tenth of them is sent first.
import { startServer } from '../e2e/server.mjs';
import { cpu_s, forget_peak, mib } from './process.mjs';

const n_ranges = Number(process.argv[2] ?? 1_000_000),
  most_mib = 48,
  start_us = 1_777_889_472_000_000;
const server = await startServer({ auth: 'off' });

/** Rows at 100 Hz of four anchors, and a position five times a second. */
function* bodies(mission, n) {
  let text = '';
  for (let i = 0; i < n; i++) {
    const row = {
      t_us: start_us + i * 10_000,
      tag: '0x6e01',
      anchor: `0x${(0x6a21 + (i % 4)).toString(16)}`,
      distance_m: 5 + (i % 997) / 100,
      rss_dbm: -80.5,
      seq: i,
      mission,
    };
    text += JSON.stringify(row) + '\n';
    if (text.length > 16e6 || i === n - 1) {
      yield ['ranges', text];
      text = '';
    }
  }
  for (let i = 0; i * 200_000 < n * 10_000; i++) {
    const row = { t_us: start_us + i * 200_000, lon: 3.7 + i * 1e-7, lat: 51, h_m: 50, fix: 'fixed', mission };
    text += JSON.stringify(row) + '\n';
  }
  yield ['fixes', text];
}
async function flight(n) {
  const made = await server.fetch('/api/v1/missions?devices=false', {
    json: { name: `${n} ranges`, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
  });
  const { id } = await made.json();
  await server.fetch(`/api/v1/missions/${id}/actions`, { json: { action: 'finish' } });
  for (const [what, body] of bodies(id, n)) {
    const answer = await server.fetch(`/api/v1/${what}`, {
      method: 'POST',
      headers: { 'content-type': 'application/x-ndjson' },
      body,
    });
    if (answer.status !== 200) throw new Error(`${what}: ${answer.status} ${(await answer.text()).slice(0, 300)}`);
  }
  return id;
}

/** One export, thrown away as it comes: {bytes, s, cpu, rise_mib}. */
async function sent(path) {
  forget_peak(server.pid);
  const before = mib(server.pid, 'VmRSS'),
    cpu = cpu_s(server.pid),
    begun = performance.now();
  const answer = await server.fetch(path);
  if (answer.status !== 200) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
  let bytes = 0;
  for await (const part of answer.body) bytes += part.length;
  return {
    bytes,
    s: (performance.now() - begun) / 1000,
    cpu: cpu_s(server.pid) - cpu,
    rise: mib(server.pid, 'VmHWM') - before,
    peak: mib(server.pid, 'VmHWM'),
  };
}

const paths = {
  NDJSON: (id) => `/api/v1/ranges?mission=${id}&format=ndjson`,
  CSV: (id) => `/api/v1/ranges?mission=${id}&format=csv`,
  GeoPackage: (id) => `/api/v1/missions/${id}/ranges.gpkg`,
};
let wrong = 0;
try {
  const few = await flight(n_ranges / 10),
    all = await flight(n_ranges);
  for (const path of Object.values(paths)) await sent(path(few)); // what is made once is there
  console.log(
    `| format | ranges | MB | s | CPU s | rows/s | resident memory rises by | to |\n| --- | --- | --- | --- | --- | --- | --- | --- |`,
  );
  for (const [format, path] of Object.entries(paths)) {
    for (const [id, n] of [
      [few, n_ranges / 10],
      [all, n_ranges],
    ]) {
      const { bytes, s, cpu, rise, peak } = await sent(path(id));
      console.log(
        `| ${[format, n, (bytes / 1e6).toFixed(1), s.toFixed(1), cpu.toFixed(1), Math.round(n / s)].join(' | ')} | ` +
          `${rise.toFixed(1)} MiB | ${peak.toFixed(0)} MiB |`,
      );
      if (rise > most_mib) {
        wrong++;
        console.error(`${format} of ${n} ranges: memory rises by ${rise.toFixed(1)} MiB (limit ${most_mib})`);
      }
    }
  }
} finally {
  await server.dispose();
}
process.exit(wrong ? 1 : 0);
