// Webhooks by https to a receiver of a plant's own authority, checked by the library that Standard Webhooks publishes for receivers.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createServer } from 'node:https';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { Webhook } from 'standardwebhooks';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord webhooks '));
const at = (name) => join(folder, name);
const letters = [];
let receiver, url;

before(async () => {
  const made = await run(['tls', 'init', '--dir', folder]);
  assert.equal(made.code, 0, made.stderr);
  const files = { cert: readFileSync(at('server.pem')), key: readFileSync(at('server.key')) };
  receiver = createServer(files, (request, response) => {
    let body = '';
    request.setEncoding('utf8').on('data', (part) => (body += part));
    request.on('end', () => {
      letters.push({ headers: request.headers, body });
      response.writeHead(204).end();
    });
  });
  await new Promise((done) => receiver.listen(0, '127.0.0.1', done));
  url = `https://127.0.0.1:${receiver.address().port}/hook`;
});
after(() => {
  receiver?.closeAllConnections();
  receiver?.close();
  rmSync(folder, { recursive: true, force: true });
});

async function with_webhook(args, use) {
  const server = await startServer({ auth: 'on', args: ['--webhooks-allow-private', ...args] });
  try {
    const made = await server.fetch('/api/v1/webhooks', {
      json: { name: 'plant', url, events: ['mission.finished'] },
    });
    assert.equal(made.status, 201, await made.clone().text());
    await use(server, await made.json());
  } finally {
    await server.dispose();
  }
}
const newest = async (server, hook) =>
  (await (await server.fetch(`/api/v1/webhooks/${hook.id}/deliveries`)).json()).items[0];

test('an event arrives by https, and the library of the standard accepts its signature', async () => {
  await with_webhook(['--webhooks-ca-file', at('ca.pem')], async (server, hook) => {
    const mission = await (
      await server.fetch('/api/v1/missions', {
        json: { name: 'a', frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
      })
    ).json();
    const finished = await server.fetch(`/api/v1/missions/${mission.id}/actions`, { json: { action: 'finish' } });
    assert.equal(finished.status, 200, await finished.text());
    await eventually('the event', () => letters.length > 0);
    const [{ headers, body }] = letters;
    const event = new Webhook(hook.secret).verify(body, headers);
    assert.equal(event.specversion, '1.0');
    assert.equal(event.type, 'anchord.mission.finished');
    assert.equal(event.subject, `missions/${mission.id}`);
    assert.throws(() => new Webhook(hook.secret).verify(body.replace('finished', 'started'), headers));
    assert.equal(
      (
        await eventually('the log', async () => {
          const one = await newest(server, hook);
          return one.state === 'delivered' && one;
        })
      ).status,
      204,
    );
  });
});

test('a receiver whose authority is not known gets nothing, and the log says why', async () => {
  const before = letters.length;
  await with_webhook([], async (server, hook) => {
    assert.equal((await server.fetch(`/api/v1/webhooks/${hook.id}/test`, { method: 'POST' })).status, 202);
    const told = await eventually('an attempt', async () => {
      const one = await newest(server, hook);
      return one?.fault && one;
    });
    assert.equal(told.state, 'pending');
    assert.match(told.fault, /certificate|SSL/i);
  });
  assert.equal(letters.length, before);
});
