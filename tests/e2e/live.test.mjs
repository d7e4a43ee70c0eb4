// The stream over a real socket: hello, subscribe, snapshot, data; resume by epoch and seq; a reader that stalls.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { ndjson, simulatedFlight } from './flight.mjs';
import { LiveClient } from './live.mjs';
import { startServer } from './server.mjs';

let server,
  flight,
  mission,
  delivered = 0;

before(async () => {
  server = await startServer();
  flight = await simulatedFlight({ duration: 60 });
  flight.ranges = flight.ranges.filter((row) => row.distance_m > 0);
  const answer = await server.fetch('/api/v1/missions', { json: flight.mission });
  mission = (await answer.json()).id;
});
after(() => server?.dispose());

const post = async (path, rows) => {
  const answer = await server.fetch(`${path}?mission=${mission}`, {
    method: 'POST',
    headers: { 'content-type': 'application/x-ndjson' },
    body: ndjson(rows),
  });
  const result = await answer.json();
  assert.equal(result.accepted, rows.length, JSON.stringify(result).slice(0, 400));
};
let fixesDelivered = 0;
/** The next ranges in the order of the flight, second by second, each second with the fixes up to just after it. */
async function deliver(count) {
  for (const end = delivered + count; delivered < end;) {
    const rows = flight.ranges.slice(delivered, Math.min(end, delivered + 20));
    delivered += rows.length;
    const until = rows.at(-1).t_us + 200_000,
      from = fixesDelivered;
    while (fixesDelivered < flight.fixes.length && flight.fixes[fixesDelivered].t_us <= until) fixesDelivered++;
    if (fixesDelivered > from) await post('/api/v1/fixes', flight.fixes.slice(from, fixesDelivered));
    await post('/api/v1/ranges', rows);
  }
}
const subscribe = async (client, topic, since) => {
  const id = client.messages.length + 1000;
  client.send({ op: 'sub', id, topic, ...(since ? { since } : {}) });
  return client.next(`ack of ${topic}`, (m) => m.op === 'ack' && m.id === id);
};

test('hello comes first, with epoch, topics and the time', async () => {
  const client = await LiveClient.open(server);
  const hello = await client.next('hello', () => true);
  assert.equal(hello.op, 'hello');
  assert.ok(hello.epoch);
  // With the commit, so that a page sees an upgrade within one version too.
  const { version, git } = await (await server.fetch('/version')).json();
  assert.equal(hello.server, `anchord ${version}+${git}`);
  assert.ok(hello.topics.includes('ranges') && hello.topics.includes('anchors.estimates'), JSON.stringify(hello));
  assert.ok(Math.abs(hello.t_us / 1000 - Date.now()) < 5000);
  await client.next('heartbeat', (m) => m.op === 'hb');
  await client.close();
});

test('what is delivered arrives with seq after seq, and estimates follow', async () => {
  const client = await LiveClient.open(server);
  const ranges = await subscribe(client, 'ranges');
  const estimates = await subscribe(client, 'anchors.estimates');
  await deliver(500); // half of the flight: enough sides of the building for a first estimate
  await client.next('a range', (m) => m.op === 'data' && m.sub === ranges.sub);
  // The snapshot may still be empty: the first anchors are found with the rows just delivered.
  await client.next(
    'an estimate',
    (m) => (m.op === 'data' || m.op === 'snap') && m.sub === estimates.sub && JSON.stringify(m.data).includes('0x6a2'),
  );
  const firstCount = client.messages.length; // before: the last of them may come sooner than the answer of their POST
  await deliver(150);
  await client.next('more ranges', (m) => m.op === 'data' && m.sub === ranges.sub, { from: firstCount });
  const data = client.messages.filter((m) => m.op === 'data' && m.sub === ranges.sub);
  for (let i = 1; i < data.length; i++) {
    assert.ok(data[i].seq > data[i - 1].seq, 'seq grows');
    assert.equal(data[i].prev, data[i - 1].seq, 'prev is the seq sent before');
  }
  await client.close();
});

test('a client that comes back with epoch and seq gets what it missed, once', async () => {
  const first = await LiveClient.open(server);
  const hello = await first.next('hello', (m) => m.op === 'hello');
  const { sub } = await subscribe(first, 'ranges');
  await deliver(30);
  const last = await first.next('data', (m) => m.op === 'data' && m.sub === sub);
  await first.close();
  await deliver(30);
  const second = await LiveClient.open(server);
  const ack = await subscribe(second, 'ranges', { epoch: hello.epoch, seq: last.seq });
  assert.equal(ack.recovered, true, JSON.stringify(ack));
  const missed = await second.next('what was missed', (m) => m.op === 'data' && m.sub === ack.sub);
  assert.equal(missed.prev, last.seq, 'from the first that was missed');
  assert.ok(missed.seq > last.seq);
  await second.close();
});

test('an epoch of another life is not recovered: a restart makes a new one', async () => {
  const before = await LiveClient.open(server);
  const old = await before.next('hello', (m) => m.op === 'hello');
  await server.restart();
  assert.ok([1001, 4010, 1006].includes((await before.closed).code));
  const client = await LiveClient.open(server);
  const hello = await client.next('hello', (m) => m.op === 'hello');
  assert.notEqual(hello.epoch, old.epoch);
  const ack = await subscribe(client, 'ranges', { epoch: old.epoch, seq: 1 });
  assert.equal(ack.recovered, false);
  await client.close();
});

test('nonsense gets an err with a problem, an unknown topic too, and the conversation goes on', async () => {
  const client = await LiveClient.open(server);
  client.send({ op: 'sub', id: 7, topic: 'no.such.topic' });
  const err = await client.next('err', (m) => m.op === 'err' && m.id === 7);
  assert.ok(err.problem.status >= 400);
  await subscribe(client, 'system');
  await client.close();
});

test('a foreign page is refused at the door', async () => {
  await assert.rejects(LiveClient.open(server, { headers: { origin: 'https://elsewhere.example' } }), { status: 403 });
});

test('a reader that stalls harms nobody else, and hears of its gap', async () => {
  const stalled = await LiveClient.open(server),
    reader = await LiveClient.open(server);
  const slow = await subscribe(stalled, 'ranges'),
    fast = await subscribe(reader, 'ranges');
  stalled.socket._socket.pause();
  // Far more than the socket buffers and the queue of one connection hold: the same instants, other sequence numbers.
  const one = flight.ranges.slice(0, 1000);
  for (let round = 1; round <= 30; round++) {
    const rows = one.map((row) => ({ ...row, seq: row.seq + round * 1_000_000 }));
    const answer = await server.fetch(`/api/v1/ranges?mission=${mission}`, {
      method: 'POST',
      headers: { 'content-type': 'application/x-ndjson' },
      body: ndjson(rows),
    });
    assert.equal(answer.status, 200);
    await answer.arrayBuffer();
  }
  await reader.next('data for the one who reads', (m) => m.op === 'data' && m.sub === fast.sub);
  assert.equal((await server.fetch('/healthz')).status, 200);
  stalled.socket._socket.resume();
  await stalled.next('data or gap after the stall', (m) => (m.op === 'gap' || m.op === 'data') && m.sub === slow.sub, {
    deadlineMs: 20_000,
  });
  const seen = stalled.messages.filter((m) => m.sub === slow.sub && (m.op === 'data' || m.op === 'gap'));
  let last = null;
  for (const message of seen) {
    if (message.op === 'data' && last !== null)
      assert.ok(message.prev === last || seen.some((m) => m.op === 'gap'), 'a hole without a gap message');
    last = message.op === 'data' ? message.seq : message.to_seq;
  }
  stalled.terminate();
  await reader.close();
});
