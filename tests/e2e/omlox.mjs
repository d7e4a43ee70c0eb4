// The operations of omlox, for the test of the contract: each answer is held to it by `call`.
import assert from 'node:assert/strict';

/** An id that nothing has. */
export const unknown = '0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f';

/** A webhook of kind omlox_hub. */
async function omlox_hub(call) {
  const json = { name: 'hub', kind: 'omlox_hub', url: 'http://127.0.0.1:1/v2', dialect: 'objects', token: 'abc.def' };
  const made = await call('POST', '/api/v1/webhooks', { expect: 201, json });
  assert.ok(made.json.token_set && !made.text.includes('abc.def'), made.text);
  await call('POST', '/api/v1/webhooks', { expect: 422, json: { ...json, kind: 'cloud_event' } });
  const path = `/api/v1/webhooks/${made.json.id}`;
  await call('POST', `${path}/test`, { expect: 202 });
  const changed = await call('PATCH', path, {
    expect: 200,
    json: { token: '', dialect: 'official' },
    headers: { 'if-match': made.headers.get('etag') },
  });
  assert.equal(changed.json.token_set, false);
  await call('DELETE', path, { expect: 204, headers: { 'if-match': changed.headers.get('etag') } });
}

/** The face of a hub, over the published anchors of a site. */
async function omlox_face(call, site) {
  const root = '/omlox/v2';
  for (const anchor of ['0x6a21', '0x6a22', '0x6a23']) {
    const known = await call('GET', `/api/v1/anchors/${anchor}`);
    if (known.status !== 200) continue;
    await call('PATCH', `/api/v1/anchors/${anchor}`, {
      expect: 200,
      headers: { 'content-type': 'application/merge-patch+json', 'if-match': known.headers.get('etag') },
      body: JSON.stringify({ site: site }),
    });
  }
  for (const kind of ['zones', 'providers', 'trackables']) {
    const listed = await call('GET', `${root}/${kind}`, { expect: 200 });
    const objects = await call('GET', `${root}/${kind}/summary`, { expect: 200 });
    assert.deepEqual(
      listed.json,
      objects.json.map((one) => one.id),
    );
    assert.ok(listed.json.length > 0, `there are ${kind}`);
    await call('GET', `${root}/${kind}?dialect=objects`, { expect: 200 });
    await call('GET', `${root}/${kind}/${listed.json[0]}`, { expect: 200 });
    await call('GET', `${root}/${kind}/${unknown}`, { expect: 404 });
    await call('GET', `${root}/${kind}?dialect=x`, { expect: 400 });
  }
  const zone = (await call('GET', `${root}/zones/summary`, { expect: 200 })).json.find((one) => one.site);
  const position = { type: 'Point', coordinates: [1, 2, 3] };
  const transform = `${root}/zones/${zone.id}/transform`;
  const globe = await call('PUT', transform, { expect: 200, json: { position } });
  await call('PUT', transform, { expect: 200, json: { position: globe.json.position, crs: 'EPSG:4326' } });
  await call('PUT', transform, { expect: 400, json: { position: { type: 'Point', coordinates: [1] } } });
  const trackable = (await call('GET', `${root}/trackables`, { expect: 200 })).json[0];
  for (const path of ['providers/locations', `trackables/${trackable}/locations`]) {
    await call('GET', `${root}/${path}`, { expect: 200 });
    await call('GET', `${root}/${path}?geojson=true`, { expect: 200 });
    await call('GET', `${root}/${path}?crs=local`, { expect: 400 });
  }
  await call('GET', `${root}/trackables/${trackable}/location`); // 404 unless it flew since the start
  await call('GET', `${root}/providers/0x0001/location`, { expect: 404 });
  await call('GET', `${root}/ws/socket`, { expect: 426 });
  await call('GET', `${root}/ws/socket`, { expect: 401, token: '' });
}

export async function omlox(call, site) {
  await omlox_hub(call);
  await omlox_face(call, site);
}
