// What tests of `anchord sync` share: flights of a server, what it has, and a stranger in a server's place.
import assert from 'node:assert/strict';
import { createServer, request } from 'node:http';
import { ndjson, simulatedFlight } from './flight.mjs';

export async function ok(server, path, init) {
  let answer = await server.fetch(path, init);
  // A quick machine asks more than one token may: as every client, it waits as long as it is told.
  while (answer.status === 429) {
    await new Promise((done) => setTimeout(done, 1000 * Number(answer.headers.get('retry-after'))));
    answer = await server.fetch(path, init);
  }
  const text = await answer.text();
  assert.ok(answer.ok, `${path}: ${answer.status} ${text}`);
  return text ? JSON.parse(text) : null;
}
export const rows = (list) => ({
  method: 'POST',
  headers: { 'content-type': 'application/x-ndjson' },
  body: ndjson(list),
});

/** A finished flight of a server, solved and published there. */
export async function fly(server, seed, site) {
  const flight = await simulatedFlight({ seed, duration: 120 });
  const { id } = await ok(server, '/api/v1/missions?devices=false', { json: { ...flight.mission, site } });
  await ok(server, `/api/v1/fixes?mission=${id}`, rows(flight.fixes));
  await ok(server, `/api/v1/ranges?mission=${id}`, rows(flight.ranges));
  await ok(server, `/api/v1/missions/${id}/actions`, { json: { action: 'finish' } });
  const solved = await ok(server, '/api/v1/calibrations', {
    json: { missions: [id] },
    headers: { prefer: 'wait=120' },
  });
  await ok(server, `/api/v1/calibrations/${solved.id}/publish`, { json: { note: `seed ${seed}` } });
  return { id, calibration: solved.id };
}
/** Published positions of a server, to the last digit: coordinates have 1e-9 degrees and more. */
export const published = async (server) =>
  Object.fromEntries(
    (await ok(server, '/api/v1/anchors')).features
      .filter((f) => f.properties.provenance.calibration)
      .map((f) => [
        f.properties.network_id,
        { at: f.geometry, enu_m: f.properties.enu_m, calibration: f.properties.provenance.calibration },
      ]),
  );
/** What a server has, counted; its revisions by what they rest on. */
export async function counted(server) {
  const missions = (await ok(server, '/api/v1/missions?limit=100')).items.filter((m) => m.state === 'finished');
  return {
    missions: missions.map((m) => [m.id, m.n_ranges, m.n_fixes]).sort(),
    calibrations: (await ok(server, '/api/v1/calibrations?limit=100')).items.map((c) => c.id).sort(),
    models: (await ok(server, '/api/v1/models?limit=100')).items.map((m) => m.sha256).sort(),
    revisions: (await ok(server, '/api/v1/revisions?limit=100')).items.map((r) => r.calibration),
  };
}
/** A server that answers everything alike, or what `answer` says of a request. */
export async function stranger(answer, use) {
  const server = createServer((req, res) => {
    answer(req, res);
    req.on('error', () => {}).resume();
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  try {
    return await use(`http://127.0.0.1:${server.address().port}`);
  } finally {
    server.closeAllConnections();
    await new Promise((done) => server.close(done));
  }
}
export const json = (res, status, value) => {
  res.writeHead(status, { 'content-type': 'application/json' }).end(JSON.stringify(value));
};
/** The real server, but for what `change` does with a request or with its answer: it says true where it did. */
export const forwarding = (server, change) => (req, res) => {
  if (change(req, res)) return;
  const to = { host: '127.0.0.1', port: server.port, path: req.url, method: req.method, headers: req.headers };
  const on = request(to, (back) => {
    if (!change(req, res, back)) back.pipe(res.writeHead(back.statusCode, back.headers));
  });
  on.on('error', () => res.destroy());
  req.pipe(on);
};
/** The real server, but the first answer to each thing that is sent to it is lost; `lost` has what. */
export const lossy = (server, lost) =>
  forwarding(server, (req, res, back) => {
    const what = `${req.method} ${req.url}`;
    if (!back || req.method === 'GET' || lost.has(what)) return false;
    lost.add(what);
    back.resume().on('end', () => res.destroy());
    return true;
  });
