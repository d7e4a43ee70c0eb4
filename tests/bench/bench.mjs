// ./dev bench: one table. Every figure of ours stands beside a peer or a limit taken in the same run.
//   node tests/bench/bench.mjs [keep] [PART...]: see README.md
import { execFileSync } from 'node:child_process';
import { createServer } from 'node:http';
import { existsSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { run, startServer } from '../e2e/server.mjs';
import { commands } from './commands.mjs';
import { dashboard } from './dashboard.mjs';
import { databases } from './databases.mjs';
import { devices } from './devices.mjs';
import { gateway } from './gateway.mjs';
import { grid } from './grid.mjs';
import { drops, keep, newestOf, ratios } from './history.mjs';
import { http } from './http.mjs';
import { liveLatency, ndjson, newMission } from './live_load.mjs';
import { cpuSeconds, hammer, percentile, request } from './load.mjs';
import { safety } from './safety.mjs';
import { start_search } from './search.mjs';

const history = fileURLToPath(new URL('history', import.meta.url));
const wanted = process.argv.slice(2).filter((name) => name !== 'keep');
const on = (name) => wanted.length === 0 || wanted.includes(name);
const rows = [];
const row = (work, figure, beside = '') => {
  rows.push([work, figure, beside]);
  console.error(`    ${work}: ${figure}${beside ? `   (${beside})` : ''}`);
};
// What has a peer of the same run in the same unit; its ratio is compared with that of the last run.
const measured = [];
const measure = (work, unit, ours, peer, beside) => {
  measured.push({ work, unit, ours, peer });
  row(work, `${ours.toPrecision(3)} ${unit} CPU`, `${beside} ${peer.toPrecision(3)}`);
};
const say = (text) => console.error(`==> ${text}`);

function solve() {
  const bench = join(process.env.ANCHORD_BENCH_DIR ?? '', 'solve_bench');
  if (!existsSync(bench)) return row('solve', 'not built', bench);
  const out = JSON.parse(
    execFileSync(bench, ['--benchmark_format=json', '--benchmark_min_time=0.2'], {
      stdio: ['ignore', 'pipe', 'ignore'],
    }),
  );
  const time = Object.fromEntries(out.benchmarks.map((b) => [b.name, b]));
  for (const n of [10, 100, 1000, 10000]) {
    const [ours, ceres] = ['gauss_newton', 'ceres'].map((solver) => time[`solve_${solver}/${n}`].cpu_time);
    measure(`solve one anchor, ${n} ranges, cold`, 'us', ours, ceres, 'Ceres');
  }
  row('solve a flight of 3 700 ranges, 6 anchors', `${time.solve_whole_flight.cpu_time.toFixed(0)} ms CPU`);
  row('joint solve of 10 000 ranges to 50 anchors, cold', `${time.solve_fifty_anchors.cpu_time.toFixed(0)} ms CPU`);
  row(
    'live update, one range',
    `p50 ${time.live_update.p50_us.toFixed(1)} us, p99 ${time.live_update.p99_us.toFixed(1)} us`,
    'limit of a range at 200 Hz: 5 ms',
  );
  row(
    'live path, per second of flight',
    `${(time.live_whole_flight.cpu_s_per_flight_s * 1e3).toFixed(1)} ms CPU`,
    'limit 1000 ms',
  );
}

// Numbers of core/ml's Method, for the names in the table.
const methods = [
  'none',
  'constant',
  'logistic',
  'random_forest',
  'svm',
  'boosted',
  'average',
  'univariate',
  'multivariate',
];

function predict() {
  const bench = join(process.env.ANCHORD_BENCH_DIR ?? '', 'features_bench');
  if (!existsSync(bench)) return row('predict', 'not built', bench);
  const out = JSON.parse(
    execFileSync(bench, ['--benchmark_format=json', '--benchmark_min_time=0.2'], {
      stdio: ['ignore', 'pipe', 'ignore'],
    }),
  ).benchmarks;
  const by = Object.fromEntries(out.map((b) => [b.name, b]));
  for (const [arg, what] of ['as in flight', 'with the shape of the whole record'].entries())
    row(
      `features of 1016-sample CIRs, ${what}`,
      `${(by[`features_of_complex_cirs/${arg}`].items_per_second / 1e3).toFixed(0)} k/s`,
      'one thread',
    );
  for (const name of Object.keys(by).filter((n) => n.startsWith('predict_single/'))) {
    const method = name.split('/')[1];
    row(
      `predict, ${methods[method]}, 7 features`,
      `${by[name].cpu_time.toFixed(0)} ns single`,
      `batch ${(by[`predict_batch/${method}`].items_per_second / 1e6).toFixed(2)} M/s, one thread`,
    );
  }
}

function bound() {
  const bench = join(process.env.ANCHORD_BENCH_DIR ?? '', 'cramer_rao_bench');
  if (!existsSync(bench)) return row('bound', 'not built', bench);
  const out = JSON.parse(execFileSync(bench, ['200'], { stdio: ['ignore', 'pipe', 'ignore'] }));
  const one = (name, what, limit) =>
    row(
      `RMSE over the Cramer-Rao bound, ${what}`,
      `${out[name].ratio.toFixed(3)}, 95 % region holds ${(100 * out[name].coverage).toFixed(1)} %`,
      limit,
    );
  one('labelled', 'correct weights', 'limit 1.05, 93 to 97 %');
  one('unlabelled', 'a fifth blocked, unlabelled', 'limit 1.3, 93 to 97 %');
  one('unmodelled', 'a fifth blocked, no model at all');
}

function planner() {
  const bench = join(process.env.ANCHORD_BENCH_DIR ?? '', 'planner_bench');
  if (!existsSync(bench)) return row('planner', 'not built', bench);
  const out = JSON.parse(
    execFileSync(bench, ['--benchmark_format=json', '--benchmark_min_time=0.2'], {
      stdio: ['ignore', 'pipe', 'ignore'],
    }),
  );
  const ns = Object.fromEntries(out.benchmarks.map((b) => [b.name, b.per_candidate * 1e9]));
  measure(
    'planner, 41^3 candidates, 1 000 past points, per candidate',
    'ns',
    ns.batch_kernel,
    ns.rebuild_and_invert,
    'rebuild and invert',
  );
  row(
    'planner, whole decision of the same, per candidate',
    `${ns['whole_decision/20'].toFixed(1)} ns CPU`,
    `its kernel ${ns.batch_kernel.toFixed(1)}`,
  );
}

function polygons() {
  const bench = join(process.env.ANCHORD_BENCH_DIR ?? '', 'polygon_bench');
  if (!existsSync(bench)) return row('polygons', 'not built', bench);
  const out = JSON.parse(
    execFileSync(bench, ['--benchmark_format=json', '--benchmark_min_time=0.2'], {
      stdio: ['ignore', 'pipe', 'ignore'],
    }),
  );
  const ns = Object.fromEntries(out.benchmarks.map((b) => [b.name, b.per_call * 1e9]));
  for (const question of ['contains', 'distance_to_edge', 'way_crosses']) {
    const work = `polygon of 12 corners, ${question.replaceAll('_', ' ')}`;
    measure(work, 'ns', ns[`${question}_own`], ns[`${question}_boost`], 'Boost.Geometry');
  }
}

async function ingest(server) {
  const id = await newMission(server, 'bench ingest');
  const samples = Buffer.alloc(1016 * 4);
  for (let i = 0; i < samples.length; i++) samples[i] = (i * 37) & 0xff;
  const cir = `,"cir":{"n":1016,"dt_ps":1001.6,"first_path_idx":744.2,"rxpacc":1001,"b64":"${samples.toString('base64')}"}`;
  for (const [name, extra, perBody, bodies] of [
    ['without CIR', '', 10_000, 6],
    ['with CIR', cir, 1000, 6],
  ]) {
    const texts = Array.from({ length: bodies }, () => ndjson(perBody, id, extra));
    const cpu = cpuSeconds(server.pid),
      start = performance.now();
    for (const body of texts) {
      const answer = await server.fetch('/api/v1/ranges', {
        method: 'POST',
        headers: { 'content-type': 'application/x-ndjson' },
        body,
      });
      const result = await answer.json();
      if (result.accepted !== perBody)
        throw new Error(`ingest: ${answer.status} ${JSON.stringify(result).slice(0, 500)}`);
    }
    const seconds = (performance.now() - start) / 1000,
      total = perBody * bodies;
    row(
      `ingest over HTTP ${name}`,
      `${Math.round(total / seconds)} rows/s, ${(((cpuSeconds(server.pid) - cpu) / total) * 1e6).toFixed(1)} us CPU a row`,
      name === 'without CIR' ? `SQLite alone ${sqliteAlone(total)} rows/s` : 'aim 2 000 rows/s',
    );
  }
  const one = [];
  for (let i = 0; i < 200; i++) {
    const body = ndjson(1, id, '');
    const start = performance.now();
    const answer = await server.fetch('/api/v1/ranges', {
      method: 'POST',
      headers: { 'content-type': 'application/x-ndjson' },
      body,
    });
    await answer.arrayBuffer();
    one.push(performance.now() - start);
  }
  row(
    'POST of one range, acknowledged after fsync',
    `p50 ${percentile(one, 0.5).toFixed(2)} ms, p99 ${percentile(one, 0.99).toFixed(2)} ms`,
  );
}

/** The same rows by the sqlite3 program into a table with one key, WAL, FULL, 1 000 rows a transaction: the limit. */
function sqliteAlone(count) {
  const folder = mkdtempSync(join(tmpdir(), 'anchord-bench-'));
  try {
    let sql =
      'PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; CREATE TABLE r(id INTEGER PRIMARY KEY, t INTEGER, tag ' +
      'INTEGER, anchor INTEGER, seq INTEGER, d REAL, rss REAL, fp REAL, rx REAL, UNIQUE(t, tag, anchor, seq)) ' +
      'STRICT;\n';
    for (let i = 0; i < count; i++) {
      if (i % 1000 === 0) sql += 'BEGIN;\n';
      sql += `INSERT INTO r(t,tag,anchor,seq,d,rss,fp,rx) VALUES(${1777889472000000 + i * 100},28161,${27168 + (i % 6)},${i},7.5,-84.3,-86.1,-82.7);\n`;
      if (i % 1000 === 999) sql += 'COMMIT;\n';
    }
    const start = performance.now();
    execFileSync('sqlite3', [join(folder, 'x.db')], { input: sql, stdio: ['pipe', 'ignore', 'inherit'] });
    return Math.round(count / ((performance.now() - start) / 1000));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

async function get(server) {
  const flight = join(server.dataDir, 'flight');
  await run(['simulate', 'flight', '--seed', '7', '--duration', '60', '--out', flight]);
  const { code, stderr } = await run(['import', 'flight', flight, '--url', server.url]);
  if (code !== 0) throw new Error(`import: ${stderr}`);
  const id = (await (await server.fetch('/api/v1/missions')).json()).items?.find((m) =>
    m.name.startsWith('simulated'),
  )?.id;
  const solved = await server.fetch('/api/v1/calibrations', {
    json: { missions: [id] },
    headers: { prefer: 'wait=60' },
  });
  const calibration = await solved.json();
  const published = await server.fetch(`/api/v1/calibrations/${calibration.id}/publish`, { json: {} });
  if (!published.ok) throw new Error(`publish: ${published.status} ${await published.text()}`);
  const body = await (await server.fetch('/api/v1/anchors/0x6a21')).text();
  const cpu = cpuSeconds(server.pid);
  const ours = await hammer(server.port, request('GET', '/api/v1/anchors/0x6a21', { port: server.port }));
  const perRequest = ((cpuSeconds(server.pid) - cpu) / ours.count) * 1e6;
  const peer = createServer((_, response) =>
    response
      .writeHead(200, { 'content-type': 'application/geo+json', 'content-length': Buffer.byteLength(body) })
      .end(body),
  );
  await new Promise((done) => peer.listen(0, '127.0.0.1', done));
  const plain = await hammer(peer.address().port, request('GET', '/', { port: 1 }));
  peer.close();
  row(
    'GET of one anchor, 4 connections',
    `${Math.round(ours.perSecond)} a second, p99 ${ours.p99Ms.toFixed(2)} ms, ${perRequest.toFixed(0)} us CPU`,
    `the same bytes from a bare Node server in the generator's process ${Math.round(plain.perSecond)}`,
  );
}

async function fanout(server) {
  const { late, want, gaps, share, p50, p99 } = await liveLatency(server, 'bench fan-out', 50);
  row(
    'fan-out of 100 ranges/s to 50 clients',
    `p50 ${p50.toFixed(1)} ms, p99 ${p99.toFixed(1)} ms, ${late.length} of ${want} delivered, ${gaps} gaps, ${(share * 100).toFixed(0)} % of a core`,
    'from the stamp in the row to the parsed message, fsync and the wait for the next fix (50 ms) included',
  );
}

/** Live ranges with and without a grid search that keeps every core busy. */
async function training(server) {
  const quiet = await liveLatency(server, 'bench without training', 4);
  const search = await start_search(server);
  const busy = await liveLatency(server, 'bench with training', 4);
  const still = await search.state();
  await search.stop();
  row(
    'live range, 100/s to 4 clients, beside a grid search',
    `p50 ${busy.p50.toFixed(1)} ms, p99 ${busy.p99.toFixed(1)} ms (search ${still})`,
    `without it p50 ${quiet.p50.toFixed(1)} ms, p99 ${quiet.p99.toFixed(1)} ms`,
  );
}

if (on('bound')) {
  say('distance from the Cramer-Rao bound, simulated flights');
  bound();
}
if (on('planner')) {
  say('planner');
  planner();
  polygons();
}
if (on('solve')) {
  say('solving');
  solve();
}
if (on('predict')) {
  say('features and predictions');
  predict();
}
if (on('grid')) {
  say('grid');
  grid(row);
}
if (on('commands')) {
  say('commands to an aircraft beside a flood');
  await commands(row).catch((error) => {
    row('commands', `FAILED: ${error.message.split('\n')[0]}`);
    process.exitCode = 1;
  });
}
if (wanted.includes('gateway')) {
  say('gateway over a bad link (half an hour)');
  await gateway(row).catch((error) => {
    row('gateway', `FAILED: ${error.message.split('\n')[0]}`);
    process.exitCode = 1;
  });
}
if (on('databases')) {
  say('SQLite and PostgreSQL');
  await databases(row).catch((error) => {
    row('databases', `FAILED: ${error.message.split('\n')[0]}`);
    process.exitCode = 1;
  });
}
if (on('dashboard')) {
  say('dashboard');
  await dashboard(row).catch((error) => {
    row('dashboard', `FAILED: ${error.message.split('\n')[0]}`);
    process.exitCode = 1;
  });
}
if (['http', 'ingest', 'get', 'fanout', 'training', 'devices'].some(on)) {
  // The limits of one token are not what is measured.
  const server = await startServer({ args: ['--rate-per-s', '1000000', '--rate-burst', '1000000'] });
  try {
    for (const [name, task] of [
      ['http', async (s) => http(s, ndjson, await newMission(s, 'bench http'), measure)],
      ['ingest', ingest],
      ['get', get],
      ['fanout', fanout],
      ['training', training],
      [
        'devices',
        async (s) => {
          await devices(s, row);
          await safety(row);
        },
      ],
    ]) {
      if (!on(name)) continue;
      say(name);
      await task(server).catch((error) => {
        row(name, `FAILED: ${error.message.split('\n')[0]}`);
        process.exitCode = 1;
      });
    }
  } finally {
    await server.dispose();
  }
}
const width = [0, 1].map((column) => Math.max(...rows.map((r) => r[column].length)));
console.log(
  rows.map(([work, figure, beside]) => `${work.padEnd(width[0])}  ${figure.padEnd(width[1])}  ${beside}`).join('\n'),
);
const now = ratios(measured);
if (process.env.ANCHORD_BENCH_DIR)
  writeFileSync(join(process.env.ANCHORD_BENCH_DIR, 'bench.json'), JSON.stringify({ rows, measured }, null, 2) + '\n');
const last = newestOf(history);
for (const { work, before, now: ratio } of last ? drops(last.ratios, now) : [])
  console.log(`SLOWER than ${last.name}: ${work}: ${ratio} times its peer, was ${before}`);
if (process.argv.includes('keep')) keep(history, new Date().toISOString().slice(0, 10), now);
process.exit();
