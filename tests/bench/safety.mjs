// How far apart two safety checks of a flight are while 500 anchors answer and a training run keeps every core busy.
import { LiveClient } from '../e2e/live.mjs';
import { airborne, flight_plan, origin } from './airborne.mjs';
import { start_search } from './search.mjs';

const k_anchors = 500,
  k_rate_hz = 2,
  k_limit_s = 0.25;

/** Where the anchors are: in and on the hall, east, north, up of the origin. */
const anchors = Array.from({ length: k_anchors }, (_, i) => ({
  anchor: `0x${(0x4000 + i).toString(16)}`,
  at: [(i % 25) * 1.2, (Math.floor(i / 25) % 20) * 1.0, 1 + (i % 7)],
}));

export async function safety(row, seconds = 90) {
  const first = { ...flight_plan.waypoints[0], dwell_s: 1 };
  const { server, mission, base, tokens, must, as, stop } = await airborne({
    ...flight_plan,
    settings: { ...flight_plan.settings, samples: 5 },
    waypoints: [first, { ...flight_plan.waypoints[1], turn: true }],
  });
  let timer, search, client;
  try {
    search = await start_search(server);
    client = await LiveClient.open(server);
    let place = null,
      sent = 0,
      refused = 0;
    const steps = new Set();
    client.socket.on('message', (data) => {
      const message = JSON.parse(String(data));
      for (const one of [message.data ?? []].flat()) {
        if (one.mission !== mission) continue;
        if (one.step) steps.add(one.step);
        if (one.lon !== undefined && one.h_m !== undefined)
          place = [(one.lon - origin.lon) * 70_100, (one.lat - origin.lat) * 111_250, one.h_m - origin.h_m];
      }
    });
    for (const [i, topic] of ['drone.pose', 'procedure'].entries()) client.send({ op: 'sub', id: i + 1, topic });
    let next = 0;
    const started = performance.now();
    timer = setInterval(() => {
      if (!place) return;
      const due = Math.floor(((performance.now() - started) / 1000) * k_anchors * k_rate_hz),
        rows = [];
      for (; sent < due; sent++) {
        const { anchor, at } = anchors[next++ % k_anchors];
        rows.push({
          t_us: Math.round((performance.timeOrigin + performance.now()) * 1000) - 300_000,
          tag: '0x6e01',
          anchor,
          distance_m: Math.hypot(...at.map((v, k) => v - place[k])) + 0.05 * (Math.random() - 0.5),
          rss_dbm: -80 - 6 * Math.random(),
          seq: sent,
          mission,
        });
      }
      if (rows.length)
        server
          .fetch('/api/v1/ranges', { token: tokens.kit, json: rows })
          .then(async (r) => {
            refused += r.status !== 200;
            await r.arrayBuffer();
          })
          .catch(() => refused++);
    }, 50);
    await new Promise((done) => setTimeout(done, seconds * 1000));
    const text = await (await server.fetch('/metrics')).text();
    const figure = (name) => Number(new RegExp(`^${name.replace(/[{}"+]/g, '\\$&')} (\\S+)`, 'm').exec(text)?.[1]);
    const n = figure('anchord_safety_interval_seconds_count'),
      worst = figure('anchord_safety_interval_seconds_worst');
    const within = figure('anchord_safety_interval_seconds_bucket{le="0.15"}');
    const trained = await search.state(),
      held = worst <= k_limit_s && n > 0 && trained === 'running' && refused === 0;
    row(
      `safety checks of a flight, ${k_anchors} anchors at ${k_rate_hz} Hz, beside a grid search`,
      `worst interval ${(worst * 1000).toFixed(0)} ms, ${n} checks in ${seconds} s, ${((100 * within) / n).toFixed(1)} % within 150 ms`,
      `limit ${k_limit_s * 1000} ms${held ? '' : ': MISSED'}; search ${trained}, ${sent} ranges sent, ` +
        `${refused} bodies refused, steps seen: ${[...steps].join(', ')}`,
    );
    // Control that nobody renewed ended meanwhile.
    const { lease } = await must(`${base}/control`, as({ action: 'take' }), 200);
    await must(`${base}/actions`, as({ action: 'land', lease }), 202);
  } finally {
    clearInterval(timer);
    client?.terminate();
    await search?.stop().catch(() => {});
    await stop();
  }
}
