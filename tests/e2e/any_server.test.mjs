// Two servers of one real PostgreSQL of which each says where it is reached: whichever is asked, the one that has the database answers.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { LiveClient } from './live.mjs';
import { free_tcp_port } from './ports.mjs';
import { startPostgres } from './postgres.mjs';
import { eventually, run, Server } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord any server '));
const at = (name) => join(folder, name);
let postgres, holder, waiting, token;

/** A server that may have the database or wait for it; `url`: where the other one reaches it. */
async function start(name, { port, secure }) {
  const server = new Server({
    auth: 'on',
    args: [
      ...['--standby', '--standby-url', secure ? `https://127.0.0.1:${secure}` : `http://127.0.0.1:${port}`],
      ...['--database', postgres.url(name), '--trusted-proxies', '127.0.0.1', '--allowed-hosts', 'anchord.example'],
    ],
    env: postgres.env,
    tls: secure ? { certificate: at('server.pem'), key: at('server.key') } : undefined,
  });
  Object.assign(server, { port, securePort: secure, token });
  const began = server.start(60_000);
  began.catch(() => {});
  await eventually('it listens, or passes on', () => /"listening"|passing requests on|msg=listening/.test(server.log), 30_000); // prettier-ignore
  if (server.log.includes('passing requests on')) server.port = port;
  else await began;
  token ??= server.token;
  server.token = token;
  server.port = port;
  return server;
}
const there = (server) => eventually('it has the database', () => /listening/.test(server.log), 30_000);

before(async () => {
  const made = await run(['tls', 'init', '--dir', folder, '--name', 'anchord.example']);
  assert.equal(made.code, 0, made.stderr);
  postgres = await startPostgres();
  for (const name of ['plain', 'sealed']) await postgres.psql(`CREATE DATABASE ${name}`);
  holder = await start('plain', { port: await free_tcp_port() });
  waiting = await start('plain', { port: await free_tcp_port() });
});
after(async () => {
  for (const server of [holder, waiting]) await server?.dispose();
  await postgres?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

const curl = (...options) =>
  new Promise((done) =>
    execFile(
      'curl',
      ['-sS', '--max-time', '20', '-H', `Authorization: Bearer ${token}`, ...options],
      (error, stdout, stderr) => done({ code: error?.code ?? 0, stdout, stderr }),
    ),
  );
const flight = (name) => ({ name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] });
const rows = (from, n) =>
  Array.from({ length: n }, (_, i) =>
    JSON.stringify({
      t_us: 1_790_000_000_000_000 + (from + i) * 1000,
      seq: from + i,
      tag: '0x6e01',
      anchor: '0x6a21',
      distance_m: 10,
    }),
  ).join('\n');
const upload = (server, mission, from, n) =>
  server.fetch(`/api/v1/ranges?mission=${mission}`, {
    method: 'POST',
    headers: { 'content-type': 'application/x-ndjson' },
    body: rows(from, n),
  });

test('the one that waits answers as the one that has the database does: rows, pages, the live stream', async () => {
  const made = await waiting.fetch('/api/v1/missions', { json: flight('asked of the other one') });
  assert.equal(made.status, 201);
  const { id } = await made.json();
  assert.equal((await holder.fetch(`/api/v1/missions/${id}`)).status, 200);
  const client = await LiveClient.open(waiting);
  client.send({ op: 'sub', id: 1, topic: 'events' });
  await client.next('ack', (message) => message.op === 'ack');
  const sent = await upload(waiting, id, 0, 20_000);
  assert.deepEqual([sent.status, (await sent.json()).accepted], [200, 20_000]);
  await client.next('a heartbeat', (message) => message.op === 'hb');
  client.socket.close();
  const page = await (await waiting.fetch(`/api/v1/ranges?mission=${id}&count=exact&limit=1`)).json();
  assert.equal(page.total, 20_000, JSON.stringify(page));
  assert.match(await (await waiting.fetch('/')).text(), /<html/i);
});

test('it says who asked: neither an address nor a header of the client passes for another one', async () => {
  const url = `http://127.0.0.1:${waiting.port}/api/v1/tokens`;
  const made = await curl(
    ...['--interface', '127.0.0.9', '-H', 'X-Forwarded-For: 192.0.2.66', '-H', 'Content-Type: application/json'],
    ...['-d', JSON.stringify({ name: 'from 9', roles: ['viewer'] }), url],
  );
  assert.match(made.stdout, /"from 9"/);
  const audit = await (await holder.fetch('/api/v1/audit?limit=20')).json();
  assert.ok(audit.items.some((row) => row.from === '127.0.0.9'), JSON.stringify(audit.items)); // prettier-ignore
  assert.ok(!JSON.stringify(audit).includes('192.0.2.66'));
});

test('a balancer that looks at nothing (nginx, in turns) is answered by both', async () => {
  const port = await free_tcp_port();
  const temporary = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi'].map((one) => `${one}_temp_path "${at(one)}";`);
  writeFileSync(
    at('nginx.conf'),
    `${process.getuid() === 0 ? 'user root;' : ''} daemon off; worker_processes 1; pid "${at('nginx.pid')}"; error_log stderr; events {}
     http { access_log off; ${temporary.join(' ')}
       upstream servers { server 127.0.0.1:${holder.port}; server 127.0.0.1:${waiting.port}; }
       server { listen 127.0.0.1:${port}; location / { proxy_pass http://servers; proxy_set_header Host localhost; } } }\n`,
  );
  const nginx = spawn('/usr/sbin/nginx', ['-p', folder, '-c', at('nginx.conf')], { stdio: 'ignore' });
  try {
    await eventually('nginx answers', () => fetch(`http://127.0.0.1:${port}/readyz`).then((r) => r.ok, () => false)); // prettier-ignore
    for (let i = 0; i < 20; ++i) {
      const made = await fetch(`http://127.0.0.1:${port}/api/v1/missions`, {
        method: 'POST',
        headers: { authorization: `Bearer ${token}`, 'content-type': 'application/json' },
        body: JSON.stringify(flight(`in turns ${i}`)),
      });
      assert.equal(made.status, 201, `request ${i}`);
    }
  } finally {
    nginx.kill('SIGTERM');
  }
});

test('when the one that has the database is killed the other one says so, takes over on the same address and has every row', async () => {
  const { id } = await (await waiting.fetch('/api/v1/missions', { json: flight('killed') })).json();
  let acknowledged = 0,
    unreachable = 0;
  const send = async () => {
    try {
      const answer = await upload(waiting, id, acknowledged, 100);
      if (answer.status === 503) {
        assert.ok(Number(answer.headers.get('retry-after')) > 0);
        if (/stands by/.test((await answer.json()).detail)) ++unreachable;
        return;
      }
      const { accepted = 0, duplicates = 0 } = await answer.json();
      if (accepted + duplicates === 100) acknowledged += 100;
    } catch {
      // A connection that was cut: nothing was acknowledged on it.
    }
  };
  for (let i = 0; i < 20; ++i) await send();
  assert.equal(acknowledged, 2000);
  await holder.kill();
  const taken = async () => {
    await send();
    return acknowledged >= 2500;
  };
  await eventually('the other one takes the rows', taken, 30_000, 50);
  assert.ok(unreachable > 0, 'it answered in between');
  await there(waiting);
  const page = await (await waiting.fetch(`/api/v1/ranges?mission=${id}&count=exact&limit=1`)).json();
  assert.equal(page.total, acknowledged);
  const back = await start('plain', { port: holder.port });
  [holder, waiting] = [waiting, back];
  assert.equal((await waiting.fetch(`/api/v1/missions/${id}`)).status, 200, 'and the killed one passes on to it');
});

test('HTTPS goes through sealed, to the certificate of the one that has the database', async () => {
  token = undefined; // a database of its own, with a token of its own
  const one = await start('sealed', { port: await free_tcp_port(), secure: await free_tcp_port() });
  const two = await start('sealed', { port: await free_tcp_port(), secure: await free_tcp_port() });
  try {
    const asked = await curl(
      ...['--cacert', at('ca.pem'), '--resolve', `anchord.example:${two.securePort}:127.0.0.1`],
      `https://anchord.example:${two.securePort}/api/v1/missions`,
    );
    assert.equal(asked.code, 0, asked.stderr);
    assert.match(asked.stdout, /"items":\[\]/);
    const closed = await curl(`http://127.0.0.1:${two.port}/readyz`);
    assert.equal(closed.code, 7, 'its plain address is not passed on: nobody knows where to');
  } finally {
    for (const server of [one, two]) await server.dispose();
    token = holder.token;
  }
});

test('settings that do not go together are refused with the reason', async () => {
  const serve = (...args) =>
    run(['serve', '--listen', '127.0.0.1:0', '--data-dir', at('refused'), ...args], { env: postgres.env });
  const cases = [
    [['--standby-url', 'http://127.0.0.1:1'], /standby_url: is of a server with --standby/],
    [
      ['--standby', '--database', postgres.url('plain'), '--standby-url', '10.0.0.7:8420'],
      /standby_url: '10.0.0.7:8420' is not the address of a server/,
    ],
    [
      ['--standby', '--database', postgres.url('plain'), '--standby-url', 'https://a:8443'],
      /standby_url: no address of listen speaks https/,
    ],
  ];
  for (const [args, why] of cases) {
    const refused = await serve(...args);
    assert.equal(refused.code, 2, refused.stderr);
    assert.match(refused.stderr, why);
  }
});
