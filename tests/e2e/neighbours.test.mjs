// What other people's programs read of a running server, each by the program itself (docs/integration.md has the table).
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { ndjson, simulatedFlight } from './flight.mjs';
import { apart, gdal, layer } from './gdal.mjs';
import { startServer } from './server.mjs';

let server, mission, published;
const get = async (path) => (await server.fetch(path)).json();
const post = async (path, json, headers) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};

before(async () => {
  server = await startServer({ auth: 'on' });
  const flight = await simulatedFlight({ duration: 120 });
  const rows = (list) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(list) });
  mission = (await post('/api/v1/missions', flight.mission)).id;
  for (const what of ['fixes', 'ranges'])
    assert.equal((await server.fetch(`/api/v1/${what}?mission=${mission}`, rows(flight[what]))).status, 200);
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const solved = await post('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' });
  await post(`/api/v1/calibrations/${solved.id}/publish`, {});
  published = (await get('/api/v1/exports/anchors.geojson')).features;
  assert.ok(published.length >= 3, `${published.length} anchors`);
});
after(() => server?.dispose());

/** Options of GDAL's OAPIF driver; the token is the password, as a GIS client sends it. */
const oapif = (...more) => ['-oo', `USERPWD=qgis:${server.token}`, ...more.flatMap((one) => ['-oo', one])];

test('GDAL reads the anchors by OGC API Features: all, in pages of two, 3-D', async () => {
  const read = await layer(`OAPIF:${server.url}/ogc`, 'anchors', ...oapif('PAGE_SIZE=2'));
  assert.equal(read.count, published.length);
  assert.equal(read.geometry, '3D Point');
  assert.equal(read.features.length, published.length);
  for (const anchor of published) {
    const same = read.features.find((one) => one.properties.network_id === anchor.properties.network_id);
    assert.ok(apart(same, anchor) <= 1e-9, `${anchor.properties.network_id}: ${apart(same, anchor)}`);
    assert.equal(same.properties.h95_m, anchor.properties.accuracy.relative.h95_m);
  }
});

test('GDAL asks for a box and gets what is in it', async () => {
  const [lon, lat] = published[0].geometry.coordinates,
    d = 1e-7;
  const listed = await gdal(
    'ogrinfo',
    '-ro',
    '-al',
    ...oapif(),
    '-spat',
    ...[lon - d, lat - d, lon + d, lat + d].map(String),
    `OAPIF:${server.url}/ogc`,
    'anchors',
  );
  assert.deepEqual(
    [...listed.matchAll(/network_id \(String\) = (\S+)/g)].map((m) => m[1]),
    [published[0].properties.network_id],
  );
});

test('GDAL reads positions by revision and the flight as a 3-D line', async () => {
  const revisions = await layer(`OAPIF:${server.url}/ogc`, 'revisions', ...oapif());
  assert.equal(revisions.count, published.length);
  const tracks = await layer(`OAPIF:${server.url}/ogc`, 'tracks', ...oapif('PAGE_SIZE=1'));
  assert.equal(tracks.geometry, '3D Line String');
  assert.equal(tracks.count, 1);
  const track = await get(`/api/v1/missions/${mission}/track?limit=10000`);
  const line = tracks.features[0].geometry.coordinates,
    all = track.geometry.coordinates.map((at) => at.map((v) => v.toFixed(9)).join());
  assert.ok(line.length > 100, `${line.length} vertices`);
  for (const at of line) assert.ok(all.includes(at.map((v) => v.toFixed(9)).join()), `${at} was flown`);
});

test('without a token GDAL is refused, and a gateway is too', async () => {
  await assert.rejects(gdal('ogrinfo', '-ro', `OAPIF:${server.url}/ogc`), /401|failed/i);
  const { token } = await post('/api/v1/tokens', { name: 'bridge', roles: ['gateway'] });
  assert.equal((await server.fetch('/ogc/collections/anchors/items', { token })).status, 403);
});
