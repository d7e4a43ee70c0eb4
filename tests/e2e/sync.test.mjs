// A field server's work goes to the centre: flights, what was solved and published of them, over a link that is cut; and where both published, a person decides.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { ndjson, simulatedFlight } from './flight.mjs';
import { LinkProxy } from './gateway.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord sync '));
let field, centre, proxy;
const flights = [];

async function ok(server, path, init) {
  const answer = await server.fetch(path, init);
  const text = await answer.text();
  assert.ok(answer.ok, `${path}: ${answer.status} ${text}`);
  return text ? JSON.parse(text) : null;
}
const rows = (list) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(list) });

/** A finished flight of a server, solved and published there. */
async function fly(server, seed, site) {
  const flight = await simulatedFlight({ seed, duration: 120 });
  const { id } = await ok(server, '/api/v1/missions?devices=false', { json: { ...flight.mission, site } });
  await ok(server, `/api/v1/fixes?mission=${id}`, rows(flight.fixes));
  await ok(server, `/api/v1/ranges?mission=${id}`, rows(flight.ranges));
  await ok(server, `/api/v1/missions/${id}/actions`, { json: { action: 'finish' } });
  const solved = await ok(server, '/api/v1/calibrations', { json: { missions: [id] }, headers: { prefer: 'wait=120' } });
  await ok(server, `/api/v1/calibrations/${solved.id}/publish`, { json: { note: `seed ${seed}` } });
  return { id, calibration: solved.id, n: flight.ranges.length };
}
const published = async (server) =>
  Object.fromEntries(
    (await ok(server, '/api/v1/anchors')).features
      .filter((f) => f.properties.provenance.calibration)
      .map((f) => [f.properties.network_id, { at: f.geometry, calibration: f.properties.provenance.calibration }]),
  );
const sync = (...args) =>
  run(['sync', '--to', proxy.url, '--token-file', join(folder, 'token'), '--data-dir', field.dataDir, ...args]);

before(async () => {
  field = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  centre = await startServer({ auth: 'on', args: ['--solve-after-landing', 'off'] });
  proxy = await new LinkProxy(centre.port).start();
  writeFileSync(join(folder, 'token'), centre.token + '\n');
  flights.push(await fly(field, 7));
});
after(async () => {
  proxy?.close();
  await field?.dispose();
  await centre?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('a dry run says what would go and sends nothing', async () => {
  const { code, stderr } = await sync('--dry-run');
  assert.equal(code, 0, stderr);
  assert.match(stderr, /flight "simulated 7": would send \d+\.\d MB/);
  assert.equal((await ok(centre, '/api/v1/missions')).items.length, 0);
});

test('over a link that is cut it stops, and goes on where it was; everything is there once, under its own id', async () => {
  proxy.bytesPerS = 40_000;
  const cut = sync('--wait', '2');
  await eventually('the flight is on its way', () => proxy.toServer > 20_000, 30_000);
  await proxy.cut();
  const stopped = await cut;
  assert.equal(stopped.code, 1, stopped.stderr);
  assert.match(stopped.stderr, /run it again to go on/);
  await proxy.restore();
  proxy.bytesPerS = 0;
  const { code, stdout, stderr } = await sync();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 1 sent, 0 there already/);
  const mission = await ok(centre, `/api/v1/missions/${flights[0].id}`);
  assert.equal(mission.n_ranges, flights[0].n);
  assert.deepEqual(await published(centre), await published(field));
});

test('again it finds everything there', async () => {
  const { code, stdout } = await sync();
  assert.equal(code, 0);
  assert.match(stdout, /flights: 0 sent, 1 there already/);
  assert.match(stdout, /anchors: 0 published/);
  assert.equal((await ok(centre, '/api/v1/revisions')).items.length, 1);
});

test('what moved on in the field moves on at the centre without a question', async () => {
  flights.push(await fly(field, 9));
  const { code, stdout, stderr } = await sync();
  assert.equal(code, 0, stdout + stderr);
  assert.match(stdout, /flights: 1 sent, 1 there already/);
  assert.deepEqual(await published(centre), await published(field));
});

test('where both published it lists the anchors and asks; theirs leaves the centre, ours changes it', async () => {
  const theirs = await fly(centre, 11);
  const ours = await fly(field, 13);
  const before = await published(centre);
  const asked = await sync();
  assert.equal(asked.code, 3, asked.stdout + asked.stderr);
  assert.match(asked.stdout, /CONFLICT no site\n +ours +revision 3, .*\n +theirs +revision 3, /);
  assert.match(asked.stdout, /0x6a22/);
  assert.deepEqual(await published(centre), before, 'nothing is decided by itself');
  assert.equal((await ok(centre, `/api/v1/missions/${ours.id}`)).n_ranges, ours.n, 'the flight went all the same');

  const left = await sync('--keep', 'theirs');
  assert.equal(left.code, 0, left.stdout + left.stderr);
  assert.deepEqual(await published(centre), before);
  assert.ok(Object.values(before).some((one) => one.calibration === theirs.calibration));

  const kept = await sync('--keep', 'ours');
  assert.equal(kept.code, 0, kept.stdout + kept.stderr);
  assert.deepEqual(await published(centre), await published(field));
  const again = await sync();
  assert.equal(again.code, 0, again.stdout);
  assert.match(again.stdout, /anchors: 0 published/);
});

test('what cannot go is refused with what to do', async () => {
  writeFileSync(join(folder, 'wrong'), 'anc_0123\n');
  const token = await run(['sync', '--to', proxy.url, '--token-file', join(folder, 'wrong'), '--data-dir', field.dataDir]);
  assert.equal(token.code, 2);
  assert.match(token.stderr, /401 .*--token-file/);
  const keep = await sync('--keep', 'mine');
  assert.equal(keep.code, 2);
  assert.match(keep.stderr, /ours, theirs, or SITE=ours/);
  const nobody = await run(['sync', '--to', proxy.url, '--token-file', join(folder, 'token'), '--data-dir', folder]);
  assert.equal(nobody.code, 1);
  assert.match(nobody.stderr, /no server runs in/);
});
