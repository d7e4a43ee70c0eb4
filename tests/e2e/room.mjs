// Plans as PNGs, made byte by byte, and a floor that has one.
import assert from 'node:assert/strict';
import { crc32, deflateSync } from 'node:zlib';

const chunk = (name, data) => {
  const body = Buffer.concat([Buffer.from(name), data]),
    head = Buffer.alloc(4),
    sum = Buffer.alloc(4);
  head.writeUInt32BE(data.length);
  sum.writeUInt32BE(crc32(body));
  return Buffer.concat([head, body, sum]);
};
/** A PNG of 8 bits of grey whose head says so many pixels, and whose pixels are these bytes: a filter byte of 0 before each row. */
export function png_of(width, height, pixels) {
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 0, 0, 0, 0], 8);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk('IHDR', head),
    chunk('IDAT', deflateSync(pixels)),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}
/** White paper with ink where `ink(x, y)` says so. */
export function drawn_png(width, height, ink) {
  const pixels = Buffer.alloc((width + 1) * height, 255);
  for (let y = 0; y < height; y++) {
    const row = y * (width + 1);
    pixels[row] = 0; // no filter
    for (let x = 0; x < width; x++) if (ink(x, y)) pixels[row + 1 + x] = 0;
  }
  return png_of(width, height, pixels);
}
/** The plan of a room: 800 x 600 pixels, walls of 15 pixels round (100, 100) to (700, 500). */
export const room_png = () =>
  drawn_png(
    800,
    600,
    (x, y) => x >= 100 && x < 700 && y >= 100 && y < 500 && (x < 115 || x >= 685 || y < 115 || y >= 485),
  );

/** The floor, as the server has it, of a new site and building with this plan, placed by `points`: [pixel x, y, east m, north m]. */
export async function placed_floor(server, { origin, png, points }) {
  const send = async (method, path, options) => {
    const answer = await server.fetch(path, { method, ...options });
    assert.ok(answer.ok, `${method} ${path}: ${answer.status} ${await answer.clone().text()}`);
    return { json: await answer.json(), etag: answer.headers.get('etag') };
  };
  const made = (path, json) => send('POST', path, { json });
  const site = await made('/api/v1/sites', { name: 'Hall', origin }),
    building = await made('/api/v1/buildings', { site: site.json.id, name: 'B1', height_m: 8 }),
    floor = await made('/api/v1/floors', { building: building.json.id, name: 'Ground', level: 0 }),
    path = `/api/v1/floors/${floor.json.id}/plan`,
    sent = await send('PUT', path, { body: png, headers: { 'content-type': 'image/png', 'if-match': floor.etag } });
  const placed = await send('PUT', `${path}/georeference`, {
    json: { points: points.map(([x, y, e, n]) => ({ pixel: [x, y], enu_m: [e, n] })) },
    headers: { 'if-match': sent.etag },
  });
  return placed.json;
}
