// Two builds of the server, turn by turn in one run: start-up, ingest, fan-out and live update of each, and their ratio.
//   node tests/bench/builds.mjs OLD NEW [ROUNDS]        programs, as build/release/anchord; ANCHORD_BENCH_LIMIT names the ratio refused (1.05)
import { resolve } from 'node:path';
import { startServer } from '../e2e/server.mjs';
import { liveLatency, ndjson, newMission } from './live_load.mjs';
import { cpuSeconds } from './load.mjs';

const [old, now, asked = '6'] = process.argv.slice(2),
  limit = Number(process.env.ANCHORD_BENCH_LIMIT ?? 1.05);
if (!old || !now) {
  console.error('usage: node tests/bench/builds.mjs OLD NEW [ROUNDS]');
  process.exit(2);
}
const unlimited = ['--rate-per-s', '1000000', '--rate-burst', '1000000'];
const k_rows = 10_000,
  k_bodies = 6,
  k_starts = 5;

/** Ms from exec to ready of a server that has data; its CPU time is less than a few ticks of the system's counter. */
async function startup(server) {
  let ms = Infinity;
  for (let i = 0; i < k_starts; i++) {
    await server.stop();
    const begun = performance.now();
    await server.start();
    ms = Math.min(ms, performance.now() - begun);
  }
  return { 'start-up, ms': ms };
}

async function ingest(server) {
  const id = await newMission(server, 'ingest'),
    bodies = Array.from({ length: k_bodies }, () => ndjson(k_rows, id, '')),
    cpu = cpuSeconds(server.pid);
  for (const body of bodies) {
    const answer = await server.fetch('/api/v1/ranges', {
      method: 'POST',
      headers: { 'content-type': 'application/x-ndjson' },
      body,
    });
    const { accepted } = await answer.json();
    if (accepted !== k_rows) throw new Error(`ingest: ${answer.status}, ${accepted} of ${k_rows} accepted`);
  }
  return { 'ingest, CPU us a row': ((cpuSeconds(server.pid) - cpu) / (k_rows * k_bodies)) * 1e6 };
}

async function streams(server, name, clients) {
  const { late, want, share, p50 } = await liveLatency(server, name, clients);
  if (late.length < want * 0.99) throw new Error(`${name}: ${late.length} of ${want} delivered`);
  return { [`${name}, % of a core`]: share * 100, [`${name}, p50 ms`]: p50 };
}

const best = { old: {}, now: {} },
  turns = Object.entries({ old, now });
for (let round = 0; round < Number(asked); round++)
  for (const [which, program] of round % 2 ? turns.toReversed() : turns) {
    const server = await startServer({ program: resolve(program), args: unlimited });
    try {
      const figures = {
        ...(await ingest(server)),
        ...(await streams(server, 'fan-out of 100 ranges/s to 50 clients', 50)),
        ...(await streams(server, 'live update of 100 ranges/s, one client', 1)),
        ...(await startup(server)),
      };
      for (const [work, figure] of Object.entries(figures))
        best[which][work] = Math.min(best[which][work] ?? Infinity, figure);
      console.error(`${round + 1} ${which}: ${JSON.stringify(figures)}`);
    } finally {
      await server.dispose();
    }
  }

console.log('| work | old | new | new/old |\n| --- | --- | --- | --- |');
for (const [work, figure] of Object.entries(best.old)) {
  const ratio = best.now[work] / figure;
  console.log(
    `| ${work} | ${figure.toPrecision(3)} | ${best.now[work].toPrecision(3)} | ${ratio.toFixed(2)}${ratio > limit ? ' slower' : ''} |`,
  );
  if (ratio > limit) process.exitCode = 1;
}
