// The same rows over HTTP into SQLite and into a PostgreSQL beside it, in turns: rows a second, and CPU a row of the server and of whoever
// else works for it.
import { readFileSync, readdirSync } from 'node:fs';
import { startPostgres } from '../e2e/postgres.mjs';
import { startServer } from '../e2e/server.mjs';
import { cpuSeconds } from './load.mjs';

/** CPU seconds of a process and of its children, those that ended too. */
export function familySeconds(pid) {
  const stat = (one) => readFileSync(`/proc/${one}/stat`, 'utf8').split(') ')[1].split(' ');
  const ended = Number(stat(pid)[13]) + Number(stat(pid)[14]);
  const children = readdirSync('/proc').filter((name) => {
    try {
      return /^\d+$/.test(name) && Number(stat(name)[1]) === pid;
    } catch {
      return false; // it ended meanwhile
    }
  });
  return [pid, ...children].reduce((sum, one) => sum + cpuSeconds(one), ended / 100);
}

// As a receiver's: small numbers of both signs in which a compressor finds nothing (Park and Miller's generator).
let noise = 1;
const samples = Buffer.from(
  new Int16Array(1016 * 2).map(() => ((noise = (noise * 48271) % 2147483647) % 400) - 200).buffer,
).toString('base64');
const cir = `,"cir":{"n":1016,"dt_ps":1001.6,"first_path_idx":744.2,"rxpacc":1001,"b64":"${samples}"}`;
let sequence = 0;
export const range = (mission, extra) => {
  const seq = sequence++;
  return (
    `{"t_us":${1777889472000000 + seq * 100},"tag":"0x6e01","anchor":"0x6a2${seq % 6}","distance_m":${(5 + (seq % 1000) / 100).toFixed(3)},` +
    `"rss_dbm":-84.3,"fp_dbm":-86.1,"rx_dbm":-82.7,"seq":${seq},"mission":"${mission}"${extra}}\n`
  );
};
/** Ten a second of an aircraft that hovers: one that jumped would be work for the live track, which is not what is measured. */
export const fix = (mission) => {
  const seq = sequence++;
  return (
    `{"t_us":${1777889472000000 + seq * 100_000},"lon":3.7131,"lat":51.0231,"h_m":${60 + (seq % 10) / 1000},"fix":"fixed","seq":${seq},` +
    `"sigma_m":[0.01,0.01,0.02],"q":[0,0,0,1],"mission":"${mission}"}\n`
  );
};

export async function mission(server) {
  const answer = await server.fetch('/api/v1/missions', {
    json: {
      name: 'bench',
      frame: 'wgs84',
      track_point: 'gnss_antenna',
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
    },
  });
  const { id } = await answer.json();
  await server.fetch(`/api/v1/missions/${id}/actions`, { json: { action: 'finish' } }); // rows are stored, nothing is solved live
  return id;
}

async function send(server, path, body, count) {
  const headers = { 'content-type': 'application/x-ndjson' };
  const answer = await (await server.fetch(path, { method: 'POST', headers, body })).json();
  if (answer.accepted !== count) throw new Error(`${path}: ${JSON.stringify(answer).slice(0, 300)}`);
}

/** Whose work goes on behind the answer is counted too: until nothing was used for 200 ms. */
async function settled(one) {
  const used = () => cpuSeconds(one.server.pid) + one.beside();
  for (let before = -1; before !== used();) {
    before = used();
    await new Promise((done) => setTimeout(done, 200));
  }
}

export async function databases(row) {
  const postgres = await startPostgres(['shared_buffers=256MB']);
  const servers = [];
  try {
    await postgres.psql('CREATE DATABASE bench');
    servers.push({ name: 'SQLite', server: await startServer(), beside: () => 0 });
    const args = ['--database', postgres.url('bench')];
    const server = await startServer({ args, env: postgres.env });
    servers.push({ name: 'PostgreSQL', server, beside: () => familySeconds(postgres.child.pid) });
    for (const [what, path, make, perBody] of [
      ['ranges', '/api/v1/ranges', (id) => range(id, ''), 10_000],
      ['ranges with CIR', '/api/v1/ranges', (id) => range(id, cir), 1000],
      ['fixes', '/api/v1/fixes', fix, 10_000],
    ]) {
      for (const one of servers)
        Object.assign(one, { id: await mission(one.server), own: 0, other: 0, seconds: 0, rows: 0 });
      // In turns, so that what else the machine does meets both; the first warms up.
      for (let turn = 0; turn <= 5; turn++) {
        for (const one of servers) {
          const body = Array.from({ length: perBody }, () => make(one.id)).join('');
          const [own, other, start] = [cpuSeconds(one.server.pid), one.beside(), performance.now()];
          await send(one.server, path, body, perBody);
          if (turn === 0) {
            await settled(one);
            continue;
          }
          one.seconds += (performance.now() - start) / 1000;
          await settled(one);
          one.own += cpuSeconds(one.server.pid) - own;
          one.other += one.beside() - other;
          one.rows += perBody;
        }
      }
      const us = (seconds, one) => (seconds / one.rows) * 1e6;
      const [sqlite, there] = servers.map((one) => us(one.own + one.other, one));
      for (const one of servers) {
        const split =
          one.name === 'SQLite'
            ? ''
            : ` (server ${us(one.own, one).toFixed(1)}, database ${us(one.other, one).toFixed(1)})`;
        row(
          `bulk of ${what}, ${one.name}`,
          `${Math.round(one.rows / one.seconds)} rows/s, ${us(one.own + one.other, one).toFixed(1)} us CPU a row${split}`,
          one.name === 'SQLite' ? '' : `${(there / sqlite).toFixed(2)} of SQLite's CPU, aim 1.5`,
        );
      }
    }
  } finally {
    for (const { server } of servers) await server.dispose();
    await postgres.dispose();
  }
}
