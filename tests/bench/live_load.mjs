// Missions of a bench, rows for them, and ranges that come at 100 a second while clients listen.
import { LiveClient } from '../e2e/live.mjs';
import { eventually } from '../e2e/server.mjs';
import { cpuSeconds, percentile } from './load.mjs';

const mission = (name) => ({
  name,
  kit: 'bench',
  frame: 'wgs84',
  track_point: 'gnss_antenna',
  tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
});

export async function newMission(server, name) {
  const answer = await server.fetch('/api/v1/missions', { json: mission(name) });
  const text = await answer.text();
  if (answer.status !== 201) throw new Error(`POST missions: ${answer.status} ${text}`);
  return JSON.parse(text).id;
}

let sequence = 0;
export function ndjson(count, mission, cir) {
  let body = '';
  for (let i = 0; i < count; i++) {
    const seq = sequence++;
    body +=
      `{"t_us":${1777889472000000 + seq * 100},"tag":"0x6e01","anchor":"0x6a2${seq % 6}",` +
      `"distance_m":${(5 + (seq % 1000) / 100).toFixed(3)},"rss_dbm":-84.3,"fp_dbm":-86.1,"rx_dbm":-82.7,` +
      `"seq":${seq},"mission":"${mission}"${cir}}\n`;
  }
  return body;
}

/** 100 ranges a second, 5 s long, to `count` clients: how late each delivery came, in ms. */
export async function liveLatency(server, name, count) {
  const id = await newMission(server, name);
  const clients = [],
    late = [];
  let gaps = 0;
  for (let i = 0; i < count; i++) {
    const client = await LiveClient.open(server);
    client.socket.on('message', (data) => {
      const now = (performance.timeOrigin + performance.now()) * 1000;
      const message = JSON.parse(String(data));
      if (message.op === 'gap') gaps++;
      if (message.op === 'data')
        for (const range of [message.data].flat()) if (range.mission === id) late.push((now - range.t_us) / 1000);
    });
    client.send({ op: 'sub', id: 1, topic: 'ranges' });
    await client.next('ack', (m) => m.op === 'ack');
    clients.push(client);
  }
  // 100 ranges a second, each stamped when it is sent; a fix every 50 ms, since a range waits for the fix after it.
  const seconds = 5,
    cpu = cpuSeconds(server.pid),
    start = performance.now();
  const nowUs = () => Math.round((performance.timeOrigin + performance.now()) * 1000);
  let sent = 0,
    seq = 0;
  const post = (path, json) => server.fetch(path, { json }).then((r) => r.arrayBuffer());
  const pending = [];
  const fix = (seq) =>
    post('/api/v1/fixes', {
      t_us: nowUs(),
      mission: id,
      lon: 3.7131,
      lat: 51.0231,
      h_m: 60,
      fix: 'fixed',
      sigma_m: [0.01, 0.01, 0.02],
      q: [0, 0, 0, 1],
      seq,
    });
  await fix(1_000_000); // ranges from before the first fix would wait for a track that never covers them
  await new Promise((done) => {
    const timer = setInterval(() => {
      const due = Math.floor(((performance.now() - start) / 1000) * 100);
      const batch = [];
      while (sent < due && sent < seconds * 100)
        batch.push({
          t_us: nowUs(),
          tag: '0x6e01',
          anchor: `0x6a2${sent % 6}`,
          distance_m: 7 + (sent % 10) / 10,
          seq: sent++,
          mission: id,
        });
      if (batch.length) pending.push(post('/api/v1/ranges', batch));
      if (++seq % 5 === 0) pending.push(fix(seq));
      if (sent >= seconds * 100) {
        clearInterval(timer);
        done();
      }
    }, 10);
  });
  await Promise.all(pending);
  await fix(seq + 1);
  const want = sent * clients.length;
  await eventually('every delivery', () => late.length >= want * 0.99, 5000).catch(() => {});
  const share = (cpuSeconds(server.pid) - cpu) / ((performance.now() - start) / 1000);
  for (const client of clients) client.terminate();
  return { late, want, gaps, share, p50: percentile(late, 0.5) ?? NaN, p99: percentile(late, 0.99) ?? NaN };
}
