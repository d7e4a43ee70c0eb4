// A short simulated flight as REST bodies, for tests that need measurements.
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { run } from './server.mjs';

/** Of the simulated hall, 30 by 20 m: what plans of it are made from. */
export const hall_outline = {
  type: 'Polygon',
  coordinates: [
    [
      [3.7131, 51.0231],
      [3.7135275, 51.0231],
      [3.7135275, 51.0232799],
      [3.7131, 51.0232799],
      [3.7131, 51.0231],
    ],
  ],
};

/** {mission, fixes, ranges, truth}: bodies of POST missions, fixes and ranges; truth by network id. */
export async function simulatedFlight({ seed = 7, duration = 120 } = {}) {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  try {
    const { code, stderr } = await run([
      'simulate',
      'flight',
      '--seed',
      String(seed),
      '--duration',
      String(duration),
      '--out',
      folder,
    ]);
    if (code !== 0) throw new Error(stderr);
    const table = (name) => {
      const [header, ...lines] = readFileSync(join(folder, name), 'utf8')
        .trim()
        .split('\n')
        .map((line) => line.split(','));
      return lines.map((line) => Object.fromEntries(header.map((key, i) => [key, line[i]])));
    };
    const declared = JSON.parse(readFileSync(join(folder, 'flight.json'), 'utf8'));
    const start = Date.parse(declared.epoch_utc) * 1000;
    const t_us = (row) => start + Math.round(Number(row.t_s) * 1e6);
    return {
      mission: {
        name: `simulated ${seed}`,
        kit: declared.kit,
        frame: 'wgs84',
        track_point: 'gnss_antenna',
        tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: declared.tags[0].lever_arm_body_m }],
      },
      fixes: table('track.csv').map((row, seq) => ({
        t_us: t_us(row),
        seq,
        lon: Number(row.lon_deg),
        lat: Number(row.lat_deg),
        h_m: Number(row.alt_m),
        fix: row.fix,
        sigma_m: [Number(row.sd_h_m), Number(row.sd_h_m), Number(row.sd_v_m)],
        q: ['qx', 'qy', 'qz', 'qw'].map((k) => Number(row[k])),
      })),
      ranges: table('ranges.csv').map((row) => ({
        t_us: t_us(row),
        seq: Number(row.seq),
        tag: '0x6e01',
        anchor: row.anchor_id,
        distance_m: Number(row.range_m),
        rss_dbm: Number(row.rss_dbm),
      })),
      truth: Object.fromEntries(
        table('anchors_truth.csv').map((row) => [
          row.anchor_id,
          { lon: Number(row.lon_deg), lat: Number(row.lat_deg), h_m: Number(row.alt_m) },
        ]),
      ),
    };
  } finally {
    rmSync(folder, { recursive: true });
  }
}

export const ndjson = (rows) => rows.map((row) => JSON.stringify(row)).join('\n') + '\n';

/** Horizontal metres between two points a few hundred metres apart at most. */
export function metresBetween(a, b) {
  const north = (a.lat - b.lat) * 111_320,
    east = (a.lon - b.lon) * 111_320 * Math.cos((a.lat * Math.PI) / 180);
  return Math.hypot(north, east);
}
