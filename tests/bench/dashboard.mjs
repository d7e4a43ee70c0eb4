// ./dev bench dashboard: the real page in the real Chromium while 50 anchors answer at 100 ranges a second: frames a second, 95 % of frame times, long
// tasks, bytes a second of each topic, age of the data when it is in the page. Once as it is, once at a quarter of the CPU, once over a link of
// 1 Mbit/s and 300 ms (a network namespace of its own, shaped by tc; without that right a shaping proxy, and the table says so).
import { execFileSync, spawn } from 'node:child_process';
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { openBrowser, openPage } from '../e2e/browser.mjs';
import { feeder, feeder_args, fly_fifty, watch_ages } from '../e2e/fifty_anchors.mjs';
import { eventually, startServer } from '../e2e/server.mjs';
import { slowLink } from '../e2e/slow_link.mjs';
import { percentile } from './load.mjs';

const k_warm_s = 45,
  k_measure_s = 20;

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

async function measure(browser, server, name, { slowdown = 1 }, row) {
  const { page, id } = await openPage(browser, server);
  const cdp = await page.context().newCDPSession(page);
  await cdp.send('Network.enable');
  const topics = new Map(),
    bytes = new Map();
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
  await page.evaluate(() => (globalThis.range_ages.length = 0));
  counting = true;
  const { times, tasks, passed_ms } = await frames_of(page, k_measure_s);
  counting = false;
  const ages = (await page.evaluate(() => globalThis.range_ages)).map(([, age_ms]) => age_ms).sort((a, b) => a - b);
  const s = passed_ms / 1000,
    sorted = [...times].sort((a, b) => a - b),
    kb = (topic) => ((bytes.get(topic) ?? 0) / s / 1000).toFixed(1),
    total = [...bytes.values()].reduce((a, b) => a + b, 0) / s / 1000,
    limit = slowdown > 1 ? 'limit 30 fps' : name.includes('Mbit') ? '' : 'limit 60 fps, p95 20 ms';
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
      on(...filter, 'prio', '1', 'u32', 'match', 'ip', end, `${feeder}/32`, 'flowid', '1:1');
    for (const end of ['sport', 'dport'])
      on(...filter, 'prio', '2', 'u32', 'match', 'ip', end, String(port), '0xffff', 'flowid', '1:2');
    return true;
  } catch {
    return false;
  }
}

async function fly_and_measure(row, views, shaped) {
  const server = await startServer({ args: feeder_args });
  let stop = () => undefined,
    browser,
    link;
  try {
    ({ stop } = await fly_fifty(server));
    await new Promise((done) => setTimeout(done, k_warm_s * 1000));
    link = shaped && !shape(server.port) ? await slowLink(server.port) : null;
    if (link) row('link of 1 Mbit/s', 'a proxy', 'tc cannot shape a network namespace here');
    const screen = link ? { url: `http://127.0.0.1:${link.port}` } : server;
    browser = await openBrowser({ reducedMotion: 'no-preference' });
    await browser.context.addInitScript(watch_ages);
    for (const [name, how] of views) await measure(browser, screen, name, how, row);
  } finally {
    stop();
    await browser?.close();
    await link?.close();
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
