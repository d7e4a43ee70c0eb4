// The role matrix: every operation that the server documents, asked for by a token of each role and without one, answers 401 or 403 to those who may not
// and something else to those who may. tests/data/contract/roles.txt has who may, so that a new operation is a decision that is read in review.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { root, startServer } from './server.mjs';

const roles = ['viewer', 'integrator', 'gateway', 'engineer', 'operator', 'admin'];
// These end or upgrade the connection that asks: e2e_personas and e2e_live have them.
const elsewhere = ['DELETE /api/v1/session', 'GET /api/v1/ws', 'GET /omlox/v2/ws/socket'];
const tokens = {};
let server;

before(async () => {
  server = await startServer({ auth: 'on', args: ['--rate-per-s', '100000', '--rate-burst', '100000'] });
  for (const role of roles)
    tokens[role] = (await (await server.fetch('/api/v1/tokens', { json: { name: role, roles: [role] } })).json()).token;
});
after(() => server?.dispose());

/** Ids that name nothing and a body that nobody takes: who may gets a 4xx of another kind, and nothing is changed. */
async function ask(method, path, token) {
  const body = ['POST', 'PUT', 'PATCH'].includes(method) ? '{"x":1}' : undefined;
  const answer = await server.fetch(path.replaceAll(/\{[^}]+\}/g, '0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f'), {
    method,
    body,
    token,
    headers: body ? { 'content-type': 'application/json' } : {},
  });
  await answer.arrayBuffer();
  return answer.status;
}

test('each operation is for the roles of its line, and each has one', async () => {
  const expected = readFileSync(join(root, 'tests/data/contract/roles.txt'), 'utf8')
    .split('\n')
    .filter((line) => line && !line.startsWith('#'));
  const { paths } = await (await server.fetch('/api/v1/openapi.json')).json();
  const actual = [];
  for (const [path, operations] of Object.entries(paths)) {
    for (const method of Object.keys(operations).map((one) => one.toUpperCase())) {
      if (!operations[method.toLowerCase()].operationId || elsewhere.includes(`${method} ${path}`)) continue;
      const open = (await ask(method, path, '')) !== 401;
      const who = [];
      for (const role of open ? [] : roles) if ((await ask(method, path, tokens[role])) !== 403) who.push(role);
      actual.push(`${method} ${path} ${open ? 'open' : who.join(' ')}`);
    }
  }
  assert.ok(actual.length > 200, `${actual.length} operations`);
  assert.deepEqual(
    {
      'not in roles.txt': actual.filter((line) => !expected.includes(line)),
      'not served so': expected.filter((line) => !actual.includes(line)),
    },
    { 'not in roles.txt': [], 'not served so': [] },
  );
});

test('viewers change nothing, gateways deliver and admins may everything', () => {
  for (const line of readFileSync(join(root, 'tests/data/contract/roles.txt'), 'utf8').split('\n')) {
    const [method, path, ...who] = line.split(' ');
    if (!path?.startsWith('/') || who[0] === 'open') continue;
    assert.ok(who.includes('admin'), line);
    if (['DELETE', 'PATCH', 'PUT'].includes(method))
      assert.ok(!who.includes('viewer') || path.includes('/omlox/'), line);
    if (method !== 'GET' && who.includes('gateway') && !who.includes('viewer'))
      assert.match(path, /^\/api\/v1\/(ranges|fixes|campaigns(\/.*)?)$/, line);
  }
});
