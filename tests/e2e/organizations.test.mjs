// Tokens of organizations and with a quota of requests, made on the command line: through the server that runs on the folder, and in the
// folder of one that does not.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { run, startServer } from './server.mjs';

let server, north, south;
const made = async (path, json) => (await server.fetch(`/api/v1${path}`, { json })).json();
const create = (...args) =>
  run(['token', 'create', '--data-dir', server.dataDir, '--name', 'office', '--role', 'viewer', ...args]);
const seen = async (token) => {
  const answer = await server.fetch('/api/v1/sites', { token });
  assert.equal(answer.status, 200);
  return (await answer.json()).items.map((site) => site.name).sort();
};

before(async () => {
  server = await startServer({ auth: 'on' });
  [north, south] = [await made('/organizations', { name: 'North' }), await made('/organizations', { name: 'South' })];
  for (const [name, organization] of [
    ['hall', north.id],
    ['depot', south.id],
    ['shed', undefined],
  ])
    await made('/sites', { name, organization, origin: { lat: 51, lon: 3, h_m: 50 } });
});
after(() => server?.dispose());

test('through a running server: it sees the sites of its organization, those made later too', async () => {
  const { code, stdout, stderr } = await create('--organization', north.id);
  assert.equal(code, 0, stderr);
  const token = JSON.parse(stdout).token;
  assert.deepEqual(await seen(token), ['hall']);
  await made('/sites', { name: 'annex', organization: north.id, origin: { lat: 51, lon: 3, h_m: 50 } });
  assert.deepEqual(await seen(token), ['annex', 'hall']);
});

test('in the folder of a stopped server: the same after its start', async () => {
  await server.stop();
  const { code, stdout, stderr } = await create('--organization', south.id, '--requests-per-minute', '3');
  const unknown = await create('--organization', '0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f');
  const listed = await run(['token', 'list', '--data-dir', server.dataDir]);
  await server.start();
  assert.equal(code, 0, stderr);
  assert.equal(unknown.code, 2);
  assert.match(unknown.stderr, /--organization 0197.*: there is no such organization/);
  assert.ok(listed.stdout.includes(`organization ${south.id}`), listed.stdout);
  const token = stdout.trim();
  for (let n = 0; n < 3; ++n) assert.deepEqual(await seen(token), ['depot']);
  const refused = await server.fetch('/api/v1/sites', { token });
  assert.equal(refused.status, 429);
  assert.ok(Number(refused.headers.get('retry-after')) >= 1);
  assert.match((await refused.json()).detail, /this token may ask 3 times a minute/);
});

test('one that is bound twice, and a limit for an admin of the whole server, are refused with what to do', async () => {
  const [site] = (await (await server.fetch('/api/v1/sites')).json()).items;
  const twice = await create('--organization', north.id, '--site', site.id);
  assert.notEqual(twice.code, 0);
  assert.match(twice.stderr, /leave one of the two out/);
  const admin = await create('--role', 'admin', '--requests-per-minute', '5');
  assert.notEqual(admin.code, 0);
  assert.match(admin.stderr, /an admin of the whole server has no limit of requests/);
});
