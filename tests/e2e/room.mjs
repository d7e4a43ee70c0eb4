// The plan of a room as a PNG, made byte by byte: 800 x 600 pixels, walls of 15 pixels round (100, 100) to (700, 500).
import { crc32, deflateSync } from 'node:zlib';

const chunk = (name, data) => {
  const body = Buffer.concat([Buffer.from(name), data]),
    head = Buffer.alloc(4),
    sum = Buffer.alloc(4);
  head.writeUInt32BE(data.length);
  sum.writeUInt32BE(crc32(body));
  return Buffer.concat([head, body, sum]);
};
export function room_png() {
  const rows = [];
  for (let y = 0; y < 600; y++) {
    const row = Buffer.alloc(801, 255);
    row[0] = 0; // no filter
    if (y >= 100 && y < 500)
      for (let x = 100; x < 700; x++) if (x < 115 || x >= 685 || y < 115 || y >= 485) row[1 + x] = 0;
    rows.push(row);
  }
  const head = Buffer.alloc(13);
  head.writeUInt32BE(800, 0);
  head.writeUInt32BE(600, 4);
  head.set([8, 0, 0, 0, 0], 8); // 8 bits of grey
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk('IHDR', head),
    chunk('IDAT', deflateSync(Buffer.concat(rows))),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}
