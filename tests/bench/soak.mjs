// ./dev bench soak [MINUTES]: a long flight. 300 rows a second into one mission, 20 WebSocket streams that read; is resident
// memory flat once the first third has passed? It is read every second, since joint solutions need some MiB for a second or two:
// what counts is the level that it comes back to (a tenth of the seconds are below) and the highest one, of the last third against
// the middle one. The median says neither: it jumps between the two as solutions get longer. Prints a line every minute; the exit
// code tells.
import { readFileSync, readdirSync, readlinkSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import WebSocket from 'ws';
import { startServer } from '../e2e/server.mjs';
import { cpuSeconds, percentile } from './load.mjs';

// "One hour of mixed work: resident memory and descriptors flat (6 MiB, 2)" is the promise.
const k_flat_mib = 6,
  k_flat_descriptors = 2;
// A minute in which a request waited longer is one of a machine that did something else: rows pile up here and there.
const k_stalled_ms = 10_000;
const k_ranges_per_s = 290,
  k_fixes_per_s = 10,
  k_streams = 20,
  k_tick_ms = 100;

const memory = (pid) => {
  const text = readFileSync(`/proc/${pid}/status`, 'utf8');
  const mib = (name) => Number(new RegExp(`^${name}:\\s+(\\d+)`, 'm').exec(text)?.[1] ?? 0) / 1024;
  return { rss: mib('VmRSS'), threads: Number(/^Threads:\s+(\d+)/m.exec(text)[1]), descriptors: files(pid) };
};
// Sockets come and go with the requests under way.
function files(pid) {
  return readdirSync(`/proc/${pid}/fd`).filter((fd) => {
    try {
      return !readlinkSync(`/proc/${pid}/fd/${fd}`).startsWith('socket:');
    } catch {
      return false; // closed since
    }
  }).length;
}
const nowUs = () => Math.round((performance.timeOrigin + performance.now()) * 1000);

// A hall of 40 by 20 m at 51 N, eight anchors in it, a drone that circles it once in two minutes at two heights.
const k_lat = 51.0231,
  k_lon = 3.7131,
  k_m_per_deg = 111_250,
  k_m_per_deg_lon = 70_000;
const anchors = Array.from({ length: 8 }, (_, i) => ({
  id: `0x6a2${i}`,
  e: (i % 4) * 10 + 5,
  n: i < 4 ? 2 : 18,
  u: 3 + (i % 3),
}));
const tagAt = (s) => {
  const angle = (2 * Math.PI * s) / 120;
  return { e: 20 + 32 * Math.cos(angle), n: 10 + 22 * Math.sin(angle), u: 6 + 4 * Math.sin(angle / 3) };
};

class Stream {
  constructor(server, topics) {
    this.received = 0;
    this.gaps = 0;
    this.socket = new WebSocket(`${server.url.replace('http', 'ws')}/api/v1/ws`, 'anchord.v1', {
      perMessageDeflate: false,
    });
    this.socket.on('message', (data) => {
      this.received += data.length;
      if (data.includes('"op":"gap"')) this.gaps++;
    });
    this.socket.on('error', () => {});
    this.open = new Promise((done, fail) => {
      this.socket.once('open', () => {
        topics.forEach((topic, i) => this.socket.send(JSON.stringify({ op: 'sub', id: i + 1, topic })));
        done();
      });
      this.socket.once('error', fail);
    });
  }
}

/** Rounds of `k_tick_ms` until the time is over; every round's rows are sent whether or not the last were answered. */
async function fly(server, mission, minutes, everySecond, everyMinute) {
  const start = performance.now(),
    end = start + minutes * 60_000;
  const counts = { sent: 0, acknowledged: 0, failed: 0, late: [] };
  let seq = 0,
    fixSeq = 0,
    second = 0,
    minute = 0;
  const post = async (path, rows) => {
    const began = performance.now();
    counts.sent += rows.length;
    try {
      const answer = await server.fetch(path, {
        method: 'POST',
        headers: { 'content-type': 'application/x-ndjson' },
        body: rows.map((r) => JSON.stringify(r)).join('\n') + '\n',
      });
      const json = await answer.json();
      counts.acknowledged += json.accepted ?? 0;
      if (!answer.ok) counts.failed += rows.length;
    } catch {
      counts.failed += rows.length;
    }
    counts.late.push(performance.now() - began);
  };
  const fix = () => {
    const at = tagAt((performance.now() - start) / 1000);
    return {
      t_us: nowUs(),
      mission,
      seq: fixSeq++,
      lon: k_lon + at.e / k_m_per_deg_lon,
      lat: k_lat + at.n / k_m_per_deg,
      h_m: 50 + at.u,
      fix: 'fixed',
      sigma_m: [0.01, 0.01, 0.02],
      q: [0, 0, 0, 1],
    };
  };
  await post('/api/v1/fixes', [fix()]);
  await new Promise((done) => {
    const timer = setInterval(() => {
      const now = performance.now(),
        at = tagAt((now - start) / 1000),
        due = Math.floor(((now - start) / 1000) * k_ranges_per_s),
        rows = [];
      while (seq < due) {
        const anchor = anchors[seq % anchors.length];
        const noise = 0.05 * Math.sin(seq * 12.9898) + (seq % 11 === 0 ? 0.6 : 0);
        rows.push({
          t_us: nowUs() - (due - seq) * 300,
          mission,
          tag: '0x6e01',
          anchor: anchor.id,
          seq: seq++,
          distance_m: Number((Math.hypot(at.e - anchor.e, at.n - anchor.n, at.u - anchor.u) + noise).toFixed(3)),
          rss_dbm: -84.3,
          fp_dbm: -86.1,
          rx_dbm: -82.7,
        });
      }
      if (rows.length) post('/api/v1/ranges', rows);
      while (fixSeq < ((now - start) / 1000) * k_fixes_per_s) post('/api/v1/fixes', [fix()]);
      if (now - start >= (second + 1) * 1000) everySecond(++second);
      if (now - start >= (minute + 1) * 60_000) everyMinute(++minute, counts);
      if (now >= end) {
        clearInterval(timer);
        done();
      }
    }, k_tick_ms);
  });
  return counts;
}

export async function soak(minutes, print = console.log) {
  const server = await startServer({ args: ['--rate-per-s', '100000', '--rate-burst', '100000'] });
  const streams = [];
  try {
    const made = await server.fetch('/api/v1/missions', {
      json: {
        name: 'soak',
        kit: 'soak',
        frame: 'wgs84',
        track_point: 'gnss_antenna',
        tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
      },
    });
    const mission = (await made.json()).id;
    for (let i = 0; i < k_streams; i++)
      streams.push(
        new Stream(server, [
          'ranges',
          'fixes',
          'anchors.estimates',
          'drone.pose',
          'mission.state',
          'events',
          'system',
          'devices',
        ]),
      );
    await Promise.all(streams.map((s) => s.open));
    let stalled = 0;
    const samples = [],
      first = memory(server.pid);
    const between = (from, to) => samples.filter((s) => s.minute > from && s.minute <= to);
    const median = (some) =>
        percentile(
          some.map((s) => s.rss),
          0.5,
        ),
      most = (some) => Math.max(...some.map((s) => s.rss));
    print(
      `minute   rows acknowledged   RSS MiB, median, most   descriptors  threads   CPU %   POST p50, p99 ms   streamed MiB   database MiB`,
    );
    let cpu = cpuSeconds(server.pid);
    const counts = await fly(
      server,
      mission,
      minutes,
      (second) => samples.push({ minute: second / 60, ...memory(server.pid) }),
      (minute, so) => {
        const now = memory(server.pid),
          used = cpuSeconds(server.pid),
          lately = between(minute - 1, minute);
        const streamed = streams.reduce((sum, s) => sum + s.received, 0) / 2 ** 20;
        print(
          `${String(minute).padStart(6)}   ${String(so.acknowledged).padStart(17)}   ` +
            `${median(lately).toFixed(1).padStart(15)}, ${most(lately).toFixed(1)}   ` +
            `${String(now.descriptors).padStart(17)}  ${String(now.threads).padStart(7)}   ` +
            `${(((used - cpu) / 60) * 100).toFixed(0).padStart(5)}   ${percentile(so.late, 0.5).toFixed(1)}, ` +
            `${percentile(so.late, 0.99).toFixed(1)}   ${streamed.toFixed(0).padStart(20)}   ` +
            `${(statSync(join(server.dataDir, 'anchord.db')).size / 2 ** 20).toFixed(1).padStart(12)}`,
        );
        if (Math.max(...so.late) > k_stalled_ms) ++stalled;
        cpu = used;
        so.late = [];
      },
    );
    const middle = between(minutes / 3, (2 * minutes) / 3),
      last = between((2 * minutes) / 3, minutes + 1);
    const floor = (some) =>
      percentile(
        some.map((s) => s.rss),
        0.1,
      );
    const growths = { floor: floor(last) - floor(middle), peak: most(last) - most(middle) },
      descriptors =
        Math.max(...last.map((s) => s.descriptors)) - Math.max(first.descriptors, ...middle.map((s) => s.descriptors));
    const gaps = streams.reduce((sum, s) => sum + s.gaps, 0),
      closed = streams.filter((s) => s.socket.readyState !== WebSocket.OPEN).length;
    const wrong = [];
    for (const [what, growth] of Object.entries(growths))
      if (growth > k_flat_mib)
        wrong.push(
          `the ${what} of resident memory grew by ${growth.toFixed(1)} MiB from the middle third to the last ` +
            `(limit ${k_flat_mib} MiB)`,
        );
    if (descriptors > k_flat_descriptors)
      wrong.push(`descriptors grew by ${descriptors} (limit ${k_flat_descriptors}, sockets apart)`);
    if (counts.failed > 0) wrong.push(`${counts.failed} rows were not acknowledged`);
    if (closed > 0) wrong.push(`${closed} of ${k_streams} streams were closed`);
    print(
      `RSS, middle third ${floor(middle).toFixed(1)} to ${most(middle).toFixed(1)}, last third ` +
        `${floor(last).toFixed(1)} to ${most(last).toFixed(1)} MiB, limit +${k_flat_mib}; ` +
        `${counts.acknowledged} rows acknowledged, ${gaps} gaps in ${k_streams} streams: ` +
        `${wrong.length ? 'NOT FLAT' : 'flat'}`,
    );
    for (const line of wrong) print(`    ${line}`);
    if (stalled > 0)
      print(
        `    in ${stalled} minutes a request waited longer than ${k_stalled_ms / 1000} s: the machine was too busy for this to prove anything; repeat it`,
      );
    return wrong.length === 0;
  } finally {
    for (const stream of streams) stream.socket.terminate();
    await server.dispose();
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const minutes = Number(process.argv[2] ?? 30);
  if (!(minutes >= 3)) {
    console.error(`soak: ${process.argv[2]} is not a number of minutes, at least 3`);
    process.exit(2);
  }
  process.exit((await soak(minutes)) ? 0 : 1);
}
