// The checker of histories: made by hand, and of a real server whose proxy breaks what If-Match promises.
import assert from 'node:assert/strict';
import { createServer } from 'node:http';
import { once } from 'node:events';
import { test } from 'node:test';
import { startServer } from '../e2e/server.mjs';
import { Historian, modelOf } from './histories.mjs';
import { checkKey, shown, versioned, violations } from './linearizable.mjs';

const begun = versioned(1, 'a');
const read = (call, end, version, value) => ({ call, end, input: { op: 'read' }, output: { version, value } });
const change = (call, end, match, value, output) => ({ call, end, input: { op: 'change', match, value }, output });
const fits = (...ops) => checkKey(ops, begun).linearizable;

test('calls one after the other that answer as a register does are linearizable', () => {
  assert.ok(fits(read(0, 1, 1, 'a'), change(2, 3, 1, 'b', { version: 2 }), read(4, 5, 2, 'b')));
  assert.ok(
    fits(change(0, 1, 1, 'b', { version: 2 }), change(2, 3, 1, 'c', { refused: 'changed' }), read(4, 5, 2, 'b')),
  );
});

test('a read beside a change may show either, and two reads beside it not the new value first', () => {
  const beside = change(0, 10, 1, 'b', { version: 2 });
  assert.ok(fits(beside, read(1, 2, 1, 'a'), read(3, 4, 2, 'b')));
  assert.ok(!fits(beside, read(1, 2, 2, 'b'), read(3, 4, 1, 'a')));
});

test('a read that is older than what was acknowledged before it is found', () => {
  assert.ok(!fits(change(0, 1, 1, 'b', { version: 2 }), read(2, 3, 1, 'a')));
});

test('two changes of the same version that were both acknowledged are found', () => {
  assert.ok(!fits(change(0, 10, 1, 'b', { version: 2 }), change(0, 10, 1, 'c', { version: 2 })));
  assert.ok(!fits(change(0, 10, 1, 'b', { version: 2 }), change(0, 10, 1, 'c', { version: 3 })));
});

test('a refusal of the version that is there is found', () => {
  assert.ok(!fits(change(0, 1, 1, 'b', { refused: 'changed' })));
});

test('a change of unknown outcome may have been done late, or never, and not twice', () => {
  const lost = change(0, undefined, 1, 'b', undefined);
  assert.ok(fits(lost, read(5, 6, 1, 'a'), read(7, 8, 2, 'b')));
  assert.ok(fits(lost, read(5, 6, 1, 'a'), change(7, 8, 1, 'c', { version: 2 }), read(9, 10, 2, 'c')));
  assert.ok(!fits(lost, read(5, 6, 2, 'b'), read(7, 8, 1, 'a')));
  assert.ok(!fits(lost, read(5, 6, 2, 'b'), change(7, 8, 2, 'c', { version: 3 }), read(9, 10, 4, 'b')));
});

test('what is the same already is refused as such where a value cannot come twice', () => {
  const promoted = versioned(3, 'x', { again: false }),
    same = { call: 0, end: 1, input: { op: 'promote', match: 3, value: 'x' }, output: { refused: 'same' } };
  assert.ok(checkKey([same], promoted).linearizable);
  assert.ok(!checkKey([{ ...same, input: { op: 'promote', match: 3, value: 'y' } }], promoted).linearizable);
});

test('numbers that leave some out are taken where the model says so', () => {
  const gaps = versioned(3, 'x', { again: false, gaps: true }),
    promote = (call, end, match, value, output) => ({ call, end, input: { op: 'promote', match, value }, output });
  assert.ok(checkKey([promote(0, 1, 3, 'y', { version: 36 }), read(2, 3, 36, 'y')], gaps).linearizable);
  assert.ok(checkKey([promote(0, 1, 3, 'y', undefined), read(2, 3, 36, 'y')], gaps).linearizable);
  assert.ok(!checkKey([promote(0, 1, 3, 'y', { version: 36 }), read(2, 3, 35, 'y')], gaps).linearizable);
  assert.ok(!checkKey([promote(0, 1, 3, 'y', { version: 2 })], gaps).linearizable);
});

test('a long history of clients at the same time, many of them without an answer, is decided', () => {
  const ops = [];
  for (let n = 1; n <= 150; n++) {
    const at = n * 10;
    ops.push(change(at, at + 25, n, `v${n}`, { version: n + 1 })); // beside the next two
    ops.push(change(at, at + 25, n - 1, `late ${n}`, { refused: 'changed' }));
    if (n % 5 === 0) ops.push(change(at, undefined, n, `lost ${n}`, undefined));
  }
  const end = read(9000, 9001, 151, 'v150');
  assert.ok(fits(...ops, end));
  assert.ok(!fits(...ops, end, read(9002, 9003, 150, 'v149')));
});

test('an outage that leaves fifty changes without an answer, any of which may come later, is decided', () => {
  const values = versioned(1, 'a', { again: false }),
    publish = (call, end, value, output) => ({ call, end, input: { op: 'publish', value }, output });
  const lost = Array.from({ length: 50 }, (_, n) => publish(n, undefined, n % 2 ? 'a' : 'b', undefined));
  const after_it = [read(100, 101, 1, 'a'), publish(102, 110, 'b', { version: 4 }), read(112, 113, 4, 'b')];
  assert.ok(checkKey([...lost, ...after_it], values).linearizable, 'b and a of the lost ones came in between');
  assert.ok(!checkKey([...lost, ...after_it, read(114, 115, 3, 'a')], values).linearizable);
});

/** Three clients of two sites through `spoil`, which may change a request before, or answer in the place of, the server. */
async function history(server, spoil) {
  const proxy = createServer(async (request, response) => {
    const body = [];
    for await (const chunk of request) body.push(chunk);
    const { method, url, headers } = request,
      forward = (more = {}) =>
        fetch(server.url + url, {
          method,
          headers: {
            ...Object.fromEntries(
              ['if-match', 'content-type'].flatMap((name) => (headers[name] ? [[name, headers[name]]] : [])),
            ),
            ...more,
          },
          body: body.length > 0 ? Buffer.concat(body) : undefined,
        }).then(async (answer) => ({
          status: answer.status,
          etag: answer.headers.get('etag') ?? '',
          text: await answer.text(),
        }));
    const { status, etag, text } = await (spoil?.(request, forward) ?? forward());
    response.writeHead(status, { etag, 'content-type': 'application/json' }).end(text);
  }).listen(0, '127.0.0.1');
  await once(proxy, 'listening');
  try {
    const url = `http://127.0.0.1:${proxy.address().port}`,
      historian = new Historian([url], 'none', Math.random, { rest_ms: 2 }),
      begun = {};
    const clients = [];
    for (const name of ['first', 'second']) {
      const made = await (
        await server.fetch('/api/v1/sites', { json: { name, origin: { lon: 3.7, lat: 51, h_m: 50 } } })
      ).json();
      begun[`site ${made.id}`] = [1, name];
      for (const who of ['a', 'b', 'c'])
        clients.push(historian.site(`${who} of ${name}`, made.id, () => historian.operations.length < 60));
    }
    await Promise.all(clients);
    assert.ok(historian.operations.length >= 60);
    return violations(historian.operations, modelOf(begun));
  } finally {
    proxy.closeAllConnections();
    proxy.close();
  }
}

test('a real server keeps what If-Match promises, and two bugs planted before it are found', async () => {
  const server = await startServer({
    args: ['--rate-per-s', '100000', '--rate-burst', '100000', '--storage-synchronous', 'normal'],
  });
  try {
    assert.deepEqual((await history(server)).map(shown), []);
    const lost = await history(server, async ({ method, url }, forward) => {
      if (method !== 'PATCH') return forward();
      return forward({ 'if-match': (await server.fetch(url)).headers.get('etag') });
    });
    assert.ok(lost.length > 0, 'a lost update');
    const old = new Map();
    let gets = 0;
    const stale = await history(server, async ({ method, url }, forward) => {
      if (method !== 'GET') return forward();
      const now = await forward();
      if (!old.has(url)) old.set(url, now);
      return ++gets % 10 === 0 ? old.get(url) : now;
    });
    assert.ok(stale.length > 0, 'a stale answer');
    assert.match(shown(stale[0]), /no order explains it/);
  } finally {
    await server.dispose();
  }
});
