// Flights from folders: into a running server, into a data folder, and played as if live.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { run, startServer } from './server.mjs';

let folder;
let flight;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  flight = join(folder, 'a flight');
  const made = await run(['simulate', 'flight', '--seed', '3', '--duration', '20', '--out', flight]);
  assert.equal(made.code, 0, made.stderr);
});
after(() => rmSync(folder, { recursive: true, force: true }));

const json = async (server, path) => (await server.fetch(path)).json();

test('a flight is imported through a running server as a finished mission', async () => {
  const server = await startServer({ auth: 'off' });
  try {
    const { code, stdout, stderr } = await run(['import', 'flight', flight, '--url', server.url]);
    assert.equal(code, 0, stderr);
    const mission = await json(server, `/api/v1/missions/${stdout.trim()}`);
    assert.equal(mission.state, 'finished');
    assert.ok(mission.n_ranges > 200, JSON.stringify(mission));
    assert.equal(mission.n_fixes, 201);
    assert.match(stderr, new RegExp(`${mission.n_ranges + mission.n_fixes} rows accepted, 0 duplicates`));
  } finally {
    await server.dispose();
  }
});

test('a flight is imported into the data folder of a server that is not running', async () => {
  const dataDir = join(folder, 'data');
  const { code, stdout, stderr } = await run(['import', 'flight', flight, '--data-dir', dataDir, '--name', 'by hand']);
  assert.equal(code, 0, stderr);
  const server = await startServer({ auth: 'off', dataDir });
  try {
    const mission = await json(server, `/api/v1/missions/${stdout.trim()}`);
    assert.equal(mission.name, 'by hand');
    assert.equal(mission.n_fixes, 201);
    const busy = await run(['import', 'flight', flight, '--data-dir', dataDir]);
    assert.equal(busy.code, 1);
    assert.match(busy.stderr, /in use by another anchord/);
  } finally {
    await server.dispose();
  }
});

test('a replay is a fresh mission that happens now', async () => {
  const server = await startServer({ auth: 'off' });
  try {
    const begin = Date.now();
    for (let i = 0; i < 2; ++i) {
      const { code, stderr } = await run(['replay', flight, '--url', server.url, '--speed', i === 0 ? 'max' : '20']);
      assert.equal(code, 0, stderr);
    }
    const { items } = await json(server, '/api/v1/missions');
    assert.equal(items.length, 2);
    assert.deepEqual(
      items.map((mission) => mission.state),
      ['finished', 'finished'],
    );
    assert.equal(items[0].n_ranges, items[1].n_ranges);
    const fixes = (await json(server, `/api/v1/fixes?mission=${items[0].id}&limit=1000`)).items;
    const newest = Math.max(...fixes.map((fix) => fix.t_us)) / 1000;
    assert.ok(newest >= begin && newest <= Date.now(), `${newest} is not between ${begin} and now`);

    const again = await run(['replay', items[0].id, '--url', server.url, '--speed', 'max', '--name', 'stored']);
    assert.equal(again.code, 0, again.stderr);
    const third = (await json(server, '/api/v1/missions')).items[0];
    assert.deepEqual([third.name, third.n_ranges, third.n_fixes], ['stored', items[0].n_ranges, items[0].n_fixes]);
    assert.deepEqual(third.tags, items[0].tags);
  } finally {
    await server.dispose();
  }
});

test('a replay of a stored mission brings its impulse responses along', async () => {
  const server = await startServer({ auth: 'off' });
  const post = async (path, body) => {
    const answer = await server.fetch(path, {
      method: 'POST',
      headers: { 'content-type': 'application/json' },
      body: JSON.stringify(body),
    });
    assert.ok(answer.ok, await answer.clone().text());
    return answer.json();
  };
  try {
    const { id } = await post('/api/v1/missions', {
      name: 'with CIR',
      frame: 'wgs84',
      track_point: 'gnss_antenna',
      tags: [],
    });
    const samples = Buffer.alloc(1016 * 4);
    for (let i = 0; i < samples.length; ++i) samples[i] = (i * 37) % 251;
    const cir = { n: 1016, dt_ps: 1001.6, first_path_idx: 742.5, rxpacc: 118, b64: samples.toString('base64') };
    const row = { mission: id, tag: '0x6e01', anchor: '0x6a01', distance_m: 12.5 };
    await post(
      '/api/v1/ranges',
      [1, 2, 3].map((i) => ({ ...row, t_us: 1_700_000_000_000_000 + i, seq: i, ...(i === 2 ? { cir } : {}) })),
    );

    const replayed = await run(['replay', id, '--url', server.url, '--speed', 'max', '--name', 'again']);
    assert.equal(replayed.code, 0, replayed.stderr);
    const again = (await json(server, '/api/v1/missions')).items.find((mission) => mission.name === 'again');
    const { items } = await json(server, `/api/v1/ranges?mission=${again.id}&cir=true&sort=t_us`);
    assert.deepEqual(
      items.map((range) => range.cir),
      [undefined, cir, undefined],
    );
  } finally {
    await server.dispose();
  }
});

test('what cannot be read ends with 2 and names the file', async () => {
  writeFileSync(join(folder, 'flight.json'), '{');
  for (const command of [['import', 'flight'], ['replay']]) {
    for (const bad of [join(folder, 'nowhere'), folder]) {
      const { code, stdout, stderr } = await run([...command, bad, '--url', 'http://127.0.0.1:1']);
      assert.equal(code, 2, stderr);
      assert.equal(stdout, '');
      assert.ok(stderr.includes(bad), stderr);
    }
  }
  const speed = await run(['replay', flight, '--speed', '-1']);
  assert.equal(speed.code, 2);
});
