// The commands of the cookbook, of the recipes and of the tutorial, taken from the pages and run by a shell against the real binary.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { binary, root, startServer } from './server.mjs';

/** The ```sh blocks of a page, in order. */
function commandsOf(page) {
  return [...page.matchAll(/^```sh\n([\s\S]*?)^```$/gm)].map((match) => match[1]);
}

function shell(script, { cwd, env }) {
  return new Promise((done, fail) => {
    const child = spawn('bash', ['-euo', 'pipefail', '-x', '-c', script], {
      cwd,
      env,
      stdio: ['ignore', 'pipe', 'pipe'],
    });
    let output = '';
    for (const stream of [child.stdout, child.stderr])
      stream.setEncoding('utf8').on('data', (chunk) => (output += chunk));
    child.once('error', fail);
    child.once('close', (code) => done({ code, output }));
  });
}

test('every command of the cookbook does what the page says', async () => {
  const commands = commandsOf(readFileSync(join(root, 'docs/cookbook.md'), 'utf8'));
  assert.ok(commands.length >= 12, `${commands.length} blocks`);
  const server = await startServer({ auth: 'on' });
  const cwd = mkdtempSync(join(tmpdir(), 'anchord cookbook '));
  try {
    cpSync(join(root, 'docs/examples'), join(cwd, 'docs/examples'), { recursive: true });
    const { code, output } = await shell(commands.join('\n'), {
      cwd,
      env: { ...process.env, U: server.url, T: server.token },
    });
    assert.equal(code, 0, output.slice(-4000));
  } finally {
    await server.dispose();
    rmSync(cwd, { recursive: true, force: true });
  }
});

test('every command of the recipes does what the page says', async () => {
  const commands = commandsOf(readFileSync(join(root, 'docs/recipes.md'), 'utf8'));
  assert.ok(commands.length >= 7, `${commands.length} blocks`);
  const server = await startServer({ auth: 'on' });
  const cwd = mkdtempSync(join(tmpdir(), 'anchord recipes '));
  try {
    symlinkSync(binary, join(cwd, 'anchord'));
    const { code, output } = await shell(
      `anchord simulate flight --seed 7 --out my-flight\n${commands.join('\n')}\ntest "$(wc -l < ranges.csv)" -gt 100\n`,
      { cwd, env: { ...process.env, PATH: `${cwd}:${process.env.PATH}`, U: server.url, T: server.token } },
    );
    assert.equal(code, 0, output.slice(-4000));
  } finally {
    await server.dispose();
    rmSync(cwd, { recursive: true, force: true });
  }
});

test('every block of the tutorial may be pasted as it stands, twice', async () => {
  const commands = commandsOf(readFileSync(join(root, 'docs/tutorial.md'), 'utf8')).join('\n');
  const cwd = mkdtempSync(join(tmpdir(), 'anchord tutorial '));
  try {
    mkdirSync(join(cwd, 'build/release'), { recursive: true });
    symlinkSync(binary, join(cwd, 'build/release/anchord'));
    const { code, output } = await shell(
      `trap 'kill %1; wait' EXIT\n${commands}\n${commands}\n` +
        'test $(jq ".features | length" anchors.geojson) -ge 5\n' +
        'test "$(curl -fsS -H "Authorization: Bearer $T" $U/api/v1/revisions | jq ".items | length")" = 2',
      { cwd, env: process.env },
    );
    assert.equal(code, 0, output.slice(-4000));
    assert.match(output, /^0x6a21\tok\ttrue$/m, 'verdict and whether it may be believed');
  } finally {
    rmSync(cwd, { recursive: true, force: true });
  }
});
