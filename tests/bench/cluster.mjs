// Figures of docs/scale.md, SQLite and PostgreSQL in one run: rows in bulk, what a flight takes while more of them are in the air, and what a row
// takes on the disk.
//   node tests/bench/cluster.mjs [SECONDS]        of each number of flights (12); ANCHORD_BINARY names the server
import { statSync } from 'node:fs';
import { join } from 'node:path';
import { startPostgres } from '../e2e/postgres.mjs';
import { startServer } from '../e2e/server.mjs';
import {
  databases,
  familySeconds,
  fix as bulk_fix,
  mission as bulk_mission,
  range as bulk_range,
} from './databases.mjs';
import { cpuSeconds, percentile } from './load.mjs';

const seconds = Number(process.argv[2] ?? 12),
  warm_s = 4,
  posts_per_s = 5,
  ranges_per_post = 10, // 50 ranges a second
  fixes_per_post = 2; // and 10 fixes
const row = (work, figure, beside = '') => console.log(`${work}: ${figure}${beside ? `   (${beside})` : ''}`);

// --- A flight in circles round six anchors, its distances off by a few centimetres.
const lat = 51,
  lon = 3.7,
  m_per_deg = 111_267, // at 51 degrees north: WGS84's meridian radius 6 375 142 m
  m_per_deg_lon = 70_198; // and its parallel
const anchors = Array.from({ length: 6 }, (_, i) => ({ e: 15 * Math.cos(i), n: 10 * Math.sin(i), u: 2 + (i % 3) }));
const tag_at = (s) => ({ e: 25 * Math.cos(s / 6), n: 20 * Math.sin(s / 6), u: 6 + 3 * Math.sin(s / 9) });
const now_us = () => Math.round((performance.timeOrigin + performance.now()) * 1000);
const hex = (number) => `0x${number.toString(16)}`;

class Flight {
  constructor(server, number) {
    Object.assign(this, { server, number, tag: hex(0x1000 + number), seq: 0, answers: [] });
  }
  async begin() {
    const answer = await this.server.fetch('/api/v1/missions?devices=false', {
      json: {
        name: `bench ${this.number}`,
        frame: 'wgs84',
        track_point: 'tag_antenna',
        tags: [{ tag: this.tag, antenna: 0, lever_arm_body_m: [0, 0, 0] }],
      },
    });
    this.id = (await answer.json()).id;
  }
  async end() {
    await this.server.fetch(`/api/v1/missions/${this.id}/actions`, { json: { action: 'finish' } });
  }
  async post(path, list) {
    const body = list.map((one) => JSON.stringify(one)).join('\n'),
      since = performance.now();
    const headers = { 'content-type': 'application/x-ndjson' };
    const answer = await (await this.server.fetch(path, { method: 'POST', headers, body })).json();
    if (answer.accepted !== list.length) throw new Error(`${path}: ${JSON.stringify(answer).slice(0, 300)}`);
    this.answers.push(performance.now() - since);
  }
  /** What was measured since the last one. */
  async send() {
    const common = { mission: this.id },
      until_us = now_us(),
      from_us = this.until_us ?? until_us - 1e6 / posts_per_s;
    this.until_us = until_us;
    const at = (i, n) => Math.round(from_us + ((until_us - from_us) * (i + 1)) / n);
    const position = (t_us) => tag_at((t_us / 1e6 + this.number) % 1e6);
    await this.post(
      '/api/v1/fixes',
      Array.from({ length: fixes_per_post }, (_, i) => {
        const t_us = at(i, fixes_per_post),
          p = position(t_us);
        return { ...common, t_us, seq: this.seq++, fix: 'fixed', sigma_m: [0.01, 0.01, 0.02], q: [0, 0, 0, 1],
          lat: lat + p.n / m_per_deg, lon: lon + p.e / m_per_deg_lon, h_m: 50 + p.u }; // prettier-ignore
      }),
    );
    await this.post(
      '/api/v1/ranges',
      Array.from({ length: ranges_per_post }, (_, i) => {
        const t_us = at(i, ranges_per_post) - 1000,
          p = position(t_us),
          k = this.seq % anchors.length,
          a = anchors[k];
        const distance_m = Math.hypot(p.e - a.e, p.n - a.n, p.u - a.u) + ((this.seq * 7) % 11) / 100 - 0.05;
        return {
          ...common,
          t_us,
          seq: this.seq++,
          tag: this.tag,
          anchor: hex(0x2000 + this.number * 8 + k),
          distance_m,
        };
      }),
    );
  }
  /** Until `end` (ms), at its own phase. */
  async fly(end) {
    const step = 1000 / posts_per_s;
    let due = performance.now() + (step * this.number) / 64;
    while (Math.max(due, performance.now()) < end) {
      await new Promise((done) => setTimeout(done, Math.max(0, due - performance.now())));
      await this.send();
      due += step;
    }
  }
}

/** ms of CPU a second, of the server and of its database, from now until `until` has come. */
async function used_until(one, until) {
  const [own, other, since] = [cpuSeconds(one.server.pid), one.beside(), performance.now()];
  await until;
  const per = (used) => (used / (performance.now() - since)) * 1e6;
  return { server: per(cpuSeconds(one.server.pid) - own), database: per(one.beside() - other) };
}
const pause = (s) => new Promise((done) => setTimeout(done, s * 1000));

async function flights(one, n) {
  const all = Array.from({ length: n }, (_, i) => new Flight(one.server, i));
  for (const flight of all) await flight.begin();
  const end = performance.now() + (warm_s + seconds) * 1000,
    flying = Promise.all(all.map((flight) => flight.fly(end))).then(() => null, (error) => error); // prettier-ignore
  await pause(warm_s);
  for (const flight of all) flight.answers = [];
  const since = performance.now(),
    used = await used_until(one, flying);
  const error = await flying;
  if (error) throw error;
  // Where the machine is full fewer rows come than are due: what is counted is the work for 50 ranges and 10 fixes.
  const answers = all.flatMap((flight) => flight.answers),
    carried = answers.length / 2 / posts_per_s / ((performance.now() - since) / 1000),
    server_ms = (used.server - one.idle.server) / carried,
    database_ms = (used.database - one.idle.database) / carried;
  row(
    `${n} flights of 50 ranges/s, ${one.name}`,
    `${server_ms.toFixed(1)} ms CPU a flight and second${one.postgres ? ` + ${database_ms.toFixed(1)} of the database` : ''}`,
    `acknowledged p50 ${percentile(answers, 0.5).toFixed(0)} ms, p99 ${percentile(answers, 0.99).toFixed(0)} ms; ${carried.toFixed(1)} carried`,
  );
  for (const flight of all) await flight.end();
  return { server_ms, database_ms };
}

/** Bytes that rows take, indexes and all, by what the database has grown. */
async function sizes(servers) {
  for (const [what, path, make, n] of [
    ['range', '/api/v1/ranges', (id) => bulk_range(id, ''), 200_000],
    ['fix', '/api/v1/fixes', bulk_fix, 100_000],
  ]) {
    const bytes = [];
    for (const one of servers) {
      const id = await bulk_mission(one.server),
        before = await one.bytes();
      for (let sent = 0; sent < n; sent += 10_000) {
        const body = Array.from({ length: 10_000 }, () => make(id)).join('');
        const headers = { 'content-type': 'application/x-ndjson' };
        const answer = await one.server.fetch(path, { method: 'POST', headers, body });
        if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
        await answer.arrayBuffer();
      }
      bytes.push(((await one.bytes()) - before) / n);
    }
    row(`a ${what} on the disk`, servers.map((one, i) => `${one.name} ${bytes[i].toFixed(0)} bytes`).join(', '));
  }
}

await databases(row);
const postgres = await startPostgres(['shared_buffers=256MB']);
const servers = [];
try {
  await postgres.psql('CREATE DATABASE bench');
  const limits = ['--rate-per-s', '1000000', '--rate-burst', '1000000'];
  const sqlite = await startServer({ args: limits });
  servers.push({
    name: 'SQLite',
    server: sqlite,
    beside: () => 0,
    bytes: async () => {
      await sqlite.restart(); // its log is in the file then
      return statSync(join(sqlite.dataDir, 'anchord.db')).size;
    },
  });
  servers.push({
    name: 'PostgreSQL',
    postgres: true,
    server: await startServer({ args: ['--database', postgres.url('bench'), ...limits], env: postgres.env }),
    beside: () => familySeconds(postgres.child.pid),
    bytes: async () => Number(await postgres.psql("SELECT pg_database_size('bench')")),
  });
  for (const one of servers) {
    one.idle = { server: 0, database: 0 };
    one.idle = await used_until(one, pause(8));
    const { server, database } = one.idle;
    row(
      `no flight, ${one.name}`,
      `${server.toFixed(1)} ms CPU a second${one.postgres ? ` + ${database.toFixed(1)}` : ''}`,
    );
  }
  for (const n of [1, 4, 16, 32, 64]) {
    const [a, b] = [await flights(servers[0], n), await flights(servers[1], n)];
    const whole = (b.server_ms + b.database_ms) / a.server_ms,
      own = b.server_ms / a.server_ms;
    row(`${n} flights`, `PostgreSQL takes ${whole.toFixed(2)} of SQLite's CPU, ${own.toFixed(2)} on the server`);
  }
  await sizes(servers);
} finally {
  for (const { server } of servers) await server.dispose();
  await postgres.dispose();
}
process.exit();
