// Files that are small and want much: sent as plans, each is refused with what to do, the server stays small, and answers others meanwhile. What keeps the
// decoder busy without end is cut off by its processor time, which prlimit shortens here from outside (WorkerProcess.* has it by a limit of its own).
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readdirSync, readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { png_of } from './room.mjs';
import { eventually, startServer } from './server.mjs';

let server, path;
before(async () => {
  server = await startServer({ auth: 'off' });
  const made = async (where, json) => (await server.fetch(`/api/v1/${where}`, { method: 'POST', json })).json();
  const site = await made('sites', { name: 'Ghent', origin: { lon: 3.7, lat: 51, h_m: 50 } }),
    building = await made('buildings', { site: site.id, name: 'B1' }),
    floor = await made('floors', { building: building.id, name: 'Ground', level: 0 });
  path = `/api/v1/floors/${floor.id}`;
});
after(() => server?.dispose());

const big = (value, n) => {
  const out = Buffer.alloc(n);
  out.writeUIntBE(value, 0, n);
  return out;
};
/** ITU-T T.81: a progressive grey JPEG of 800 x 800 pixels, all zeros, in so many scans, each a pass over the picture for a few bytes. */
function jpeg_of_scans(scans) {
  const blocks = 100 * 100,
    segment = (marker, ...body) => {
      const bytes = Buffer.concat(body.map((b) => Buffer.from(b)));
      return Buffer.concat([Buffer.from([0xff, marker]), big(bytes.length + 2, 2), bytes]);
    },
    codes = (which, symbol) => segment(0xc4, [which, 1], Buffer.alloc(15), [symbol]),
    scan = Buffer.concat([segment(0xda, [1, 1, 0, 1, 63, 0]), Buffer.alloc(2)]);
  return Buffer.concat([
    Buffer.from([0xff, 0xd8]),
    segment(0xdb, [0], Buffer.alloc(64, 1)),
    segment(0xc2, [8], big(800, 2), big(800, 2), [1, 1, 0x11, 0]),
    codes(0x00, 0x00),
    codes(0x10, 0xe0),
    segment(0xda, [1, 1, 0, 0, 0, 0]),
    Buffer.alloc(blocks / 8),
    ...Array(scans).fill(scan),
    Buffer.from([0xff, 0xd9]),
  ]);
}
/** TIFF 6.0, uncompressed RGB in one strip of which nothing is there, with the tags of a GeoTIFF. */
function tiff(width, height) {
  const numbers = Buffer.alloc(9 * 8);
  [0.05, 0.05, 0, 0, 0, 0, 500_000, 5_600_000, 0].forEach((v, i) => numbers.writeDoubleLE(v, 8 * i));
  const keys = Buffer.from(new Uint16Array([1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 25831]).buffer),
    tags = [
      [256, 4, 1, width],
      [257, 4, 1, height],
      [258, 3, 1, 8],
      [259, 3, 1, 1],
      [262, 3, 1, 2],
      [273, 4, 1, 0x7fff_0000], // far behind the end
      [277, 3, 1, 3],
      [278, 4, 1, height],
      [279, 4, 1, 0xffff_fff0],
      [33550, 12, 3, 8],
      [33922, 12, 6, 32],
      [34735, 3, keys.length / 2, 80],
    ],
    directory = Buffer.alloc(2 + 12 * tags.length + 4);
  directory.writeUInt16LE(tags.length, 0);
  tags.forEach(([tag, type, count, value], i) => {
    directory.writeUInt16LE(tag, 2 + 12 * i);
    directory.writeUInt16LE(type, 4 + 12 * i);
    directory.writeUInt32LE(count, 6 + 12 * i);
    directory.writeUInt32LE(value, 10 + 12 * i);
  });
  const head = Buffer.from([0x49, 0x49, 42, 0, 0, 0, 0, 0]);
  head.writeUInt32LE(8 + numbers.length + keys.length, 4);
  return Buffer.concat([head, numbers, keys, directory]);
}
/** PDF 1.4: a page that draws a form ten times, which draws another ten times, and so on: 10^12 lines. */
function pdf_without_end() {
  const stream = (keys, text) => `<<${keys}/Length ${text.length}>>stream\n${text}\nendstream`,
    draws = (object) => `/Resources<</XObject<</F ${object} 0 R>>>>`,
    objects = [
      '<</Type/Catalog/Pages 2 0 R>>',
      '<</Type/Pages/Kids[3 0 R]/Count 1>>',
      `<</Type/Page/Parent 2 0 R/MediaBox[0 0 842 595]/Contents 4 0 R${draws(5)}>>`,
      stream('', '/F Do'),
    ];
  for (let level = 0; level < 12; level++)
    objects.push(
      stream(
        `/Type/XObject/Subtype/Form/BBox[0 0 842 595]${level < 11 ? draws(6 + level) : ''}`,
        (level < 11 ? '/F Do ' : '0 0 m 800 500 l S ').repeat(10),
      ),
    );
  let out = '%PDF-1.4\n',
    table = '0000000000 65535 f \n';
  objects.forEach((object, i) => {
    table += `${String(out.length).padStart(10, '0')} 00000 n \n`;
    out += `${i + 1} 0 obj\n${object}\nendobj\n`;
  });
  const n = objects.length + 1;
  return Buffer.from(`${out}xref\n0 ${n}\n${table}trailer<</Size ${n}/Root 1 0 R>>\nstartxref\n${out.length}\n%%EOF\n`);
}
/** A DXF whose block is inserted ten times in another, and so on: 10^12 lines. */
function dxf_without_end() {
  const insert = (name) => `0\nINSERT\n8\n0\n2\n${name}\n10\n0\n20\n0\n`,
    line = '0\nLINE\n8\n0\n10\n0\n20\n0\n11\n5\n21\n5\n';
  let blocks = '';
  for (let level = 0; level < 12; level++)
    blocks += `0\nBLOCK\n8\n0\n2\nB${level}\n70\n0\n10\n0\n20\n0\n${(level ? insert(`B${level - 1}`) : line).repeat(10)}0\nENDBLK\n`;
  return Buffer.from(
    `0\nSECTION\n2\nBLOCKS\n${blocks}0\nENDSEC\n0\nSECTION\n2\nENTITIES\n${insert('B11')}0\nENDSEC\n0\nEOF\n`,
  );
}

const status_of = (pid) => {
  try {
    return readFileSync(`/proc/${pid}/status`, 'utf8');
  } catch {
    return ''; // it is gone
  }
};
const field = (pid, name) => new RegExp(`^${name}:\\s+(\\S+)`, 'm').exec(status_of(pid))?.[1];
/** The server's workers, and the programs that these run. */
const descendants = () => {
  const all = readdirSync('/proc')
      .filter((name) => /^\d+$/.test(name))
      .map((pid) => ({ pid, parent: field(pid, 'PPid') })),
    of = (parent) => all.filter((p) => p.parent === String(parent)).flatMap((p) => [p.pid, ...of(p.pid)]);
  return of(server.pid);
};

/** Sends a plan while another asks for something small; what the server and its workers took meanwhile, and how long the other waited at most. */
async function sent(body, meanwhile = () => undefined) {
  const etag = (await server.fetch(path)).headers.get('etag'),
    before_kb = Number(field(server.pid, 'VmRSS'));
  let done = false,
    workers_kb = 0,
    server_kb = 0,
    waited_ms = 0;
  const others = (async () => {
    while (!done) {
      const at = performance.now(),
        answer = await server.fetch(path);
      await answer.json();
      assert.equal(answer.status, 200);
      waited_ms = Math.max(waited_ms, performance.now() - at);
      server_kb = Math.max(server_kb, Number(field(server.pid, 'VmRSS')) - before_kb);
      for (const pid of descendants()) workers_kb = Math.max(workers_kb, Number(field(pid, 'VmRSS') ?? 0));
      meanwhile();
      await new Promise((resolve) => setTimeout(resolve, 20)); // not more than fifty a second
    }
  })();
  const answer = await server.fetch(`${path}/plan`, {
    method: 'PUT',
    body,
    headers: { 'content-type': 'application/octet-stream', 'if-match': etag },
  });
  const problem = await answer.json();
  done = true;
  await others;
  return { status: answer.status, detail: problem.detail, workers_kb, server_kb, waited_ms };
}

const small = Buffer.alloc(1000);
for (const { what, file, status, says } of [
  { what: 'a PNG of 50 000 x 50 000', file: png_of(50_000, 50_000, small), status: 413, says: /scale it down/ },
  { what: 'a PNG that ends after its first rows', file: png_of(9000, 9000, small), status: 422, says: /save it again/ },
  { what: 'a JPEG of three thousand scans', file: jpeg_of_scans(3000), status: 422, says: /500 scans.*save it again/ },
  { what: 'a GeoTIFF that says 60 000 x 60 000', file: tiff(60_000, 60_000), status: 413, says: /scale it down/ },
  { what: 'a GeoTIFF without its pixels', file: tiff(9000, 9000), status: 422, says: /save it again/ },
  { what: 'a DXF that draws without end', file: dxf_without_end(), status: 422, says: /lines/ },
  {
    what: 'a DXF of nonsense',
    file: Buffer.from('0\nSECTION\n2\nENTITIES\n0\nLINE\n1x\n'),
    status: 422,
    says: /near its line/,
  },
])
  test(`${what} is refused with what to do, in little memory, while others are served`, async (t) => {
    const took = await sent(file);
    t.diagnostic(JSON.stringify(took));
    assert.equal(took.status, status, took.detail);
    assert.match(took.detail, says);
    assert.ok(took.server_kb < 200_000, `the server grew by ${took.server_kb} kB`);
    assert.ok(took.workers_kb < 2_000_000, `the worker took ${took.workers_kb} kB`);
    assert.ok(took.waited_ms < 5000, `another waited ${took.waited_ms} ms`);
  });

test('a PDF that draws without end is cut off by its processor time, and the next plan is taken', async (t) => {
  const shortened = new Set();
  const took = await sent(pdf_without_end(), () => {
    for (const pid of descendants())
      if (field(pid, 'Name') === 'pdftoppm' && !shortened.has(pid)) {
        shortened.add(pid);
        execFileSync('prlimit', ['--pid', pid, '--cpu=1:2']);
      }
  });
  t.diagnostic(JSON.stringify(took));
  assert.equal(took.status, 422, took.detail);
  assert.match(took.detail, /processor time.*export the page as PNG/);
  assert.equal(shortened.size, 1);
  assert.ok(took.server_kb < 200_000 && took.workers_kb < 2_000_000 && took.waited_ms < 5000, JSON.stringify(took));
  await eventually('no worker is left', () => descendants().length === 0);
  const good = await sent(png_of(4, 1, Buffer.from([0, 9, 9, 9, 9])));
  assert.equal(good.status, 201, good.detail);
});
