// Ranges with impulse responses through link, recorder, decoder, features, database, live flight and stream of the real server.
import { spawn } from 'node:child_process';
import { mkdtempSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { LiveClient } from '../e2e/live.mjs';
import { binary, startServer } from '../e2e/server.mjs';
import { cpuSeconds } from './load.mjs';

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/** Simulated devices of a scenario in a process of their own, so that their CPU is not the server's. */
async function simulate(folder, scenario) {
  const file = join(folder, 'scenario.json');
  writeFileSync(file, JSON.stringify({ schema: 'anchord.scenario/1', ...scenario }));
  const child = spawn(binary, ['simulate', file, '--json', '--links', folder], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const devices = [];
  const lines = createInterface({ input: child.stdout });
  await new Promise((done, fail) => {
    lines.on(
      'line',
      (line) => devices.push(JSON.parse(line)) === scenario.tags.length + scenario.rovers.length && done(),
    );
    child.once('exit', (code) => fail(new Error(`anchord simulate ended with ${code}`)));
  });
  return { devices, pid: child.pid, stop: () => child.kill('SIGTERM') };
}

const scenario_of = (tags) => ({
  name: 'bench',
  seed: 7,
  tags,
  rovers: [{ name: 'rover', format: 'ubx', port: 'tcp', rate_hz: 10 }],
  radio: { loss_chance: 0, zero_chance: 0, sensitivity_dbm: -130 },
});
const mission_of = (tags) => ({
  name: 'bench devices',
  kit: 'bench',
  frame: 'wgs84',
  track_point: 'gnss_antenna',
  tags: tags.map((tag) => ({ tag: tag.id, antenna: 0, lever_arm_body_m: [0.12, 0, -0.28] })),
});

/** Sets the simulated devices up at a server; their ids. */
async function plug_in(server, devices, options) {
  const made = [];
  for (const { kind, name, address } of devices) {
    const answer = await server.fetch('/api/v1/devices', {
      json: { kind, name, address, options: kind === 'pozyx' ? options : {} },
    });
    if (answer.status !== 201) throw new Error(`${name}: ${answer.status} ${await answer.text()}`);
    made.push((await answer.json()).id);
  }
  return made;
}

const of_range = (row) => `${row.t_us} ${row.tag} ${row.anchor}`;

/** Counts what comes by the live stream. */
async function listen(server) {
  const client = await LiveClient.open(server);
  const heard = { streamed: 0, told: new Set(), gaps: 0, left: 0, client },
    subs = [];
  client.socket.on('message', (data) => {
    const message = JSON.parse(String(data));
    if (message.op === 'gap') heard.gaps++;
    if (message.op !== 'data') return;
    const rows = [message.data].flat();
    if (message.sub === subs[0]) {
      heard.streamed += rows.length;
      for (const row of rows) heard.told.add(of_range(row));
    } else
      heard.left += rows.filter((event) => JSON.stringify(event).includes('dropped from the live estimates')).length;
  });
  for (const [i, topic] of ['ranges', 'events'].entries()) {
    client.send({ op: 'sub', id: i + 1, topic });
    subs.push((await client.next('ack', (m) => m.op === 'ack' && m.id === i + 1)).sub);
  }
  return heard;
}

/** Ranges a second, the server's share of a core meanwhile, and what was lost anywhere. */
async function fly(server, tags, options, seconds) {
  const folder = mkdtempSync(join(tmpdir(), 'anchord-bench-devices-'));
  const simulator = await simulate(folder, scenario_of(tags));
  let made = [];
  try {
    const mission = await (await server.fetch('/api/v1/missions', { json: mission_of(tags) })).json();
    made = await plug_in(server, simulator.devices, options);
    const heard = await listen(server);
    await wait(6000); // opened, discovered, settled
    const state = async () => {
      const devices = (await (await server.fetch('/api/v1/devices')).json()).items.filter((d) => d.counters);
      return {
        cpu: cpuSeconds(server.pid),
        simulator: cpuSeconds(simulator.pid),
        at: performance.now(),
        streamed: heard.streamed,
        ranges: devices.reduce((sum, d) => sum + d.counters.ranges, 0),
        dropped: devices.map((d) => d.dropped),
      };
    };
    const before = await state();
    await wait(seconds * 1000);
    const after = await state();
    const took = (after.at - before.at) / 1000,
      ranges = after.ranges - before.ranges;
    const metrics = await (await server.fetch('/metrics')).text();
    const lost = Number(/^anchord_device_rows_lost_total (\d+)/m.exec(metrics)?.[1] ?? 0);
    heard.client.terminate();
    return {
      perSecond: ranges / took,
      share: (after.cpu - before.cpu) / took,
      simulator: (after.simulator - before.simulator) / took,
      streamed: (after.streamed - before.streamed) / took,
      gaps: heard.gaps,
      lost,
      mission: mission.id,
    };
  } finally {
    for (const id of made)
      await server.fetch(`/api/v1/devices/${id}`, { method: 'DELETE', headers: { 'if-match': '*' } });
    simulator.stop();
    rmSync(folder, { recursive: true, force: true });
  }
}

/** The bytes of a flight of these tags at their links' own pace, recorded by a server of its own: {server, file, perSecond}. */
async function record(tags, options, seconds) {
  const folder = mkdtempSync(join(tmpdir(), 'anchord-bench-record-'));
  const simulator = await simulate(folder, scenario_of(tags));
  const server = await startServer();
  try {
    await plug_in(server, simulator.devices, options);
    await wait(6000);
    const mission = await (await server.fetch('/api/v1/missions', { json: mission_of(tags) })).json();
    await wait(seconds * 1000);
    await server.fetch(`/api/v1/missions/${mission.id}/actions`, { json: { action: 'finish' } });
    const recordings = join(server.dataDir, 'recordings'),
      file = join(recordings, readdirSync(recordings).sort()[0]);
    const [stored] = (await (await server.fetch('/api/v1/missions')).json()).items;
    return { server, file, ranges: stored.n_ranges, perSecond: stored.n_ranges / seconds };
  } finally {
    simulator.stop();
    rmSync(folder, { recursive: true, force: true });
  }
}

/** Plays recorded bytes through decoder, features, database, solver and stream, at a speed that gives this many ranges a second. */
async function play(recorded, tags, rate) {
  const server = await startServer();
  try {
    const target = await (await server.fetch('/api/v1/missions?devices=false', { json: mission_of(tags) })).json();
    const heard = await listen(server);
    const speed = (rate / recorded.perSecond).toFixed(3);
    const child = spawn(
      binary,
      ['replay', recorded.file, '--url', server.url, '--speed', speed, '--mission', target.id],
      { stdio: ['ignore', 'ignore', 'pipe'] },
    );
    let said = '',
      decoder = 0;
    child.stderr.setEncoding('utf8').on('data', (text) => (said += text));
    const before = cpuSeconds(server.pid),
      start = performance.now();
    const timer = setInterval(() => {
      try {
        decoder = cpuSeconds(child.pid);
      } catch {
        /* it has just ended */
      }
    }, 50);
    const code = await new Promise((done) => child.once('close', done));
    clearInterval(timer);
    const took = (performance.now() - start) / 1000,
      server_cpu = cpuSeconds(server.pid) - before;
    if (code !== 0) throw new Error(`replay ended with ${code}: ${said}`);
    const [accepted, known, refused] = /(\d+) rows accepted, (\d+) duplicates, (\d+) rejected/
      .exec(said)
      .slice(1)
      .map(Number);
    const finished = await server.fetch(`/api/v1/missions/${target.id}/actions`, { json: { action: 'finish' } }); // no range waits for a fix any more
    if (!finished.ok) throw new Error(`finish: ${finished.status} ${await finished.text()}`);
    const rows = (await (await server.fetch(`/api/v1/ranges?format=ndjson&mission=${target.id}`)).text())
      .trim()
      .split('\n')
      .map((line) => of_range(JSON.parse(line)));
    const untold = () => rows.filter((row) => !heard.told.has(row)).length;
    for (const end = performance.now() + 10_000; untold() > 0 && performance.now() < end;) await wait(50);
    heard.client.terminate();
    return {
      perSecond: rows.length / took,
      stored: rows.length,
      untold: untold(),
      accepted,
      known,
      refused,
      took,
      server: server_cpu / took,
      decoder: decoder / took,
      gaps: heard.gaps,
      left: heard.left,
    };
  } finally {
    await server.dispose();
  }
}

async function recorded_bytes(row, name, tags, options, seconds) {
  const recorded = await record(tags, options, seconds);
  try {
    const megabytes =
      readdirSync(join(recorded.server.dataDir, 'recordings')).reduce(
        (sum, part) => sum + statSync(join(recorded.server.dataDir, 'recordings', part)).size,
        0,
      ) / 1e6;
    await recorded.server.stop();
    const r = await play(recorded, tags, 1500);
    const whole =
      r.refused + r.known === 0 && r.stored >= recorded.ranges && r.untold === 0 && r.gaps === 0 && r.left === 0;
    row(
      name,
      `${r.perSecond.toFixed(0)} ranges/s, server ${percent(r.server)}, decoder ${percent(r.decoder)} (both at 1 ` +
        `000/s: ${percent(((r.server + r.decoder) * 1000) / r.perSecond)}); ${recorded.ranges} recorded, ${r.stored} ` +
        `stored, ${r.untold} of them not on the stream, ${r.refused} refused, ${r.gaps} gaps, ${r.left} dropped from the ` +
        'live estimates',
      `aim 1 000 ranges/s on 2 cores without a drop${whole ? '' : ': MISSED'}; ${megabytes.toFixed(0)} MB recorded ` +
        `at ${recorded.perSecond.toFixed(0)} ranges/s`,
    );
  } finally {
    await recorded.server.dispose();
  }
}

const percent = (share) => `${(100 * share).toFixed(1)} % of a core`;
const told = (r) =>
  `${r.perSecond.toFixed(0)} ranges/s with CIR, ${percent(r.share)}, ${r.lost} rows lost, ${r.streamed.toFixed(0)} streamed a second, ${r.gaps} gaps`;

const tags_of = (n, more = {}) =>
  Array.from({ length: n }, (_, i) => ({ name: `tag${i}`, id: `0x6e${(i + 16).toString(16)}`, ...more }));

export async function devices(server, row) {
  await recorded_bytes(
    row,
    'recorded bytes of 12 tags played at speed, CIR window',
    tags_of(12),
    { cir: 'window' },
    25,
  );
  await recorded_bytes(row, 'recorded bytes of 20 tags played at speed, whole CIR', tags_of(20), { cir: 'whole' }, 25);
  const one = await fly(server, [{ name: 'tag', id: '0x6e01' }], { cir: 'window' }, 10);
  row("one tag at its link's own pace", told(one), 'limit 10 % of a core');
  const many = await fly(server, tags_of(40, { range_s: 0.004, reply_s: 0.0005 }), { cir: 'window' }, 10);
  row(
    '40 tags as fast as they answer',
    told(many),
    `aim 1 000 ranges/s on 2 cores; the simulator itself took ${percent(many.simulator)}`,
  );
}
