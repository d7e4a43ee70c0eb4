// How long an aircraft in the air waits for the operator's word while others flood the server: plan checks of a viewer, generated
// waypoints of a second operator, long lists, idle sockets, guesses of tokens. Real server with its limits on, simulated aircraft.
import { connect } from 'node:net';
import { Worker } from 'node:worker_threads';
import { airborne, origin } from './airborne.mjs';
import { percentile } from './load.mjs';

const at = (east, north) => [origin.lon + east / 70_100, origin.lat + north / 111_250];
/** A star-shaped hall and many waypoints round it: a check of some tenths of a second. */
function plan(n) {
  const ring = Array.from({ length: 60 }, (_, i) =>
    at(15 + (10 + 3 * (i % 2)) * Math.cos((i * Math.PI) / 30), 10 + (7 + 2 * (i % 2)) * Math.sin((i * Math.PI) / 30)),
  );
  return {
    name: 'flood',
    building_height_m: 8,
    origin,
    outline: { type: 'Polygon', coordinates: [[...ring, ring[0]]] },
    settings: { keep_out_m: 2, max_height_m: 60 },
    waypoints: Array.from({ length: n }, (_, i) => {
      const [lon, lat] = at(15 + 22 * Math.cos((i * 2 * Math.PI) / n), 10 + 18 * Math.sin((i * 2 * Math.PI) / n));
      return { lon, lat, height_above_ground_m: 4 + (i % 40) };
    }),
  };
}
function histogram(times) {
  const edges = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000, Infinity];
  let from = 0;
  return edges
    .map((to) => {
      const n = times.filter((t) => t >= from && t < to).length;
      const line = n ? `${from}..${to} ms: ${n}` : '';
      from = to;
      return line;
    })
    .filter(Boolean)
    .join(', ');
}

export async function commands(row, seconds = 10) {
  const {
    server,
    mission,
    base,
    lease,
    tokens: { viewer, second },
    must,
    as,
    stop,
  } = await airborne();
  let flood;
  const sockets = [];
  try {
    const heavy = (await must('/api/v1/plans', as(plan(400)), 201)).id;
    const quiet = [],
      beside = [];
    const command = async (action, times) => {
      const start = performance.now();
      const answer = await server.fetch(`${base}/actions`, as({ action, lease }));
      await answer.text();
      times.push(performance.now() - start);
      if (answer.status !== 202 && answer.status !== 422) throw new Error(`${action}: ${answer.status}`);
    };
    const drive = async (times, s) => {
      for (let n = 0, end = performance.now() + s * 1000; performance.now() < end; n++) {
        await command(n % 2 ? 'resume' : 'hold', times);
        await new Promise((done) => setTimeout(done, 30));
      }
    };
    await drive(quiet, 3);

    flood = new Worker(new URL('./flood.mjs', import.meta.url), {
      workerData: {
        url: server.url,
        floods: [
          { n: 195, path: `/api/v1/plans/${heavy}/validate`, method: 'POST', token: viewer },
          {
            n: 6,
            path: '/api/v1/plans/generate',
            method: 'POST',
            token: second,
            json: { ...plan(2), settings: { keep_out_m: 2, max_height_m: 60 } },
          },
          { n: 8, path: `/api/v1/fixes?mission=${mission}&limit=10000`, token: viewer },
          { n: 4, path: '/api/v1/me', token: `anc_${'0'.repeat(32)}_${'a'.repeat(64)}` },
        ],
      },
    });
    for (let i = 0; i < 500; i++) sockets.push(connect(server.port, '127.0.0.1').on('error', () => {}));
    await new Promise((done) => setTimeout(done, 1000));
    await drive(beside, seconds);
    const landing = [];
    await command('land', landing);
    const { answered, refused } = await new Promise((done) => {
      flood.once('message', done);
      flood.postMessage('stop');
    });
    const p = (times, share) => `${percentile(times, share).toFixed(1)} ms`;
    row('hold and resume, nothing beside', `p50 ${p(quiet, 0.5)}, p99 ${p(quiet, 0.99)}`, histogram(quiet));
    row(
      'hold and resume beside the flood',
      `p50 ${p(beside, 0.5)}, p99 ${p(beside, 0.99)}, worst ${p(beside, 1)}`,
      `limit 100 ms at p99; ${histogram(beside)}`,
    );
    row(
      'land beside the flood',
      `${landing[0].toFixed(1)} ms`,
      `${answered} requests of the flood were answered, ${refused} refused; the generator shares the machine`,
    );
  } finally {
    await flood?.terminate();
    for (const socket of sockets) socket.destroy();
    await stop();
  }
}
