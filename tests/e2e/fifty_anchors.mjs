// A tag flies round a hall of fifty anchors in real time, a hundred ranges and ten fixes a second, through REST.
import { request } from 'node:http';

const k_anchors = 50,
  k_ranges_per_s = 100,
  k_fixes_per_s = 10,
  k_tick_ms = 50;
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
export const now_us = () => Math.round((performance.timeOrigin + performance.now()) * 1000);

/** A POST from 127.0.0.3, so that a shaped link may tell the feeder's packets from those of a screen. */
function send(server, path, body, type = 'application/x-ndjson') {
  return new Promise((done, fail) => {
    const asked = request(
      {
        host: '127.0.0.1',
        port: server.port,
        path,
        method: 'POST',
        localAddress: feeder,
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
export const feeder = '127.0.0.3';
/** What such a server needs: the feeder asks often. */
export const feeder_args = ['--rate-per-s', '100000', '--rate-burst', '100000'];

/** Flies until stopped: {mission, stop}. */
export async function fly_fifty(server) {
  const body = {
    name: 'fifty anchors',
    kit: 'bench',
    frame: 'wgs84',
    track_point: 'gnss_antenna',
    tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0, 0, 0] }],
  };
  const { id: mission } = await send(server, '/api/v1/missions', JSON.stringify(body), 'application/json');
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
    // A round that is refused is a round without data: who measures sees it.
    if (fixes.length) void send(server, '/api/v1/fixes', lines(fixes)).catch(() => undefined);
    if (ranges.length) void send(server, '/api/v1/ranges', lines(ranges)).catch(() => undefined);
  }, k_tick_ms);
  return { mission, stop: () => clearInterval(timer) };
}

/** In a page, before it loads: notes how old the newest range of each frame is once the page has worked it in, [ms of the clock, ms]. */
export function watch_ages() {
  const ages = (globalThis.range_ages = []),
    Real = globalThis.WebSocket;
  globalThis.WebSocket = class extends Real {
    set onmessage(handle) {
      super.onmessage =
        handle &&
        ((event) => {
          handle(event);
          if (!event.data.includes('"rss_dbm"') || !event.data.startsWith('{"op":"data"')) return;
          const at = performance.timeOrigin + performance.now();
          ages.push([at, at - Number(event.data.slice(event.data.lastIndexOf('"t_us":') + 7).match(/^\d+/)[0]) / 1000]);
        });
    }
    get onmessage() {
      return super.onmessage;
    }
  };
}
