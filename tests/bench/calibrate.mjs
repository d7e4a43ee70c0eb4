// A flight of a million ranges is calibrated: seconds, processor time, the peak of resident memory above the server's own, and what is kept of it.
//   node tests/bench/calibrate.mjs [RANGES]        ANCHORD_BINARY names the server
// Fails where memory rises by more than `most_mib`, or an anchor is further than 0.1 m from where it was put.
import { startServer } from '../e2e/server.mjs';
import { cpu_s, forget_peak, mib } from './process.mjs';

const n_ranges = Number(process.argv[2] ?? 1_000_000),
  most_mib = 300,
  furthest_m = 0.1,
  n_anchors = 8,
  period_us = 10_000, // 100 ranges a second
  start_us = 1_777_889_472_000_000,
  lat = 51,
  lon = 3.7,
  m_per_deg = 111_267, // at 51 degrees north: WGS84's meridian radius 6 375 142 m
  m_per_deg_lon = 70_198; // and its parallel
const anchors = Array.from({ length: n_anchors }, (_, i) => ({
  id: `0x${(0x6a21 + i).toString(16)}`,
  e: 15 * Math.cos(i),
  n: 10 * Math.sin(i),
  u: 2 + (i % 3),
}));
const tag_at = (s) => ({
  e: 25 * Math.cos(s / 12),
  n: 20 * Math.sin(s / 12),
  u: 6 + 4 * Math.sin(s / 31),
});

const server = await startServer({ auth: 'off', args: ['--rate-per-s', '100000', '--rate-burst', '100000'] });
async function send(path, body, type = 'application/x-ndjson') {
  const answer = await server.fetch(path, { method: 'POST', headers: { 'content-type': type }, body });
  if (!answer.ok) throw new Error(`${path}: ${answer.status} ${(await answer.text()).slice(0, 300)}`);
  return answer.json();
}
const get = async (path) => (await server.fetch(path)).json();
async function upload(path, n, row) {
  let text = '';
  for (let i = 0; i < n; i++) {
    text += JSON.stringify(row(i)) + '\n';
    if (text.length > 16e6 || i === n - 1) {
      const { rejected } = await send(path, text);
      if (rejected) throw new Error(`${path}: ${rejected} rows rejected`);
      text = '';
    }
  }
}

let wrong = 0;
try {
  const { id: mission } = await send(
    '/api/v1/missions?devices=false',
    JSON.stringify({
      name: 'long flight',
      kit: 'bench',
      frame: 'wgs84',
      track_point: 'tag_antenna',
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
    }),
    'application/json',
  );
  await send(`/api/v1/missions/${mission}/actions`, JSON.stringify({ action: 'finish' }), 'application/json');
  const duration_s = (n_ranges * period_us) / 1e6;
  await upload('/api/v1/fixes', Math.ceil(duration_s * 5) + 2, (i) => {
    const at = tag_at(i / 5);
    return {
      t_us: start_us + i * 200_000,
      mission,
      seq: i,
      lon: lon + at.e / m_per_deg_lon,
      lat: lat + at.n / m_per_deg,
      h_m: 50 + at.u,
      fix: 'fixed',
      sigma_m: [0.01, 0.01, 0.02],
    };
  });
  await upload('/api/v1/ranges', n_ranges, (i) => {
    const a = anchors[i % n_anchors],
      at = tag_at((i * period_us) / 1e6),
      noise_m = 0.08 * Math.sin(i * 12.9898);
    return {
      t_us: start_us + i * period_us,
      mission,
      tag: '0x6e01',
      anchor: a.id,
      seq: i,
      distance_m: Number((Math.hypot(at.e - a.e, at.n - a.n, at.u - a.u) + noise_m).toFixed(3)),
      rss_dbm: -80.5,
    };
  });
  const before = mib(server.pid, 'VmRSS'),
    cpu = cpu_s(server.pid),
    begun = performance.now();
  forget_peak(server.pid);
  const job = await send('/api/v1/calibrations', JSON.stringify({ missions: [mission] }), 'application/json');
  let state;
  do {
    await new Promise((done) => setTimeout(done, 200));
    state = (await get(`/api/v1/jobs/${job.id}`)).state;
  } while (state === 'queued' || state === 'running');
  const s = (performance.now() - begun) / 1000,
    peak = mib(server.pid, 'VmHWM') - before;
  const { items } = await get('/api/v1/calibrations'),
    found = items.length ? (await get(`/api/v1/calibrations/${items[0].id}`)).anchors : [];
  await new Promise((done) => setTimeout(done, 5000));
  console.log('| ranges | anchors | s | CPU s | us a range | memory rises by | kept 5 s later |');
  console.log('| --- | --- | --- | --- | --- | --- | --- |');
  const used = cpu_s(server.pid) - cpu;
  console.log(
    `| ${[n_ranges, found.length, s.toFixed(1), used.toFixed(1), ((used * 1e6) / n_ranges).toFixed(1)].join(' | ')} | ` +
      `${peak.toFixed(0)} MiB | ${(mib(server.pid, 'VmRSS') - before).toFixed(0)} MiB |`,
  );
  if (peak > most_mib) {
    wrong++;
    console.error(`memory rises by ${peak.toFixed(0)} MiB (limit ${most_mib})`);
  }
  for (const a of anchors) {
    const at = found.find((x) => x.network_id === a.id)?.geometry.coordinates,
      off_m = at && Math.hypot((at[0] - lon) * m_per_deg_lon - a.e, (at[1] - lat) * m_per_deg - a.n, at[2] - 50 - a.u);
    if (!(off_m < furthest_m)) {
      wrong++;
      console.error(`${a.id}: ${off_m === undefined ? 'not found' : `${off_m.toFixed(3)} m off`}`);
    }
  }
} finally {
  await server.dispose();
}
process.exit(wrong ? 1 : 0);
