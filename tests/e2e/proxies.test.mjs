// The samples of docs/examples before a real server: nginx and Caddy of Debian, with their addresses, ports and certificate replaced.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, truncateSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import WebSocket from 'ws';
import { free_tcp_port } from './ports.mjs';
import { eventually, root, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord-proxies-'));
const at = (name) => join(folder, name);
const sample = (name) => readFileSync(join(root, 'docs/examples', name), 'utf8');
let server, floor;

/** The text with each of these replaced, which must be there. */
function changed(text, ...pairs) {
  for (const [from, to] of pairs) {
    assert.ok(text.includes(from), `the sample has no '${from}'`);
    text = text.replaceAll(from, to);
  }
  return text;
}

before(async () => {
  const made = await run(['tls', 'init', '--dir', folder, '--name', 'anchord.example']);
  assert.equal(made.code, 0, made.stderr);
  server = await startServer({
    auth: 'on',
    args: ['--allowed-hosts', 'anchord.example', '--trusted-proxies', '127.0.0.1'],
  });
  const post = async (path, json) => (await server.fetch(path, { json })).json();
  const site = await post('/api/v1/sites', { name: 'S', origin: { lon: 3.7, lat: 51, h_m: 50 } });
  const building = await post('/api/v1/buildings', { site: site.id, name: 'B' });
  floor = await post('/api/v1/floors', { building: building.id, name: 'F', level: 0 });
});
after(async () => {
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

async function behind(program, args, port, use) {
  const env = { ...process.env, HOME: folder, XDG_DATA_HOME: folder, XDG_CONFIG_HOME: folder };
  const child = spawn(program, args, { cwd: folder, env, stdio: ['ignore', 'pipe', 'pipe'] });
  let output = '',
    failed = null;
  child.on('error', (error) => (failed = error));
  for (const stream of [child.stdout, child.stderr]) stream.setEncoding('utf8').on('data', (part) => (output += part));
  const url = `https://anchord.example:${port}`;
  const curl = (...options) =>
    new Promise((done) => {
      const base = [
        '-sS',
        '--max-time',
        '60',
        '--cacert',
        at('ca.pem'),
        '--resolve',
        `anchord.example:${port}:127.0.0.1`,
      ];
      execFile('curl', [...base, ...options], { maxBuffer: 1 << 24 }, (error, stdout, stderr) =>
        done({ code: error?.code ?? 0, stdout, stderr }),
      );
    });
  try {
    await eventually(
      `${program} answers`,
      async () => {
        if (failed || child.exitCode !== null) throw new Error(`${program} ended: ${failed ?? output}`);
        return (await curl('-f', `${url}/readyz`)).code === 0;
      },
      20_000,
      100,
    );
    await use(url, curl, port);
  } finally {
    const ended = new Promise((done) => child.once('exit', done));
    child.kill('SIGTERM');
    await ended;
  }
}

/** What a client must have through any proxy. */
async function everything(url, curl, port) {
  const bearer = ['-H', `Authorization: Bearer ${server.token}`],
    json = ['-H', 'Content-Type: application/json'];
  const login = await curl('-D', '-', ...json, '-d', JSON.stringify({ token: server.token }), `${url}/api/v1/session`);
  assert.match(login.stdout, /set-cookie: .*; Secure/i, 'the server knows that the client speaks HTTPS');
  const page = JSON.parse((await curl(...bearer, `${url}/ogc`)).stdout);
  for (const { href } of page.links) assert.ok(href.startsWith(`${url}/`), `${href}: links are those of the client`);

  const plan = `/api/v1/floors/${floor.id}/plan`;
  writeFileSync(at('plan'), Buffer.alloc(40 << 20));
  const etag = (await server.fetch(plan.slice(0, -5))).headers.get('etag');
  const sent = await curl(
    '-X',
    'PUT',
    ...bearer,
    '-H',
    `If-Match: ${etag}`,
    '-H',
    'Content-Type: image/png',
    '--data-binary',
    `@${at('plan')}`,
    '-w',
    '\n%{http_code}',
    url + plan,
  );
  assert.match(sent.stdout, /not a PNG, JPEG[^]*\n415$/, '40 MB came to the server, which looked at them');

  // Sparse: a flight bundle is the largest body, and this is none.
  writeFileSync(at('bundle'), '');
  truncateSync(at('bundle'), 70 << 20);
  const bundle = await curl(
    ...bearer,
    '-H',
    'Content-Type: application/vnd.anchord.bundle+zip',
    '--data-binary',
    `@${at('bundle')}`,
    url + '/api/v1/bundles',
  );
  assert.match(bundle.stdout, /Nothing was imported/, '70 MB came to the server, which looked at them');

  const socket = new WebSocket(`wss://anchord.example:${port}/api/v1/ws`, 'anchord.v1', {
    ca: readFileSync(at('ca.pem')),
    headers: { authorization: `Bearer ${server.token}` },
    lookup: (_, { all }, answer) =>
      all ? answer(null, [{ address: '127.0.0.1', family: 4 }]) : answer(null, '127.0.0.1', 4),
  });
  let beats = 0,
    text = '';
  socket.on('message', (data) => {
    text += String(data);
    beats += JSON.parse(String(data)).op === 'hb' ? 1 : 0;
  });
  await new Promise((done, fail) => socket.once('open', done).once('error', fail));
  socket.send(JSON.stringify({ op: 'sub', id: 1, topic: 'events' }));
  await eventually('heartbeats', () => beats >= 2 && text.includes('"ack"'));
  const mission = { name: `flight ${port}`, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] };
  const made = await curl(...bearer, ...json, '-d', JSON.stringify(mission), `${url}/api/v1/missions`);
  const { id } = JSON.parse(made.stdout);
  await curl(...bearer, ...json, '-d', '{"action":"finish"}', `${url}/api/v1/missions/${id}/actions`);
  await eventually('the event of its end', () => text.includes(id));
  socket.close();

  const address = `${url}/api/v1/missions/${id}/bundle`;
  await curl(...bearer, '-o', at('whole'), address);
  const whole = readFileSync(at('whole'));
  await curl(...bearer, '-r', '0-699', '-o', at('part'), address);
  assert.equal(readFileSync(at('part')).length, 700);
  const rest = await curl(...bearer, '--continue-at', '-', '-o', at('part'), '-w', '%{http_code}', address);
  assert.deepEqual([rest.code, rest.stdout], [0, '206'], rest.stderr);
  assert.ok(readFileSync(at('part')).equals(whole), 'the same bytes as without a cut');
  const beyond = await curl(...bearer, '-r', `${whole.length}-`, '-D', '-', '-o', at('part'), address);
  assert.match(beyond.stdout, new RegExp(`^HTTP/\\S+ 416[^]*content-range: bytes \\*/${whole.length}\r\n`, 'i'));
}

test('nginx with the sample of the documentation', async () => {
  const port = await free_tcp_port();
  const site = changed(
    sample('nginx.conf'),
    ['listen 443 ssl', `listen 127.0.0.1:${port} ssl`],
    ['/etc/ssl/anchord.example.pem', at('server.pem')],
    ['/etc/ssl/private/anchord.example.key', at('server.key')],
    ['127.0.0.1:8420;', `127.0.0.1:${server.port};`],
  );
  const temporary = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi']
    .map((one) => `${one}_temp_path ${at(one)};`)
    .join(' ');
  const user = process.getuid() === 0 ? 'user root;' : '';
  writeFileSync(
    at('nginx.conf'),
    `${user} daemon off; worker_processes 1; pid ${at('nginx.pid')}; error_log stderr; events {}\nhttp { access_log off; ${temporary}\n${site}\n}\n`,
  );
  await behind('/usr/sbin/nginx', ['-p', folder, '-c', at('nginx.conf')], port, everything);
});

test('Caddy with the sample of the documentation', async () => {
  const port = await free_tcp_port();
  const site = changed(
    sample('Caddyfile'),
    [
      '\nanchord.example {',
      `\nhttps://anchord.example:${port} {\n\tbind 127.0.0.1\n\ttls ${at('server.pem')} ${at('server.key')}`,
    ],
    ['127.0.0.1:8420 {', `127.0.0.1:${server.port} {`],
  );
  // No port 80, no second listener for its own administration.
  writeFileSync(at('Caddyfile'), `{\n\tadmin off\n\tauto_https disable_redirects\n}\n${site}`);
  await behind('/usr/bin/caddy', ['run', '--adapter', 'caddyfile', '--config', at('Caddyfile')], port, everything);
});

test('HAProxy that passes bytes on says who connected, by both versions of the PROXY protocol', async () => {
  for (const word of ['send-proxy', 'send-proxy-v2']) {
    const port = await free_tcp_port(),
      stats = await free_tcp_port();
    writeFileSync(
      at('tcp.cfg'),
      `defaults\n mode tcp\n timeout connect 2s\n timeout client 30s\n timeout server 30s\n` +
        `listen anchord\n bind 127.0.0.1:${port}\n server one 127.0.0.1:${server.port} ${word} check\n` +
        `listen stats\n mode http\n bind 127.0.0.1:${stats}\n stats enable\n stats uri /\n`,
    );
    const haproxy = spawn('haproxy', ['-f', at('tcp.cfg'), '-db'], { stdio: 'ignore' });
    try {
      const name = `by ${word}`,
        client = `127.0.0.${word.length}`;
      // From another address of the loopback network, which is no trusted proxy.
      const ask = () =>
        new Promise((done) =>
          execFile(
            'curl',
            [
              ...['-sS', '--max-time', '10', '--interface', client, '-H', `Authorization: Bearer ${server.token}`],
              ...['-H', 'Content-Type: application/json', '-H', 'X-Forwarded-For: 192.0.2.66'],
              ...['-d', JSON.stringify({ name, roles: ['viewer'] }), `http://127.0.0.1:${port}/api/v1/tokens`],
            ],
            (error, stdout) => done(error ? null : JSON.parse(stdout)),
          ),
        );
      let made;
      await eventually(`${word}: HAProxy answers`, async () => (made = await ask()) !== null);
      assert.equal(made.name, name, JSON.stringify(made));
      const audit = await (await server.fetch('/api/v1/audit?limit=50')).json();
      assert.ok(
        audit.items.some((row) => row.from === client),
        JSON.stringify(audit.items.slice(-3)),
      );
      assert.ok(!JSON.stringify(audit).includes('192.0.2.66'), 'a client cannot say for whom it asks');
    } finally {
      haproxy.kill('SIGTERM');
    }
  }
});
