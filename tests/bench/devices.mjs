// Ranges with impulse responses through link, recorder, decoder, features, database, live flight and stream of the real server.
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { LiveClient } from '../e2e/live.mjs';
import { binary } from '../e2e/server.mjs';
import { cpuSeconds } from './load.mjs';

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/** Simulated devices of a scenario in a process of their own, so that their CPU is not the server's. */
async function simulate(folder, scenario) {
  const file = join(folder, 'scenario.json');
  writeFileSync(file, JSON.stringify({ schema: 'anchord.scenario/1', ...scenario }));
  const child = spawn(binary, ['simulate', file, '--json', '--links', folder], { stdio: ['ignore', 'pipe', 'inherit'] });
  const devices = [];
  const lines = createInterface({ input: child.stdout });
  await new Promise((done, fail) => {
    lines.on('line', (line) => devices.push(JSON.parse(line)) === scenario.tags.length + scenario.rovers.length && done());
    child.once('exit', (code) => fail(new Error(`anchord simulate ended with ${code}`)));
  });
  return { devices, pid: child.pid, stop: () => child.kill('SIGTERM') };
}

/** Ranges a second, the server's share of a core meanwhile, and what was lost anywhere. */
async function fly(server, tags, options, seconds) {
  const folder = mkdtempSync(join(tmpdir(), 'anchord-bench-devices-'));
  const simulator = await simulate(folder, {
    name: 'bench', seed: 7, tags, rovers: [{ name: 'rover', format: 'ubx', port: 'tcp', rate_hz: 10 }],
    radio: { loss_chance: 0, zero_chance: 0, sensitivity_dbm: -130 },
  });
  const made = [];
  try {
    const mission = await (await server.fetch('/api/v1/missions', { json: { name: 'bench devices', kit: 'bench', frame: 'wgs84', track_point: 'gnss_antenna', tags: tags.map((tag) => ({ tag: tag.id, antenna: 0, lever_arm_body_m: [0.12, 0, -0.28] })) } })).json();
    for (const { kind, name, address } of simulator.devices) {
      const answer = await server.fetch('/api/v1/devices', { json: { kind, name, address, options: kind === 'pozyx' ? options : {} } });
      if (answer.status !== 201) throw new Error(`${name}: ${answer.status} ${await answer.text()}`);
      made.push((await answer.json()).id);
    }
    const client = await LiveClient.open(server);
    let streamed = 0, gaps = 0;
    client.socket.on('message', (data) => {
      const message = JSON.parse(String(data));
      if (message.op === 'gap') gaps++;
      if (message.op === 'data') streamed += [message.data].flat().length;
    });
    client.send({ op: 'sub', id: 1, topic: 'ranges' });
    await wait(6000); // opened, discovered, settled
    const state = async () => {
      const devices = (await (await server.fetch('/api/v1/devices')).json()).items.filter((d) => d.counters);
      return { cpu: cpuSeconds(server.pid), simulator: cpuSeconds(simulator.pid), at: performance.now(), streamed,
        ranges: devices.reduce((sum, d) => sum + d.counters.ranges, 0), dropped: devices.map((d) => d.dropped) };
    };
    const before = await state();
    await wait(seconds * 1000);
    const after = await state();
    const took = (after.at - before.at) / 1000, ranges = after.ranges - before.ranges;
    const metrics = await (await server.fetch('/metrics')).text();
    const lost = Number(/^anchord_device_rows_lost_total (\d+)/m.exec(metrics)?.[1] ?? 0);
    client.terminate();
    return { perSecond: ranges / took, share: (after.cpu - before.cpu) / took, simulator: (after.simulator - before.simulator) / took,
      streamed: (after.streamed - before.streamed) / took, gaps, lost, mission: mission.id };
  } finally {
    for (const id of made) await server.fetch(`/api/v1/devices/${id}`, { method: 'DELETE', headers: { 'if-match': '*' } });
    simulator.stop();
    rmSync(folder, { recursive: true, force: true });
  }
}

const percent = (share) => `${(100 * share).toFixed(1)} % of a core`;
const told = (r) => `${r.perSecond.toFixed(0)} ranges/s with CIR, ${percent(r.share)}, ${r.lost} rows lost, ${r.streamed.toFixed(0)} streamed a second, ${r.gaps} gaps`;

export async function devices(server, row) {
  const one = await fly(server, [{ name: 'tag', id: '0x6e01' }], { cir: 'window' }, 10);
  row('one tag at its link\'s own pace', told(one), 'limit 10 % of a core');
  const many = await fly(server, Array.from({ length: 40 }, (_, i) => ({ name: `tag${i}`, id: `0x6e${(i + 16).toString(16)}`, range_s: 0.004, reply_s: 0.0005 })), { cir: 'window' }, 10);
  row('40 tags as fast as they answer', told(many), `aim 1 000 ranges/s on 2 cores; the simulator itself took ${percent(many.simulator)}`);
}
