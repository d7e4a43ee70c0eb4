// Three people with curl: a gateway that delivers, an operator who publishes, a facility tool that reads. Login is on.
import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { metresBetween, ndjson, simulatedFlight } from './flight.mjs';
import { startServer } from './server.mjs';

let server, flight, mission, calibration;
const tokens = {};

/** Answer as {status, headers, json, text}; fails with the body in the message when `expect` is not the status. */
async function call(who, method, path, { expect, ...init } = {}) {
  const response = await server.fetch(path, { method, token: who ? tokens[who] : '', ...init });
  const text = await response.text();
  if (expect !== undefined) assert.equal(response.status, expect, `${who} ${method} ${path}: ${text.slice(0, 800)}`);
  const type = response.headers.get('content-type') ?? '';
  return {
    status: response.status,
    headers: response.headers,
    text,
    json: type.includes('json') && text ? JSON.parse(text) : undefined,
  };
}
const lines = (rows) => ({ headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(rows) });

before(async () => {
  flight = await simulatedFlight();
  server = await startServer({ auth: 'on' });
  tokens.admin = server.token;
});
after(() => server?.dispose());

test('the first admin token lies in a file that only its owner reads', () => {
  assert.equal(statSync(join(server.dataDir, 'admin.token')).mode & 0o777, 0o600);
});

test('without a token every route of the API says 401, and the health probes answer', async () => {
  for (const path of ['/api/v1/missions', '/api/v1/anchors', '/api/v1/ranges', '/api/v1/tokens']) {
    const { headers, json } = await call(null, 'GET', path, { expect: 401 });
    assert.ok(headers.get('www-authenticate'), `${path}: no WWW-Authenticate`);
    assert.equal(json.status, 401);
  }
  await call(null, 'GET', '/healthz', { expect: 200 });
  await call(null, 'GET', '/readyz', { expect: 200 });
});

test('the admin makes a token for each role', async () => {
  for (const role of ['viewer', 'integrator', 'gateway', 'engineer', 'operator']) {
    const { json } = await call('admin', 'POST', '/api/v1/tokens', {
      expect: 201,
      json: { name: role, roles: [role] },
    });
    tokens[role] = json.token ?? json.secret;
    assert.ok(tokens[role], JSON.stringify(json));
  }
});

test('a viewer may read, and may neither deliver nor publish', async () => {
  await call('viewer', 'GET', '/api/v1/missions', { expect: 200 });
  await call('viewer', 'POST', '/api/v1/ranges', { expect: 403, ...lines(flight.ranges.slice(0, 1)) });
  await call('viewer', 'POST', '/api/v1/missions', { expect: 403, json: flight.mission });
  await call('viewer', 'GET', '/api/v1/tokens', { expect: 403 });
});

test('the operator opens a mission, the gateway delivers it; sending all again counts duplicates', async () => {
  mission = (await call('operator', 'POST', '/api/v1/missions', { expect: 201, json: flight.mission })).json.id;
  await call('gateway', 'GET', '/api/v1/missions', { expect: 403 });
  const good = flight.ranges.filter((row) => row.distance_m > 0),
    zero = flight.ranges.length - good.length;
  assert.ok(zero > 0, 'the simulated device never failed');
  const fixes = (
    await call('gateway', 'POST', `/api/v1/fixes?mission=${mission}`, { expect: 200, ...lines(flight.fixes) })
  ).json;
  assert.equal(fixes.accepted, flight.fixes.length, JSON.stringify(fixes).slice(0, 500));
  const first = (
    await call('gateway', 'POST', `/api/v1/ranges?mission=${mission}`, { expect: 200, ...lines(flight.ranges) })
  ).json;
  assert.deepEqual(
    [first.accepted, first.duplicates, first.rejected],
    [good.length, 0, zero],
    JSON.stringify(first).slice(0, 500),
  );
  assert.equal(first.errors[0].code, 'zero_distance');
  const again = (await call('gateway', 'POST', `/api/v1/ranges?mission=${mission}`, { expect: 200, ...lines(good) }))
    .json;
  assert.deepEqual([again.accepted, again.duplicates], [0, good.length]);
});

test('the engineer solves it, and every anchor lies inside the region it claims', async () => {
  await call('operator', 'POST', `/api/v1/missions/${mission}/actions`, { json: { action: 'finish' } });
  const { json } = await call('engineer', 'POST', '/api/v1/calibrations', {
    json: { missions: [mission] },
    headers: { prefer: 'wait=120' },
  });
  calibration = json.id;
  assert.equal(json.anchors?.length, 6, JSON.stringify(json).slice(0, 800));
});

test('nothing is published by itself; the operator publishes, and the integrator reads GeoJSON', async () => {
  assert.equal((await call('integrator', 'GET', '/api/v1/anchors', { expect: 200 })).json.features.length, 0);
  await call('integrator', 'POST', `/api/v1/calibrations/${calibration}/publish`, { expect: 403, json: {} });
  await call('operator', 'POST', `/api/v1/calibrations/${calibration}/publish`, { json: {} });
  const { json, headers } = await call('integrator', 'GET', '/api/v1/anchors', { expect: 200 });
  assert.match(headers.get('content-type'), /^application\/geo\+json/);
  assert.equal(json.type, 'FeatureCollection');
  assert.equal(json.features.length, 6);
  for (const feature of json.features) {
    const [lon, lat, h_m] = feature.geometry.coordinates,
      id = feature.properties.network_id,
      truth = flight.truth[id];
    const { h95_m, v95_m } = feature.properties.accuracy.relative;
    assert.ok(
      metresBetween({ lon, lat }, truth) < h95_m,
      `${id}: ${metresBetween({ lon, lat }, truth)} m off, claims ${h95_m}`,
    );
    assert.ok(
      Math.abs(h_m - truth.h_m) < 1.5 * v95_m,
      `${id}: ${Math.abs(h_m - truth.h_m)} m off in height, claims ${v95_m}`,
    );
  }
  const one = await call('integrator', 'GET', '/api/v1/anchors/0x6a21', { expect: 200 });
  assert.equal(one.json.properties.network_id, '0x6a21');
  const etag = one.headers.get('etag');
  assert.ok(etag);
  await call('integrator', 'GET', '/api/v1/anchors/0x6a21', { expect: 304, headers: { 'if-none-match': etag } });
});

test('facility fields need If-Match, and an outdated one is refused', async () => {
  const { headers } = await call('integrator', 'GET', '/api/v1/anchors/0x6a21', { expect: 200 });
  const patch = (etag, expect) =>
    call('integrator', 'PATCH', '/api/v1/anchors/0x6a21', {
      expect,
      body: JSON.stringify({ name: 'Hall A north-west' }),
      headers: { 'content-type': 'application/merge-patch+json', ...(etag ? { 'if-match': etag } : {}) },
    });
  await patch(undefined, 428);
  await patch('"not-this-one"', 412);
  const { json } = await patch(headers.get('etag'), 200);
  assert.equal(json.properties.name, 'Hall A north-west');
});

test('a revoked token is refused at once', async () => {
  const { json } = await call('admin', 'GET', '/api/v1/tokens', { expect: 200 });
  const viewer = (json.items ?? json.tokens ?? json).find((token) => token.name === 'viewer');
  await call('admin', 'DELETE', `/api/v1/tokens/${viewer.id}`);
  await call('viewer', 'GET', '/api/v1/missions', { expect: 401 });
});

test('what was published is there after a crash', async () => {
  await server.kill();
  await server.start();
  assert.equal((await call('integrator', 'GET', '/api/v1/anchors', { expect: 200 })).json.features.length, 6);
});
