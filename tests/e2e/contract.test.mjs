// Every operation of api/openapi.yaml is called at least once, and every answer is one that the document promises:
// status, content type, required headers, body. Wrong requests too, since clients meet those answers most.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { in_parts } from './bundle_bodies.mjs';
import { Contract, checked } from './contract.mjs';
import { caster, firm, quota, rover, spareFirm } from './device_bodies.mjs';
import { ndjson, simulatedFlight } from './flight.mjs';
import { omlox, unknown } from './omlox.mjs';
import { room_png } from './room.mjs';
import { binary, eventually, root, startServer } from './server.mjs';
const contract = new Contract();
let server, call, flight;
const ids = {};
const lines = (rows) => ({ headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(rows) });

before(async () => {
  server = await startServer({ auth: 'on' });
  call = checked(server, contract);
  flight = await simulatedFlight({ duration: 90 });
});
after(() => server?.dispose());

test('a site, a mission, its measurements', async () => {
  ids.site = (await call('POST', '/api/v1/sites', { expect: 201, json: { name: 'Contract site' } })).json.id;
  ids.mission = (await call('POST', '/api/v1/missions', { expect: 201, json: flight.mission })).json.id;
  const spare = { ...flight.mission, name: 'spare' };
  ids.spare = (await call('POST', '/api/v1/missions', { expect: 201, json: spare })).json.id;
  await call('POST', `/api/v1/fixes?mission=${ids.mission}`, { expect: 200, ...lines(flight.fixes) });
  await call('POST', `/api/v1/ranges?mission=${ids.mission}`, { expect: 200, ...lines(flight.ranges) });
  const cir = {
    t_us: flight.ranges[9].t_us + 1,
    tag: '0x6e01',
    anchor: '0x6a21',
    distance_m: 9,
    mission: ids.spare,
    cir: { n: 2, dt_ps: 1001.6, first_path_idx: 0.5, rxpacc: 1001, b64: 'AAEAAv//AAA=' },
  };
  await call('POST', '/api/v1/ranges', { expect: 200, json: [cir] });
  await call('POST', `/api/v1/missions/${ids.mission}/actions`, { expect: 200, json: { action: 'finish' } });
});

test('measurements taken out of use, and back', async () => {
  const { json } = await call('GET', `/api/v1/ranges?mission=${ids.mission}&limit=2`, { expect: 200 });
  const path = `/api/v1/missions/${ids.mission}/exclusions`;
  const made = await call('POST', path, {
    expect: 201,
    json: { kind: 'ranges', ids: json.items.map((one) => one.id), reason: 'a bird' },
  });
  await call('GET', path, { expect: 200 });
  await call('POST', `${path}/${made.json.id}/include`, { expect: 200, json: { reason: 'no bird' } });
  await call('POST', `${path}/${made.json.id}/include`, { expect: 409, json: {} });
});

test('a calibration, published', async () => {
  const solved = await call('POST', '/api/v1/calibrations', {
    json: { missions: [ids.mission] },
    headers: { prefer: 'wait=120' },
  });
  assert.ok(solved.status < 300, solved.text);
  ids.calibration = solved.json.id;
  const job = await call('POST', '/api/v1/calibrations', { json: { missions: [ids.mission] } });
  assert.ok([200, 201, 202].includes(job.status));
  const listing = await call('GET', `/api/v1/calibrations/${ids.calibration}/residuals?format=starnet`, {
    expect: 200,
  });
  assert.match(listing.text, /^D F1T1-0x[0-9a-f]+ [0-9.]+ [0-9.]+\r$/m);
  await call('GET', `/api/v1/calibrations/${ids.calibration}/residuals?format=landxml`, { expect: 406 });
  await call('POST', `/api/v1/calibrations/${ids.calibration}/publish`, { json: {} });
  // Its kit learned from it; a first profile of another one is put.
  const profile = await call('GET', `/api/v1/devices/${flight.mission.kit}/profile`, { expect: 200 });
  await call('PUT', `/api/v1/devices/${flight.mission.kit}/profile`, { expect: 428, json: profile.json.profile });
  await call('PUT', `/api/v1/devices/${flight.mission.kit}/profile`, {
    expect: 200,
    json: profile.json.profile,
    headers: { 'if-match': profile.headers.get('etag') },
  });
});

test('a flight as one file, and back', async () => {
  const body = Buffer.from(await (await server.fetch(`/api/v1/missions/${ids.mission}/bundle`)).arrayBuffer());
  const headers = { 'content-type': 'application/vnd.anchord.bundle+zip' };
  const back = await call('POST', '/api/v1/bundles', { expect: 200, headers, body });
  assert.equal(back.json.already, true, back.text);
  assert.ok(back.json.rows.uwb_range > 0, back.text);
  const site = await (await server.fetch(`/api/v1/sites/${ids.site}/bundle`)).arrayBuffer();
  await call('POST', '/api/v1/bundles', { expect: 200, headers, body: Buffer.from(site) });
  await in_parts(call, body);
  await call('GET', `/api/v1/missions/${ids.spare}/bundle`, { expect: 409 }); // it records
  await call('GET', `/api/v1/missions/${ids.mission}/handover`, { expect: 200 });
  await call('GET', '/api/v1/signing-key?format=pem', { expect: 200 });
});

test('a local frame, fitted to the published anchors', async () => {
  const merge = (etag, json) => ({
    expect: 200,
    headers: { 'content-type': 'application/merge-patch+json', 'if-match': etag },
    body: JSON.stringify(json),
  });
  const site = await call('GET', `/api/v1/sites/${ids.site}`, { expect: 200 });
  const mapped = { projected_epsg: 25831, crs: { frame: 'ETRS89' } };
  await call('PATCH', `/api/v1/sites/${ids.site}`, merge(site.headers.get('etag'), mapped));
  for (const method of ['GET', 'PUT']) await call(method, `/api/v1/sites/${ids.site}/quota`, quota[method]);
  ids.organization = await firm(call, ids.site, merge);
  for (const { properties } of (await call('GET', '/api/v1/anchors', { expect: 200 })).json.features) {
    const path = `/api/v1/anchors/${properties.network_id}`;
    const { headers } = await call('GET', path, { expect: 200 });
    await call('PATCH', path, merge(headers.get('etag'), { site: ids.site }));
  }
  for (const format of ['dxf', 'ifc', 'pnezd', 'kml', 'gpkg'])
    await call('GET', `/api/v1/anchors?format=${format}`, { expect: 200 });
  await call('GET', '/api/v1/anchors?format=pozyx', { expect: 422 }); // no frame is fitted
  const shift = { shift: { east_m: 0.1, north_m: 0, up_m: 0 }, note: 'base surveyed again' };
  await call('POST', `/api/v1/sites/${ids.site}/datum?dry_run=true`, { expect: 200, json: shift });
  await call('POST', `/api/v1/sites/${ids.site}/datum`, { expect: 201, json: shift });
  ids.frame = (await call('POST', '/api/v1/frames', { expect: 201, json: { name: 'hall-a', site: ids.site } })).json.id;
  const { json } = await call('GET', '/api/v1/anchors', { expect: 200 });
  const pairs = json.features.map(({ properties }) => ({ anchor: properties.network_id, local_m: properties.enu_m }));
  const fit = await call('POST', `/api/v1/frames/${ids.frame}/fit`, { expect: 200, json: { pairs, parameters: 4 } });
  assert.ok(fit.json.fit.rms_m < 0.001, `ENU numbers are a local frame of their own: ${fit.json.fit.rms_m}`);
  await call('POST', '/api/v1/transform', {
    expect: 200,
    json: { from: 'local', to: 'geo', frame: 'hall-a', points: [pairs[0].local_m] },
  });
});

test('a webhook: set up, tried, turned off, taken away', async () => {
  const made = await call('POST', '/api/v1/webhooks', {
    expect: 201,
    json: { name: 'contract', url: 'http://127.0.0.1:1/hook', events: ['alarm.raised'] },
  });
  const path = `/api/v1/webhooks/${made.json.id}`;
  await call('POST', '/api/v1/webhooks', { expect: 422, json: { name: 'x', url: 'ftp://a' } });
  await call('GET', path, { expect: 200 });
  await call('GET', '/api/v1/webhooks', { expect: 200 });
  await call('GET', `/api/v1/webhooks/${unknown}`, { expect: 404 });
  const delivery = await call('POST', `${path}/test`, { expect: 202 });
  await eventually('it is refused, being of this machine', async () => {
    const { json } = await call('GET', `${path}/deliveries`, { expect: 200 });
    return json.items[0].id === delivery.json.id && json.items[0].fault?.includes('webhooks.allow_private');
  });
  await call('PATCH', path, { expect: 428, json: { enabled: false } });
  const patch = { json: { enabled: false }, headers: { 'if-match': made.headers.get('etag') } };
  const off = await call('PATCH', path, { expect: 200, ...patch });
  await call('PATCH', path, { expect: 412, ...patch });
  await call('POST', `${path}/test`, { expect: 422 });
  await call('DELETE', path, { expect: 204, headers: { 'if-match': off.headers.get('etag') } });
});

test('omlox: a hub with a token that is not shown, and the face of a hub', () => omlox(call, ids.site));

test('a building, its floor, the plan of it: sent, placed, traced, accepted, taken away', async () => {
  const site = (
    await call('POST', '/api/v1/sites', {
      expect: 201,
      json: { name: 'plans', origin: { lon: 3.7, lat: 51, h_m: 50 } },
    })
  ).json.id;
  const building = await call('POST', '/api/v1/buildings', { expect: 201, json: { site, name: 'B1', height_m: 9 } });
  const b = `/api/v1/buildings/${building.json.id}`;
  const made = await call('POST', '/api/v1/floors', {
    expect: 201,
    json: { building: building.json.id, name: 'Ground', level: 0 },
  });
  const f = `/api/v1/floors/${made.json.id}`;
  let etag = made.headers.get('etag');
  const change = async (method, path, expect, options = {}) => {
    const answer = await call(method, path, { expect, ...options, headers: { ...options.headers, 'if-match': etag } });
    etag = answer.headers.get('etag') ?? (await call('GET', f)).headers.get('etag');
    return answer;
  };
  await call('GET', b, { expect: 200 });
  await call('GET', `/api/v1/buildings?site=${site}`, { expect: 200 });
  await call('GET', `/api/v1/floors?building=${building.json.id}`, { expect: 200 });
  await call('GET', `/api/v1/buildings/${unknown}`, { expect: 404 });
  for (const part of ['', '/plan', '/plan/preview', '/plan/backdrop', '/plan/tiles/0/0/0', '/plan/trace', '/walls'])
    await call('GET', `/api/v1/floors/${unknown}${part}`, { expect: 404 });
  const merge = { headers: { 'content-type': 'application/merge-patch+json' } };
  await call('PATCH', b, {
    expect: 200,
    body: '{"height_m":9.5}',
    headers: { ...merge.headers, 'if-match': building.headers.get('etag') },
  });
  await change('PATCH', f, 200, { ...merge, body: '{"base_height_m":0.1}' });
  const png = { headers: { 'content-type': 'image/png' } };
  await change('PUT', `${f}/plan`, 415, { ...png, body: 'GIF89a' });
  await change('PUT', `${f}/plan`, 201, { ...png, body: room_png() });
  const points = [
    [100, 100],
    [700, 100],
    [100, 500],
  ].map(([x, y]) => ({ pixel: [x, y], enu_m: [x / 50, -y / 50] }));
  await call('POST', `${f}/plan/trace`, { expect: 422 });
  await change('PUT', `${f}/plan/georeference?dry_run=true`, 200, { json: { points } });
  await change('PUT', `${f}/plan/georeference`, 200, { json: { points } });
  for (const part of ['', '/preview', '/backdrop', '/tiles/2/1/2'])
    await call('GET', `${f}/plan${part}`, { expect: 200 });
  await call('POST', `${f}/plan/trace`, { expect: 200, headers: { prefer: 'wait=60' } });
  const traced = await call('GET', `${f}/plan/trace`, { expect: 200 });
  assert.equal(traced.json.walls.length, 4);
  etag = (await call('GET', f, { expect: 200 })).headers.get('etag');
  await change('PUT', `${f}/walls`, 200, { json: { from_trace: true, material: 'brick' } });
  await call('GET', `${f}/walls`, { expect: 200 });
  await call('DELETE', b, { expect: 409, headers: { 'if-match': (await call('GET', b)).headers.get('etag') } });
  await change('DELETE', `${f}/plan`, 204);
  await change('DELETE', f, 204);
  await call('DELETE', b, { expect: 204, headers: { 'if-match': (await call('GET', b)).headers.get('etag') } });
});

test('a plan that says nothing flies by the defaults of the contract', async () => {
  const { json: made } = await call('POST', '/api/v1/plans', { expect: 201, json: { name: 'defaults' } });
  const [settings] = contract.deref('/components/schemas/PlanSettings'),
    [plan] = contract.deref('/components/schemas/PlanBody');
  for (const [name, rule] of Object.entries(settings.properties))
    assert.deepEqual(made.settings[name], rule.default, name);
  assert.equal(made.building_height_m, plan.properties.building_height_m.default);
});

test('plans: made, generated, imported, checked, changed, exported', async () => {
  const outline = {
    type: 'Polygon',
    coordinates: [
      [
        [3.7131, 51.0231],
        [3.71353, 51.0231],
        [3.71353, 51.02328],
        [3.7131, 51.02328],
        [3.7131, 51.0231],
      ],
    ],
  };
  const made = await call('POST', '/api/v1/plans/generate', {
    expect: 200,
    json: { name: 'Hall A', outline, building_height_m: 8 },
  });
  ids.plan = (await call('POST', '/api/v1/plans', { expect: 201, json: made.json.plan })).json.id;
  const path = `/api/v1/plans/${ids.plan}`;
  const stored = await call('POST', `${path}/validate`, { expect: 200 });
  const drawn = await call('POST', '/api/v1/plans/validate', { expect: 200, json: made.json.plan });
  assert.deepEqual(drawn.json, stored.json, 'drawn and stored are judged alike');
  await call('POST', '/api/v1/plans/validate', { expect: 422, json: { ...made.json.plan, building_height_m: 'high' } });
  await call('GET', `${path}/export?format=geojson`, { expect: 200 });
  const file = await call('GET', `${path}/export`, { expect: 200 });
  await call('POST', '/api/v1/plans/import?dry_run=true', { expect: 200, json: file.json });
  ids.sparePlan = (await call('POST', '/api/v1/plans/import?name=Again', { expect: 201, json: file.json })).json.id;
  const etag = (answer) => answer.headers.get('etag');
  const got = await call('GET', path, { expect: 200 });
  const put = await call('PUT', path, { expect: 200, json: got.json, headers: { 'if-match': etag(got) } });
  await call('PATCH', path, { expect: 412, json: { name: 'Hall B' }, headers: { 'if-match': etag(got) } });
  await call('PATCH', path, { expect: 200, json: { name: 'Hall B' }, headers: { 'if-match': etag(put) } });
  await call('PATCH', path, { expect: 428, json: { name: 'Hall C' } });
  await call('DELETE', `/api/v1/plans/${ids.sparePlan}`, { expect: 204, headers: { 'if-match': '"p-1"' } });
});

test('a campaign, a data set, a training run, a model', async () => {
  const merge = { 'content-type': 'application/merge-patch+json' };
  const made = await call('POST', '/api/v1/campaigns', { expect: 201, json: { name: 'contract' } });
  ids.campaign = made.json.id;
  await call('PATCH', `/api/v1/campaigns/${ids.campaign}`, { expect: 428, headers: merge, body: '{"note":"x"}' });
  await call('PATCH', `/api/v1/campaigns/${ids.campaign}`, {
    expect: 200,
    headers: { ...merge, 'if-match': made.headers.get('etag') },
    body: '{"note":"x"}',
  });
  const csv = {
    headers: { 'content-type': 'text/csv' },
    body: readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'),
  };
  await call('POST', `/api/v1/campaigns/${ids.campaign}/samples`, { expect: 200, ...csv });
  await call('GET', `/api/v1/campaigns/${ids.campaign}/samples?features=true&los=true`, { expect: 200 });
  await call('POST', '/api/v1/campaigns', { expect: 201, json: { name: 'with responses' } });
  const heard = JSON.stringify({
    setting: 's',
    true_distance_m: 4.9,
    los: true,
    range_m: 5,
    cir: { n: 2, dt_ps: 1001.6, first_path_idx: 1, b64: 'AQACAP//BAA=' },
  });
  await call('POST', '/api/v1/campaigns/with%20responses/samples', {
    expect: 200,
    headers: { 'content-type': 'application/x-ndjson' },
    body: `${heard}\n`,
  });
  const sample = (await call('GET', '/api/v1/campaigns/with%20responses/samples', { expect: 200 })).json.items[0];
  await call('GET', `/api/v1/campaigns/with%20responses/samples/${sample.id}/cir`, { expect: 200 });
  await call('GET', `/api/v1/campaigns/${ids.campaign}/samples/${sample.id}/cir`, { expect: 404 });
  await call('PATCH', `/api/v1/ranges?mission=${ids.spare}`, { expect: 200, json: { los: true, distance_m: 8.9 } });
  ids.dataset = (
    await call('POST', '/api/v1/datasets', {
      expect: 201,
      json: { name: 'contract', campaigns: ['contract'], split: { test: ['room 6'] } },
    })
  ).json.id;
  const rows = (await call('GET', `/api/v1/datasets/${ids.dataset}/rows?format=csv`, { expect: 200 })).text;
  await call('GET', `/api/v1/datasets/${ids.dataset}/rows?format=ndjson`, { expect: 200 });
  const copy = (await call('POST', '/api/v1/datasets?name=copy', { expect: 201, headers: csv.headers, body: rows }))
    .json;
  await call('DELETE', `/api/v1/datasets/${copy.id}`, { expect: 204 });
  const train = (task, methods) =>
    call('POST', '/api/v1/training-runs', {
      expect: 201,
      headers: { prefer: 'wait=120' },
      json: { task, dataset: 'contract', methods, cv: { folds: 3, seed: 1 } },
    });
  const bias = (await train('los_bias', ['constant'])).json;
  const run = (await train('nlos_id', ['logistic'])).json;
  ids.run = run.id;
  ids.model = run.model.split('/').at(-1);
  await call('POST', '/api/v1/training-runs', {
    expect: 422,
    json: { task: 'nlos_id', dataset: 'nowhere', methods: ['magic'] },
  });
  await call('POST', `/api/v1/training-runs/${ids.run}/restart`, { expect: 422 });
  await call('DELETE', `/api/v1/training-runs/${bias.id}`, { expect: 204 });
  await call('DELETE', bias.model, { expect: 204 });
  await call('POST', `/api/v1/models/${ids.model}/promote`, { expect: 200, json: { reason: 'contract' } });
  await call('PATCH', '/api/v1/models/active', { expect: 200, json: { correction: 'hard' } });
  await call('POST', '/api/v1/models/active/predict', {
    expect: 200,
    json: { sample: { distance_m: 5, rx_dbm: -80, fp_dbm: -83, std_noise: 45 } },
  });
  await call('POST', `/api/v1/models/${ids.model}/predict`, { expect: 200, json: { samples: [{ distance_m: 5 }] } });
  const artifact = (await call('GET', `/api/v1/models/${ids.model}/artifact`, { expect: 200 })).json;
  await call('POST', '/api/v1/models', { expect: 201, json: artifact });
  await call('POST', '/api/v1/models', {
    expect: 422,
    headers: { 'content-type': 'application/json' },
    body: '{"format":"pickle"}',
  });
});

/** Of a simulated tag that is there for this only. */
async function radio_settings() {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  const simulator = spawn(binary, ['simulate', 'demonstration', '--json', '--links', folder], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  try {
    const tag = await new Promise((done) =>
      createInterface({ input: simulator.stdout }).on(
        'line',
        (line) => JSON.parse(line).kind === 'pozyx' && done(JSON.parse(line)),
      ),
    );
    const made = await call('POST', '/api/v1/devices', {
      expect: 201,
      json: { kind: 'pozyx', name: 'tag', address: tag.address },
    });
    const path = `/api/v1/devices/${made.json.id}`,
      uwb = `${path}/uwb-settings`;
    await eventually(
      'the tag ranges',
      async () => (await call('GET', path, { expect: 200 })).json.counters.ranges > 20,
      30_000,
      200,
    );
    const now = await call('GET', uwb, { expect: 200 });
    const wanted = { channel: 2, rate_kbps: 850, prf_mhz: 64, preamble_symbols: 512, devices: ['0x6a21', '0x6a22'] };
    await call('PUT', uwb, { expect: 428, json: wanted });
    await call('PUT', uwb, { expect: 412, json: wanted, headers: { 'if-match': '"u-1"' } });
    await call('PUT', uwb, { expect: 422, json: { channel: 2 }, headers: { 'if-match': now.headers.get('etag') } });
    const set = await call('PUT', uwb, { expect: 200, json: wanted, headers: { 'if-match': now.headers.get('etag') } });
    assert.deepEqual([set.json.channel, set.json.preamble_symbols, set.json.devices.length], [2, 512, 2]);
    assert.equal((await call('GET', uwb, { expect: 200 })).headers.get('etag'), set.headers.get('etag'));
    const compared = await call('GET', `${uwb}?devices=true`, { expect: 200 });
    assert.ok(compared.json.devices.length > 0 && now.json.devices === undefined);
    await call('GET', `/api/v1/devices/${unknown}/uwb-settings`, { expect: 404 });
    await call('DELETE', path, { expect: 204, headers: { 'if-match': made.headers.get('etag') } });
  } finally {
    simulator.kill('SIGTERM');
    rmSync(folder, { recursive: true, force: true });
  }
}

test('devices: set up, refused, changed, asked, looked for', async () => {
  const made = await call('POST', '/api/v1/devices', { expect: 201, json: rover });
  ids.device = made.json.id;
  await call('POST', '/api/v1/devices', { expect: 409, json: rover });
  await call('POST', '/api/v1/devices', { expect: 422, json: { ...rover, address: 'teapot:1' } });
  const path = `/api/v1/devices/${ids.device}`,
    patch = { json: { name: 'rover of the contract test' } };
  await call('PATCH', path, { expect: 428, ...patch });
  await call('PATCH', path, { expect: 200, ...patch, headers: { 'if-match': made.headers.get('etag') } });
  await call('PATCH', path, { expect: 412, ...patch, headers: { 'if-match': made.headers.get('etag') } });
  await call('POST', `${path}/actions`, { expect: 422, json: { action: 'identify' } }); // it is not plugged in
  await call('POST', '/api/v1/discovery', { expect: 200, json: {}, headers: { prefer: 'wait=30' } });
  const spare = await call('POST', '/api/v1/devices', { expect: 201, json: caster });
  await radio_settings();
  await call('DELETE', `/api/v1/devices/${spare.json.id}`, {
    expect: 204,
    headers: { 'if-match': spare.headers.get('etag') },
  });
});

test('a flight by hand: control, checklist, start, hold, abort', async () => {
  ids.flown = (
    await call('POST', '/api/v1/missions', { expect: 201, json: { ...flight.mission, name: 'flown' } })
  ).json.id;
  const path = `/api/v1/missions/${ids.flown}`;
  const lease = (await call('POST', `${path}/control`, { expect: 200, json: { action: 'take' } })).json.lease;
  await call('POST', `${path}/control`, { expect: 409, json: { action: 'take' } });
  await call('POST', `${path}/control`, { expect: 200, json: { action: 'renew', lease } });
  await call('GET', `${path}/control`, { expect: 200 });
  await call('POST', `${path}/uploads`, { json: { what: 'fence', plan: ids.plan, lease } }); // there is no aircraft
  await call('POST', `${path}/aircraft`, { expect: 422, json: { lease } }); // nor a link to one
  await call('GET', `${path}/checklist?plan=${ids.plan}`, { expect: 200 });
  await call('POST', `${path}/checklist`, { expect: 200, json: { plan: ids.plan } });
  for (const item of ['rtk', 'corrections', 'tag', 'disk', 'props', 'airspace', 'people', 'pilot'])
    await call('POST', `${path}/checklist/${item}`, { expect: 200, json: { reason: 'contract test' } });
  await call('POST', `${path}/checklist/recording`, { expect: 422, json: { reason: 'contract test' } });
  await call('POST', `/api/v1/fixes?mission=${ids.flown}`, {
    expect: 200,
    ...lines([{ ...flight.fixes[0], t_us: Date.now() * 1000 }]),
  });
  const start = { action: 'start', lease, plan: ids.plan, mode: 'manual' };
  let started;
  for (const end = Date.now() + 20_000; Date.now() < end;) {
    // the fix takes its way through the live path
    started = await call('POST', `${path}/actions`, { json: start });
    if (started.status === 202) break;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  assert.equal(started.status, 202, started.text);
  for (const shown of ['procedure', 'grid', 'procedure-log']) await call('GET', `${path}/${shown}`, { expect: 200 });
  await call('POST', `${path}/actions`, { expect: 409, json: { action: 'hold', lease: 'not mine' } });
  await call('POST', `${path}/actions`, {
    expect: 202,
    json: { action: 'hold', lease },
    headers: { prefer: 'wait=2' },
  });
  await call('POST', `${path}/actions`, { expect: 202, json: { action: 'abort', lease } });
  await call('POST', `${path}/actions`, { expect: 202, json: { action: 'hold', lease } }); // always, whatever the server believes
  await call('POST', `${path}/actions`, { expect: 422, json: { action: 'return', lease } });
  await call('POST', `${path}/anchors/0x6a21/work`, { expect: 422, json: { lease, action: 'give_up' } });
  await call('POST', `${path}/control`, { expect: 200, json: { action: 'release', lease } });
});

test('the plan of a flight that has landed is changed no more', async () => {
  const path = `/api/v1/missions/${ids.flown}/plan`;
  await call('GET', `${path}/change`, { expect: 422 });
  await call('POST', path, { expect: 409, json: { revision: 1 } });
});

test('everything that can be read', async () => {
  ids.job = (await call('GET', '/api/v1/jobs', { expect: 200 })).json.items[0]?.id;
  ids.range = (await call('GET', `/api/v1/ranges?mission=${ids.spare}`, { expect: 200 })).json.items[0].id;
  ids.anchor = '0x6a21';
  const given = {
    '/sites/': ids.site,
    '/organizations/': ids.organization,
    '/missions/': ids.mission,
    '/ranges/': ids.range,
    '/anchors/': ids.anchor,
    '/calibrations/': ids.calibration,
    '/jobs/': ids.job,
    '/plans/': ids.plan,
    '/profile': flight.mission.kit,
    '/devices/': ids.device,
    '/frames/': ids.frame,
    '/revisions/': '1',
    '/campaigns/': ids.campaign,
    '/datasets/': ids.dataset,
    '/training-runs/': ids.run,
    '/models/': ids.model,
    '/collections/': 'anchors',
  };
  const wrong = []; // all at once, as a person wants them
  for (const { method, template } of contract.operations.filter((o) => o.method === 'get')) {
    const own_test =
      template.includes('/webhooks/') ||
      /\/(buildings|floors|uploads)\//.test(template) ||
      template.includes('/omlox/v2/') ||
      template === '/api/v1/ws' ||
      template.includes('{sample}') ||
      template.includes('{feature}') ||
      template.endsWith('/uwb-settings') ||
      template.endsWith('/plan/change'); // of a flight in the air
    if (own_test) continue;
    const resource = Object.keys(given).find((part) => template.includes(part));
    const id = /missions\/[^/]+\/(procedure|grid|plan)$/.test(template)
      ? ids.flown
      : resource
        ? given[resource]
        : 'validation';
    const path = template.replace(/\{[^}]+\}/, id);
    try {
      const answer = await call(method.toUpperCase(), path);
      if (answer.status >= 400) wrong.push(`${template}: ${answer.status} ${answer.text.slice(0, 300)}`);
      if (template.includes('{id}') && template.startsWith('/api/')) {
        await call('GET', template.replace(/\{[^}]+\}/, template.includes('/ranges/') ? '999999999' : unknown), {
          expect: 404,
        });
      }
    } catch (error) {
      wrong.push(error.message);
    }
  }
  assert.equal(wrong.join('\n\n'), '');
  await call('GET', '/api/v1/anchors?view=live', { expect: 200 });
  for (const name of ['anchors', 'revisions', 'tracks']) {
    const items = `/ogc/collections/${name}/items`;
    const { json } = await call('GET', `${items}?limit=1`, { expect: 200 });
    await call('GET', `${items}/${json.features[0].id}`, { expect: 200 });
    await call('GET', `${items}/${unknown}`, { expect: 404 });
    await call('GET', `${items}?bbox=1,2,3`, { expect: 400 });
  }
  await call('GET', '/api/v1/missions?limit=0', { expect: 422 });
  await call('GET', '/api/v1/alarms', { expect: 200 });
  await call('POST', '/api/v1/alarms/rtk.lost/ack', { expect: 404, json: { note: 'seen' } });
});

test('changes with preconditions, tokens, sessions, tickets', async () => {
  const patch = { headers: { 'content-type': 'application/merge-patch+json' }, body: '{"name":"Hall A"}' };
  for (const path of ['/api/v1/anchors/0x6a21', `/api/v1/sites/${ids.site}`, `/api/v1/frames/${ids.frame}`]) {
    await call('PATCH', path, { expect: 428, ...patch });
    await call('PATCH', path, { expect: 412, ...patch, headers: { ...patch.headers, 'if-match': '"other"' } });
    const etag = (await call('GET', path, { expect: 200 })).headers.get('etag');
    await call('PATCH', path, { expect: 200, ...patch, headers: { ...patch.headers, 'if-match': etag } });
  }
  const backup = (await call('POST', '/api/v1/backups', { expect: 201, headers: { prefer: 'wait=60' } })).json;
  assert.ok((await call('GET', '/api/v1/backups', { expect: 200 })).json.items.some((b) => b.name === backup.name));
  const made = (await call('POST', '/api/v1/tokens', { expect: 201, json: { name: 'viewer', roles: ['viewer'] } }))
    .json;
  await call('DELETE', `/api/v1/tokens/${made.id}`);
  await call('POST', '/api/v1/ws-tickets', {});
  await call('POST', '/api/v1/session', { json: { token: server.token }, token: '' });
  await call('DELETE', '/api/v1/session', {});
});

test('wrong requests get the problems that are promised', async () => {
  await call('GET', '/api/v1/missions', { expect: 401, token: '' });
  await call('POST', '/api/v1/missions', { expect: 422, json: { name: 'x', no_such_field: 1 } });
  await call('POST', '/api/v1/missions', {
    expect: 400,
    headers: { 'content-type': 'application/json' },
    body: '{"name":',
  });
  await call('POST', '/api/v1/missions', { expect: 415, headers: { 'content-type': 'text/plain' }, body: 'hello' });
  await call('POST', '/api/v1/ranges', { expect: 415, headers: { 'content-type': 'image/png' }, body: 'x' });
  await call('POST', '/api/v1/calibrations', { json: { missions: [unknown] } });
});

test('what can be deleted', async () => {
  const etag = (path) => call('GET', path, { expect: 200 }).then((answer) => answer.headers.get('etag'));
  const spare = `/api/v1/missions/${ids.spare}`;
  await call('DELETE', spare, { expect: 409, headers: { 'if-match': await etag(spare) } }); // it records
  await call('POST', `${spare}/actions`, {
    expect: 422,
    json: { action: 'take_devices', lease: 'x', no_such_field: 1 },
  });
  await call('POST', `${spare}/actions`, { expect: 200, json: { action: 'finish' } });
  const move = async (to) =>
    (await call('POST', `${spare}/cir-archive`, { expect: 200, headers: { prefer: 'wait=60' }, json: { to } })).json;
  assert.equal((await move('file')).n_moved, 1);
  assert.equal((await call('GET', '/api/v1/cir-archive', { expect: 200 })).json.items[0].mission, ids.spare);
  assert.equal((await move('database')).n_moved, 0);
  const named = { json: { name: 'spare, named anew' } };
  await call('PATCH', spare, { expect: 428, ...named });
  await call('PATCH', spare, { expect: 200, ...named, headers: { 'if-match': await etag(spare) } });
  await call('DELETE', spare, { expect: 428 });
  await call('DELETE', spare, { expect: 412, headers: { 'if-match': '"m-0"' } });
  await call('DELETE', spare, { expect: 204, headers: { 'if-match': await etag(spare) } });
  await call('GET', spare, { expect: 410 });
  assert.equal((await call('GET', '/api/v1/missions?deleted=true', { expect: 200 })).json.items[0].id, ids.spare);
  await call('POST', `${spare}/restore`, { expect: 200 });
  await call('POST', `${spare}/restore`, { expect: 409 });
  await call('DELETE', spare, { expect: 204, headers: { 'if-match': await etag(spare) } });
  await call('DELETE', `${spare}?purge=true`, {
    expect: 204,
    headers: { 'if-match': await etag(`${spare}?deleted=true`) },
  });
  const site = (await call('POST', '/api/v1/sites', { expect: 201, json: { name: 'spare site' } })).json.id;
  const empty = await spareFirm(call, ids);
  for (const path of [`/api/v1/frames/${ids.frame}`, `/api/v1/sites/${site}`, empty]) {
    const answer = await call('DELETE', path, { headers: { 'if-match': (await etag(path)) ?? '*' } });
    assert.ok(answer.status < 300, `${path}: ${answer.status} ${answer.text}`);
  }
  await call('DELETE', `/api/v1/jobs/${ids.job}`);
  await call('POST', '/api/v1/models/rollback', { expect: 200, json: { task: 'nlos_id' } });
  await call('DELETE', `/api/v1/campaigns/${ids.campaign}`, { expect: 204 });
  await call('DELETE', `/api/v1/calibrations/${ids.calibration}`);
});

test('the demonstration is flown in the server, one at a time, and its estimates are there as they came', async () => {
  const flown = await call('POST', '/api/v1/demonstration', { expect: 202, json: { speed: 20 } });
  await call('POST', '/api/v1/demonstration', { expect: 409, json: {} });
  await call('POST', '/api/v1/demonstration', { expect: 422, json: { speed: 100 } });
  await call('GET', `/api/v1/missions/${flown.json.mission}/estimates`, { expect: 200 });
});

test('no operation of the contract was left out', () => {
  const left = contract.uncalled().filter((name) => name !== 'GET /api/v1/ws'); // live.test.mjs
  assert.deepEqual(left, []);
  assert.ok(contract.operations.length > 30, `only ${contract.operations.length} operations in the contract`);
});
