// What a person or a script sees of the program itself: words on stdout, exit codes.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { randomBytes } from 'node:crypto';
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { run, startServer } from './server.mjs';

test('version prints the name and a version', async () => {
  const { code, stdout } = await run(['version']);
  assert.equal(code, 0);
  assert.match(stdout, /^anchord \d+\.\d+\.\d+/);
  assert.deepEqual(await run(['--version']), { code, stdout, stderr: '' });
});

test('without a subcommand all of them are named, on stderr', async () => {
  const { code, stdout, stderr } = await run([]);
  assert.deepEqual([code, stdout], [2, '']);
  for (const word of ['serve', 'devices', 'decode', 'solve']) assert.match(stderr, new RegExp(`^ +${word} `, 'm'));
});

test('a command or option that does not exist ends with 2 and names the nearest one', async () => {
  for (const [args, said] of [
    [['fly-me-to-the-moon'], /there is no command 'fly-me-to-the-moon'\n/],
    [['sovle', 'folder'], /there is no command 'sovle'; did you mean 'solve'\?/],
    [['simulate', 'flihgt'], /there is no command 'flihgt' of simulate; did you mean 'flight'\?/],
    [['token', 'lst'], /there is no command 'lst' of token; did you mean 'list'\?/],
    [['serve', '--lisen', '127.0.0.1:1'], /there is no option '--lisen' of serve; did you mean '--listen'\?/],
    [['solve', 'folder', '--dim=2'], /there is no option '--dim' of solve; did you mean '--dims'\?/],
    [['conf\u001b[2Jig'], /there is no command 'conf/],
  ]) {
    const { code, stdout, stderr } = await run(args);
    assert.deepEqual([code, stdout], [2, ''], args.join(' '));
    assert.match(stderr, said);
    assert.ok(!stderr.includes('\u001b'), 'what a terminal would obey');
  }
});

test('no command that only reads makes a data folder', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  const none = join(folder, 'none');
  try {
    for (const args of [
      ['token', 'list'],
      ['token', 'create', '--name', 'x', '--role', 'viewer'],
      ['backup'],
      ['devices', 'list'],
      ['doctor'],
    ]) {
      const { stdout, stderr } = await run([...args, '--data-dir', none]);
      assert.ok(!existsSync(none), args.join(' '));
      assert.match(stdout + stderr, /none/, args.join(' '));
    }
  } finally {
    rmSync(folder, { recursive: true });
  }
});

/** A port where nobody listens: one that was given and closed again. */
async function dead_port() {
  const taken = createServer();
  await new Promise((done) => taken.listen(0, '127.0.0.1', done));
  const { port } = taken.address();
  await new Promise((done) => taken.close(done));
  return port;
}

test('an import to where nobody listens ends soon, one without a token says how to give one', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  const flight = join(folder, 'flight');
  let server;
  try {
    assert.equal((await run(['simulate', 'flight', '--duration', '10', '--out', flight])).code, 0);
    const port = await dead_port();
    const nobody = await run(['import', 'flight', flight, '--url', `http://127.0.0.1:${port}`], { deadlineMs: 30_000 });
    assert.equal(nobody.code, 1, nobody.stderr);
    assert.match(nobody.stderr, /no anchord server answers at http:\/\/127\.0\.0\.1:\d+: .*--url/);
    server = await startServer({ auth: 'on' });
    const stranger = await run(['import', 'flight', flight, '--url', server.url]);
    assert.notEqual(stranger.code, 0);
    assert.match(stranger.stderr, /401 .*--token-file/);
  } finally {
    await server?.dispose();
    rmSync(folder, { recursive: true });
  }
});

test('top prints a server once as plain text into a pipe, and fails where nobody listens or without a token', async () => {
  const nobody = await run(['top', '--once', '--url', `http://127.0.0.1:${await dead_port()}`], { deadlineMs: 30_000 });
  assert.deepEqual([nobody.code, nobody.stdout], [1, '']);
  assert.match(nobody.stderr, /no anchord server answers at http:\/\/127\.0\.0\.1:\d+: .*--url/);
  const server = await startServer({ auth: 'on' });
  try {
    for (const args of [['--once'], []]) {
      const { code, stdout, stderr } = await run(['top', ...args, '--data-dir', server.dataDir], {
        deadlineMs: 30_000,
      });
      assert.equal(code, 0, stderr);
      assert.match(stdout, /^anchord \d+\.\d+\.\d+.* at http[^]*\nHealth: READY\n/);
      assert.match(stdout, /\nALARMS[^]*\nMISSION IN FLIGHT[^]*\nDEVICES[^]*\nQUEUES[^]*\nJOBS/);
      assert.match(stdout, /rows waiting for storage or estimation +\d+\n[^]* commands +\d+\n/);
      assert.ok(!stdout.includes('\u001b'), 'an escape code');
    }
    const stranger = await run(['top', '--once', '--url', server.url]);
    assert.deepEqual([stranger.code, stranger.stdout], [1, '']);
    assert.match(stranger.stderr, /401 .*--token-file/);
  } finally {
    await server.dispose();
  }
});

test('bash completes commands, their commands and their options', async () => {
  const { code, stdout } = await run(['completion', 'bash']);
  assert.equal(code, 0);
  const complete = (...words) => {
    const script =
      `${stdout}\nCOMP_WORDS=(${words.map((w) => `'${w}'`).join(' ')})\n` +
      `COMP_CWORD=${words.length - 1}\n_anchord\nprintf '%s\\n' "\${COMPREPLY[@]}"`;
    return execFileSync('bash', ['-c', script], { encoding: 'utf8' }).split('\n').filter(Boolean);
  };
  assert.deepEqual(complete('anchord', 'sol'), ['solve']);
  assert.deepEqual(complete('anchord', 'token', 'l'), ['list']);
  assert.deepEqual(complete('anchord', 'token', 'create', '--ro'), ['--role']);
  assert.deepEqual(complete('anchord', 'serve', '--data-dir', '/x', '--list'), ['--listen']);
  assert.ok(!complete('anchord', '').includes('worker'), 'what only the server starts is not offered');
  assert.match((await run(['completion', 'zsh'])).stdout, /^#compdef anchord\n[^]*'solve:/);
  assert.equal((await run(['completion', 'fish'])).code, 2);
});

test('the manual page names every command that the help names', async () => {
  const { stdout: page } = await run(['man']);
  const { stderr: help } = await run([]);
  const commands = [...help.matchAll(/^ {2}([a-z]+) {2,}/gm)].map((m) => m[1]);
  assert.ok(commands.length > 15, help);
  for (const command of commands) assert.ok(page.includes(`\n.SS anchord ${command}\n`), command);
  assert.doesNotMatch(page, /^\.(?!TH|SH|SS|TP|B|I)/m, 'a line of text that roff would take for a request');
});

test('doctor says what is wrong with folder and port, and of a running server how it is', async () => {
  const server = await startServer({ auth: 'on' });
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  const looked = async (...args) => {
    const { code, stdout } = await run(['doctor', '--json', ...args]);
    const found = Object.fromEntries(JSON.parse(stdout).map((one) => [one.what, one]));
    return { code, found };
  };
  try {
    const running = await looked('--data-dir', server.dataDir);
    assert.equal(running.found.server.level, 'ok');
    assert.match(running.found.server.seen, new RegExp(`${server.url} answers after`));
    assert.equal(running.found['server version'], undefined, 'it is of this version');
    const taken = await looked('--data-dir', folder, '--listen', `127.0.0.1:${server.port}`);
    assert.equal(taken.code, 1);
    assert.equal(taken.found.port.level, 'failed');
    assert.match(taken.found.port.advice, /another program uses this port/);
    await server.kill();
    const stopped = await looked('--data-dir', server.dataDir);
    assert.equal(stopped.found.database.level, 'ok');
    writeFileSync(join(folder, 'anchord.db'), 'this is no database, only as long as one'.repeat(200));
    const damaged = await looked('--data-dir', folder);
    assert.deepEqual([damaged.code, damaged.found.database.level], [1, 'failed']);
    assert.match(damaged.found.database.advice, /backup restore/);
  } finally {
    await server.dispose();
    rmSync(folder, { recursive: true });
  }
});

test('a support bundle has what helps and no secret of the server', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e ')),
    signing = randomBytes(32).toString('hex'),
    key_file = join(folder, 'signing.key'),
    archive = join(folder, 'bundle.tar');
  writeFileSync(key_file, signing, { mode: 0o600 });
  const server = await startServer({
    auth: 'on',
    args: ['--drone-address', 'udp://:0', '--drone-signing-key-file', key_file],
  });
  try {
    const made = await (await server.fetch('/api/v1/tokens', { json: { name: 'gis', roles: ['viewer'] } })).json();
    const password = `p${randomBytes(12).toString('hex')}`,
      device = await server.fetch('/api/v1/devices', {
        json: {
          name: 'caster',
          kind: 'ntrip',
          address: 'tcp://127.0.0.1:9',
          options: { mount: 'M', user: 'surveyor', password },
        },
      });
    assert.equal(device.status, 201, await device.clone().text());
    await server.fetch('/api/v1/missions', { headers: { authorization: `Bearer wrong-${password}` } });
    const secrets = [readFileSync(join(server.dataDir, 'admin.token'), 'utf8').trim(), made.token, signing, password];
    for (const name of readdirSync(server.dataDir))
      if (/key|secret/.test(name) && statSync(join(server.dataDir, name)).isFile())
        secrets.push(readFileSync(join(server.dataDir, name), 'latin1').trim());
    assert.ok(
      secrets.every((s) => typeof s === 'string' && s.length >= 16),
      'every secret is known to this test',
    );
    const { code, stderr } = await run(['support-bundle', '--data-dir', server.dataDir, '--out', archive]);
    assert.equal(code, 0, stderr);
    assert.equal(statSync(archive).mode & 0o777, 0o600, 'it is for whoever asked');
    const bundle = readFileSync(archive, 'latin1');
    for (const secret of secrets) assert.ok(!bundle.includes(secret), 'a secret is in the bundle');
    const part = (name) => execFileSync('tar', ['-xOf', archive, name], { encoding: 'utf8' });
    assert.match(part('version.json'), /"version"/);
    assert.match(part('settings.txt'), /drone\.signing_key_file = ".*signing\.key" {2}# flag/);
    assert.match(part('log.jsonl'), /"msg":"listening"/);
    assert.match(part('metrics.txt'), /anchord_db_size_bytes \d+/);
    assert.ok(JSON.parse(part('doctor.json')).some((f) => f.what === 'data folder' && f.level === 'ok'));
    const refused = await fetch(`${server.url}/api/v1/support-bundle`, {
      headers: { authorization: `Bearer ${made.token}` },
    });
    assert.equal(refused.status, 403);
    await server.kill();
    assert.equal((await run(['support-bundle', '--data-dir', server.dataDir, '--out', archive])).code, 0);
    assert.ok(JSON.parse(part('doctor.json')).length > 2, 'without a server it is what doctor finds');
  } finally {
    await server.dispose();
    rmSync(folder, { recursive: true });
  }
});

test('the simulated flight is the same, byte for byte, with the same seed, and another with another', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'anchord e2e '));
  try {
    for (const [name, seed] of [
      ['one', '7'],
      ['two', '7'],
      ['other', '8'],
    ]) {
      const { code, stderr } = await run([
        'simulate',
        'flight',
        '--seed',
        seed,
        '--duration',
        '40',
        '--out',
        join(folder, name),
      ]);
      assert.equal(code, 0, stderr);
    }
    for (const file of ['flight.json', 'track.csv', 'ranges.csv', 'anchors_truth.csv']) {
      const bytes = ['one', 'two', 'other'].map((name) => readFileSync(join(folder, name, file)));
      assert.ok(bytes[0].length > 300, `${file} is empty`);
      assert.ok(bytes[0].equals(bytes[1]), `${file} differs between two runs of one seed`);
      if (file.match(/track|ranges/)) assert.ok(!bytes[0].equals(bytes[2]), `${file} does not depend on the seed`);
    }
  } finally {
    rmSync(folder, { recursive: true });
  }
});

test('a simulation that makes no sense ends with 2 and says why', async () => {
  const { code, stderr } = await run(['simulate', 'flight', '--duration', '-5', '--out', join(tmpdir(), 'never-made')]);
  assert.equal(code, 2);
  assert.match(stderr, /duration/);
});
