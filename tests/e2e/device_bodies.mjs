// Bodies of the contract test: settings of devices that are nowhere, which are set up, changed and removed without one; a quota,
// and an organization with its site.

export const rover = {
  kind: 'gnss',
  name: 'rover',
  address: 'serial:/dev/serial/by-id/of-the-contract-test',
  options: { format: 'nmea' },
};
export const caster = { kind: 'ntrip', address: 'tcp://127.0.0.1:1', options: { mount: 'M' }, enabled: false };

/** Of each method. */
export const quota = {
  GET: { expect: 200 },
  PUT: { expect: 200, json: { missions: 1000, measurements: null, anchors: null } },
};

/** Every operation of organizations; the id of one that has the site, a quota and a token. */
export async function firm(call, site, merge) {
  const all = '/api/v1/organizations';
  const { id } = (await call('POST', all, { expect: 201, json: { name: 'Firm', description: 'of the contract' } }))
    .json;
  const one = await call('GET', `${all}/${id}`, { expect: 200 });
  await call('PATCH', `${all}/${id}`, merge(one.headers.get('etag'), { description: null }));
  const limits = { missions: 1000, measurements: null, anchors: null, sites: 10, requests_per_minute: 600 };
  for (const method of ['PUT', 'GET'])
    await call(method, `${all}/${id}/quota`, { expect: 200, ...(method === 'PUT' && { json: limits }) });
  const at = `/api/v1/sites/${site}`;
  const given = await call(
    'PATCH',
    at,
    merge((await call('GET', at, { expect: 200 })).headers.get('etag'), { organization: id }),
  );
  if (given.json.organization !== id) throw new Error(given.text);
  const listed = await call('GET', `/api/v1/sites?organization=${id}`, { expect: 200 });
  if (listed.json.items.length !== 1) throw new Error(listed.text);
  const token = { name: 'of the firm', roles: ['viewer'], organization: id, requests_per_minute: 120 };
  await call('POST', '/api/v1/tokens', { expect: 201, json: token });
  return id;
}

/** The path of one that may be removed; that of the contract has a site, and the site anchors. */
export async function spareFirm(call, ids) {
  for (const used of [`/api/v1/organizations/${ids.organization}`, `/api/v1/sites/${ids.site}`]) {
    const etag = (await call('GET', used, { expect: 200 })).headers.get('etag');
    await call('DELETE', used, { expect: 409, headers: { 'if-match': etag } });
  }
  const made = await call('POST', '/api/v1/organizations', { expect: 201, json: { name: 'empty' } });
  return made.headers.get('location');
}
