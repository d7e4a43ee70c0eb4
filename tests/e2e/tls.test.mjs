// HTTPS and wss by a certificate of `anchord tls`, as curl, OpenSSL's s_client and a WebSocket client see them.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import WebSocket from 'ws';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord e2e tls '));
const at = (name) => join(folder, name);
const tls = (...args) => run(['tls', ...args]);
let server;

before(async () => {
  const made = await tls('init', '--dir', folder, '--name', 'hangar.local');
  assert.equal(made.code, 0, made.stderr);
  assert.match(made.stdout, /hangar\.local, localhost, 127\.0\.0\.1, ::1/);
  assert.match(made.stdout, /SHA-256 +([0-9A-F]{2}:){31}[0-9A-F]{2}/);
  server = await startServer({ auth: 'on', tls: { certificate: at('server.pem'), key: at('server.key') } });
});
after(async () => {
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** Runs a program: {code, stdout, stderr}, whatever the code. */
const program = (name, args, input) =>
  new Promise((done) => {
    const child = execFile(name, args, { timeout: 30_000 }, (error, stdout, stderr) =>
      done({ code: error ? (error.code ?? -1) : 0, stdout, stderr }),
    );
    child.stdin.end(input ?? '');
  });
const curl = (...args) => program('curl', ['-sS', '--max-time', '20', ...args]);
const s_client = (...args) =>
  program('openssl', ['s_client', '-connect', `127.0.0.1:${server.securePort}`, '-CAfile', at('ca.pem'), ...args]);
const serial = async () =>
  /serial=(\S+)/.exec((await program('openssl', ['x509', '-noout', '-serial'], (await s_client()).stdout)).stdout)[1];
const alarms = async () => (await (await server.fetch('/api/v1/alarms')).json()).items.map((one) => one.id);
const reload = () => process.kill(server.pid, 'SIGHUP');

test('keys are for their owner alone, and nothing is replaced unasked', async () => {
  for (const [name, mode] of [
    ['ca.key', 0o600],
    ['server.key', 0o600],
    ['ca.pem', 0o644],
    ['server.pem', 0o644],
  ])
    assert.equal(statSync(at(name)).mode & 0o777, mode, name);
  const before = readFileSync(at('ca.pem'), 'utf8');
  const again = await tls('init', '--dir', folder);
  assert.equal(again.code, 2);
  assert.match(again.stderr, /already exists: 'anchord tls renew'.*--force/);
  assert.equal(readFileSync(at('ca.pem'), 'utf8'), before);
  const other = mkdtempSync(join(tmpdir(), 'anchord e2e tls '));
  assert.equal((await tls('init', '--dir', other)).code, 0);
  assert.equal((await tls('init', '--dir', other, '--force')).code, 0);
  assert.equal((await tls('init', '--dir', other, '--force', '--name', 'a b')).code, 2);
  assert.equal((await tls('init', '--dir', other, '--force', '--name', 'hangar.local')).code, 0);
  assert.doesNotMatch((await tls('renew', '--dir', other)).stdout, /No longer/);
  assert.match((await tls('renew', '--dir', other, '--name', '192.0.2.7')).stdout, /No longer for hangar\.local:/);
  rmSync(other, { recursive: true });
});

test('curl takes it with the authority and not without', async () => {
  const answer = await curl('--cacert', at('ca.pem'), `${server.secureUrl}/readyz`);
  assert.equal(answer.code, 0, answer.stderr);
  assert.match(answer.stdout, /"status":"ok"|"ready"/);
  assert.equal((await curl(`${server.secureUrl}/readyz`)).code, 60); // "Peer certificate cannot be authenticated"
  const named = ['--cacert', at('ca.pem'), '--connect-to', `::127.0.0.1:${server.securePort}`];
  assert.equal((await curl(...named, 'https://evil.example/readyz')).code, 60);
  const plain = await curl(`http://127.0.0.1:${server.securePort}/readyz`);
  assert.match(plain.stdout, /uses HTTPS/);
});

test('TLS 1.2 and 1.3 verify, older versions and weak ciphers get nowhere', async () => {
  for (const version of ['-tls1_2', '-tls1_3'])
    assert.match((await s_client(version, '-verify_hostname', 'hangar.local')).stdout, /Verify return code: 0 \(ok\)/);
  for (const old of ['-tls1', '-tls1_1']) {
    const { code, stdout } = await s_client(old, '-cipher', 'ALL:@SECLEVEL=0');
    assert.notEqual(code, 0, old);
    assert.match(stdout, /Cipher is \(NONE\)/);
  }
  assert.match((await s_client('-tls1_2', '-cipher', 'AES128-SHA:@SECLEVEL=0')).stdout, /Cipher is \(NONE\)/);
});

test('a login over TLS gets a cookie that leaves by TLS alone', async () => {
  const login = (url) =>
    curl(
      '-D',
      '-',
      '--cacert',
      at('ca.pem'),
      '-H',
      'Content-Type: application/json',
      '-d',
      JSON.stringify({ token: server.token }),
      `${url}/api/v1/session`,
    );
  assert.match((await login(server.secureUrl)).stdout, /set-cookie: .*; Secure/i);
  const plain = await login(server.url);
  assert.match(plain.stdout, /set-cookie: /i);
  assert.doesNotMatch(plain.stdout, /; Secure/i);
});

test('a certificate is exchanged while a stream runs, and a bad one is not', async () => {
  const socket = new WebSocket(`wss://127.0.0.1:${server.securePort}/api/v1/ws`, 'anchord.v1', {
    ca: readFileSync(at('ca.pem')),
    headers: { authorization: `Bearer ${server.token}` },
  });
  let beats = 0;
  let closed = false;
  socket.on('message', (data) => (beats += JSON.parse(String(data)).op === 'hb' ? 1 : 0));
  socket.on('close', () => (closed = true));
  await new Promise((done, fail) => socket.once('open', done).once('error', fail));
  const beat = async () => {
    const seen = beats;
    await eventually('a heartbeat over wss', () => beats > seen);
  };
  await beat();
  const first = await serial();

  assert.equal((await tls('renew', '--dir', folder)).code, 0);
  reload();
  await eventually('the new certificate is served', async () => (await serial()) !== first);
  const second = await serial();
  await beat();

  const good = readFileSync(at('server.pem'), 'utf8');
  writeFileSync(at('server.pem'), 'rubbish');
  reload();
  await eventually('the alarm about it', async () => (await alarms()).includes('tls.not_reloaded'));
  assert.match(server.log, /certificate was rejected, the previous one is still served.*server\.pem/);
  assert.equal(await serial(), second);
  await beat();

  writeFileSync(at('server.pem'), good);
  reload();
  await eventually('the end of the alarm', async () => !(await alarms()).includes('tls.not_reloaded'));
  await beat();
  assert.equal(closed, false);
  socket.close();
});

test('a certificate that ends within 30 days is an alarm, and renewing ends it', async () => {
  assert.equal((await tls('renew', '--dir', folder, '--days', '20')).code, 0);
  reload();
  await eventually('the alarm', async () => (await alarms()).includes('tls.expires'));
  const shown = await tls('show', at('server.pem'));
  assert.match(shown.stdout, /for +hangar\.local.*\n[^]*expires on/);
  const looked = await run([
    'doctor',
    '--data-dir',
    server.dataDir,
    '--tls-certificate',
    at('server.pem'),
    '--tls-key',
    at('server.key'),
  ]);
  assert.match(looked.stdout, /warning +certificate +The TLS certificate of hangar\.local expires on/);
  assert.equal((await tls('renew', '--dir', folder)).code, 0);
  reload();
  await eventually('the end of the alarm', async () => !(await alarms()).includes('tls.expires'));
  const metrics = await (await server.fetch('/metrics')).text();
  const end = Number(/^anchord_tls_certificate_expiry_seconds (\S+)/m.exec(metrics)[1]);
  assert.ok(end - Date.now() / 1000 > 390 * 86_400, `${end}`);
});

test("the program's own commands speak HTTPS", async () => {
  const asked = (env) => run(['healthcheck', '--url', server.secureUrl], { env });
  const trusting = await asked({ ANCHORD_CA_FILE: at('ca.pem') });
  assert.equal(trusting.code, 0, trusting.stderr);
  const stranger = await asked({});
  assert.equal(stranger.code, 1);
  assert.match(stranger.stderr, /ANCHORD_CA_FILE/);
});
