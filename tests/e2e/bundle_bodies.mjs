// A bundle in parts, as the contract has it.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';

/** Every operation of an upload, with the bundle of a flight that is on the server already. */
export async function in_parts(call, body) {
  const sha256 = createHash('sha256').update(body).digest('hex');
  const upload = await call('POST', '/api/v1/bundles/uploads', { expect: 201, json: { bytes: body.length, sha256 } });
  const uploads = upload.headers.get('location');
  const part = (from, to) => ({
    headers: { 'content-type': 'application/offset+octet-stream', 'upload-offset': String(from) },
    body: body.subarray(from, to),
  });
  await call('PATCH', uploads, { expect: 204, ...part(0, 500) });
  await call('PATCH', uploads, { expect: 409, ...part(400, 600) });
  await call('PATCH', uploads, {
    expect: 413,
    ...part(500),
    body: Buffer.concat([body.subarray(500), Buffer.from('x')]),
  });
  await call('POST', `${uploads}/import`, { expect: 409 });
  const here = await call('GET', uploads, { expect: 200 });
  assert.ok(here.json.offset >= 500, here.text);
  await call('PATCH', uploads, { expect: 204, ...part(here.json.offset) });
  const again = await call('POST', '/api/v1/bundles/uploads', { expect: 200, json: { bytes: body.length, sha256 } });
  assert.equal(again.json.offset, body.length);
  assert.equal((await call('POST', `${uploads}/import`, { expect: 200 })).json.already, true);
  await call('DELETE', uploads, { expect: 204 });
  await call('GET', uploads, { expect: 404 });
  await call('POST', '/api/v1/bundles/uploads', { expect: 422, json: { bytes: 0, sha256: 'x' } });
  const headers = { 'content-type': 'application/vnd.anchord.bundle+zip' };
  await call('POST', '/api/v1/bundles', { expect: 422, headers, body: body.subarray(0, 500) });
  await call('POST', '/api/v1/bundles', { expect: 415, json: {} });
}
