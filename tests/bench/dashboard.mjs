// ./dev bench dashboard: the real page in the real Chromium while 50 anchors answer at 100 ranges a second: frames a second, 95 % of frame times, long
// tasks, bytes a second of each topic, age of the data when it is in the page. Once as it is, once at a quarter of the CPU, once over a link of
// 1 Mbit/s and 300 ms (a network namespace of its own, shaped by tc; without that right Chromium's own emulation, and the table says so).
import { execFileSync, spawn } from 'node:child_process';
import { request } from 'node:http';
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { openBrowser, openPage } from '../e2e/browser.mjs';
import { eventually, startServer } from '../e2e/server.mjs';
import { percentile } from './load.mjs';

const k_anchors = 50,
  k_ranges_per_s = 100,
  k_fixes_per_s = 10,
  k_tick_ms = 50,
  k_warm_s = 45,
  k_measure_s = 20;
const k_feeder = '127.0.0.3'; // its packets are not those of the screen: they are not shaped
const k_lat = 51.0231,
  k_lon = 3.7131,
  k_m_per_deg = 111_250,
  k_m_per_deg_lon = 70_000;
const anchors = Array.from({ length: k_anchors }, (_, i) => ({
  id: `0x${(0x6b00 + i).toString(16)}`,
  e: (i % 10) * 4 + 2,
  n: Math.floor(i / 10) * 4 + 2,
  u: 2.5 + (i % 3),
}));
const tag_at = (s) => {
  const angle = (2 * Math.PI * s) / 40;
  return { e: 20 + 30 * Math.cos(angle), n: 10 + 20 * Math.sin(angle), u: 6 + 4 * Math.sin(angle / 3) };
};
const now_us = () => Math.round((performance.timeOrigin + performance.now()) * 1000);

function send(server, path, body, type = 'application/x-ndjson') {
  return new Promise((done, fail) => {
    const asked = request(
      {
        host: '127.0.0.1',
        port: server.port,
        path,
        method: 'POST',
        localAddress: k_feeder,
        headers: { 'content-type': type },
      },
      (answer) => {
        let text = '';
        answer.setEncoding('utf8').on('data', (part) => (text += part));
        answer.on('end', () => (answer.statusCode < 300 ? done(JSON.parse(text)) : fail(new Error(text))));
      },
    );
    asked.on('error', fail);
    asked.end(body);
  });
}

/** Flies round the hall in real time until stopped. */
function fly(server, mission) {
  const start = performance.now();
  let n_ranges = 0,
    n_fixes = 0;
  const lines = (rows) => rows.map((r) => JSON.stringify(r)).join('\n') + '\n';
  const timer = setInterval(() => {
    const s = (performance.now() - start) / 1000,
      at = tag_at(s),
      fixes = [],
      ranges = [];
    while (n_fixes < s * k_fixes_per_s)
      fixes.push({
        t_us: now_us(),
        mission,
        seq: n_fixes++,
        lon: k_lon + at.e / k_m_per_deg_lon,
        lat: k_lat + at.n / k_m_per_deg,
        h_m: 50 + at.u,
        fix: 'fixed',
        sigma_m: [0.01, 0.01, 0.02],
        q: [0, 0, 0, 1],
      });
    while (n_ranges < s * k_ranges_per_s) {
      const a = anchors[n_ranges % k_anchors],
        noise = 0.05 * Math.sin(n_ranges * 12.9898);
      ranges.push({
        t_us: now_us(),
        mission,
        tag: '0x6e01',
        anchor: a.id,
        seq: n_ranges++,
        distance_m: Number((Math.hypot(at.e - a.e, at.n - a.n, at.u - a.u) + noise).toFixed(3)),
        rss_dbm: -84.3,
      });
    }
    // A round that is refused is a round without data: the table tells.
    if (fixes.length) void send(server, '/api/v1/fixes', lines(fixes)).catch(() => undefined);
    if (ranges.length) void send(server, '/api/v1/ranges', lines(ranges)).catch(() => undefined);
  }, k_tick_ms);
  return () => clearInterval(timer);
}

/** Frame times and long tasks of the page for so long. */
const frames_of = (page, seconds) =>
  page.evaluate(
    (ms) =>
      new Promise((done) => {
        const times = [],
          tasks = [];
        const watch = new PerformanceObserver((list) => tasks.push(...list.getEntries().map((e) => e.duration)));
        watch.observe({ entryTypes: ['longtask'] });
        const begun = performance.now();
        let last = begun;
        const frame = (t) => {
          times.push(t - last);
          last = t;
          if (t - begun < ms) requestAnimationFrame(frame);
          else {
            watch.disconnect();
            done({ times: times.slice(1), tasks, passed_ms: t - begun });
          }
        };
        requestAnimationFrame(frame);
      }),
    seconds * 1000,
  );

async function measure(browser, server, name, { slowdown = 1, emulated = false }, row) {
  const { page, id } = await openPage(browser, server);
  const cdp = await page.context().newCDPSession(page);
  await cdp.send('Network.enable');
  if (emulated)
    await cdp.send('Network.emulateNetworkConditions', {
      offline: false,
      latency: 300,
      downloadThroughput: 125_000,
      uploadThroughput: 125_000,
    });
  const topics = new Map(),
    bytes = new Map(),
    ages = [];
  let counting = false;
  const asked = new Map();
  cdp.on('Network.webSocketFrameSent', ({ response }) => {
    const m = JSON.parse(response.payloadData);
    if (m.op === 'sub') asked.set(m.id, m.topic);
  });
  cdp.on('Network.webSocketFrameReceived', ({ response }) => {
    const text = response.payloadData,
      head = text.slice(0, 200),
      op = /"op":"(\w+)"/.exec(head)?.[1],
      sub = Number(/"sub":(\d+)/.exec(head)?.[1]);
    if (op === 'ack') topics.set(sub, asked.get(JSON.parse(text).id));
    if (!counting) return;
    const topic = topics.get(sub) ?? op;
    bytes.set(topic, (bytes.get(topic) ?? 0) + text.length);
    if (op === 'data' && topic === 'ranges') ages.push((now_us() - Number(/"t_us":(\d+)/.exec(head)[1])) / 1000);
  });
  await page.reload();
  await eventually(
    'ranges of the flight are shown',
    async () => (await id('range-list').locator('tbody tr').count()) >= 10,
    120_000,
    500,
  );
  await cdp.send('Emulation.setCPUThrottlingRate', { rate: slowdown });
  await new Promise((done) => setTimeout(done, 5000)); // what was opened is drawn
  counting = true;
  const { times, tasks, passed_ms } = await frames_of(page, k_measure_s);
  counting = false;
  const s = passed_ms / 1000,
    sorted = [...times].sort((a, b) => a - b),
    kb = (topic) => ((bytes.get(topic) ?? 0) / s / 1000).toFixed(1),
    total = [...bytes.values()].reduce((a, b) => a + b, 0) / s / 1000,
    limit = slowdown > 1 ? 'limit 30 fps' : emulated || name.includes('Mbit') ? '' : 'limit 60 fps, p95 20 ms';
  row(`${name}: frames`, `${(times.length / s).toFixed(0)} fps, p95 ${percentile(sorted, 0.95).toFixed(1)} ms`, limit);
  row(
    `${name}: tasks of 50 ms and more`,
    `${tasks.length} in ${s.toFixed(0)} s, longest ${Math.max(0, ...tasks).toFixed(0)} ms`,
    slowdown > 1 ? '' : 'limit none',
  );
  row(
    `${name}: stream`,
    `${total.toFixed(0)} kB/s, estimates ${kb('anchors.estimates')}, ranges ${kb('ranges')}`,
    'estimates: limit 30',
  );
  row(
    `${name}: age of ranges in the page`,
    ages.length
      ? `p50 ${percentile(ages, 0.5).toFixed(0)} ms, p95 ${percentile(ages, 0.95).toFixed(0)} ms`
      : 'none came',
    name.includes('Mbit') ? 'limit 2 s (LATE)' : 'limit p95 150 ms',
  );
  await page.close();
}

/** Whether this process may shape its loopback; done when it may. */
function shape(port) {
  const on = (...words) => execFileSync(words[0], words.slice(1), { stdio: 'ignore' });
  try {
    on('ip', 'link', 'set', 'lo', 'mtu', '1500', 'up');
    on(
      'tc',
      'qdisc',
      'add',
      'dev',
      'lo',
      'root',
      'handle',
      '1:',
      'prio',
      'bands',
      '2',
      'priomap',
      ...Array(16).fill('0'),
    );
    on(
      'tc',
      'qdisc',
      'add',
      'dev',
      'lo',
      'parent',
      '1:2',
      'handle',
      '20:',
      'tbf',
      'rate',
      '1mbit',
      'burst',
      '6kb',
      'latency',
      '300ms',
    );
    on('tc', 'qdisc', 'add', 'dev', 'lo', 'parent', '20:1', 'handle', '30:', 'netem', 'delay', '150ms', 'limit', '80');
    const filter = ['tc', 'filter', 'add', 'dev', 'lo', 'parent', '1:', 'protocol', 'ip'];
    for (const end of ['src', 'dst'])
      on(...filter, 'prio', '1', 'u32', 'match', 'ip', end, `${k_feeder}/32`, 'flowid', '1:1');
    for (const end of ['sport', 'dport'])
      on(...filter, 'prio', '2', 'u32', 'match', 'ip', end, String(port), '0xffff', 'flowid', '1:2');
    return true;
  } catch {
    return false;
  }
}

async function fly_and_measure(row, views, shaped) {
  const server = await startServer({ args: ['--rate-per-s', '100000', '--rate-burst', '100000'] });
  let stop = () => undefined,
    browser;
  try {
    const body = {
      name: 'fifty anchors',
      kit: 'bench',
      frame: 'wgs84',
      track_point: 'gnss_antenna',
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
    };
    const { id } = await send(server, '/api/v1/missions', JSON.stringify(body), 'application/json');
    stop = fly(server, id);
    await new Promise((done) => setTimeout(done, k_warm_s * 1000));
    const emulated = shaped && !shape(server.port);
    if (emulated) row('link of 1 Mbit/s', 'emulated by Chromium', 'tc cannot shape a network namespace here');
    browser = await openBrowser();
    for (const [name, how] of views) await measure(browser, server, name, { ...how, emulated }, row);
  } finally {
    stop();
    await browser?.close();
    await server.dispose();
  }
}

const own = fileURLToPath(import.meta.url);
/** The link's turn runs in a process of its own, whose network is nobody else's. */
function over_the_link(row) {
  const alone = ['-n', '-rn'].find((how) => {
    try {
      execFileSync('unshare', [how, 'ip', 'link', 'set', 'lo', 'up'], { stdio: 'ignore' });
      return true;
    } catch {
      return false;
    }
  });
  return new Promise((done, fail) => {
    const command = alone && existsSync('/usr/bin/unshare') ? ['unshare', alone, process.execPath] : [process.execPath];
    const child = spawn(command[0], [...command.slice(1), own, 'link'], { stdio: ['ignore', 'pipe', 'inherit'] });
    let out = '';
    child.stdout.setEncoding('utf8').on('data', (part) => (out += part));
    child.on('exit', (code) => {
      for (const line of out.split('\n').filter(Boolean)) row(...JSON.parse(line));
      if (code === 0) done();
      else fail(new Error(`the measurement over the link ended with ${code}`));
    });
  });
}

export async function dashboard(row) {
  await fly_and_measure(
    row,
    [
      ['dashboard', {}],
      ['dashboard, CPU / 4', { slowdown: 4 }],
    ],
    false,
  );
  await over_the_link(row);
}

if (process.argv[1] === own && process.argv[2] === 'link') {
  const row = (...cells) => console.log(JSON.stringify(cells));
  try {
    execFileSync('ip', ['link', 'set', 'lo', 'up'], { stdio: 'ignore' });
  } catch {
    // without a namespace of its own it is up
  }
  await fly_and_measure(row, [['dashboard, 1 Mbit/s and 300 ms', {}]], true);
  process.exit(0);
}
