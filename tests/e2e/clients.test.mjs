// Clients that a kept generator makes from the contract as it is served: they compile, and speak with the real server.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { promisify } from 'node:util';
import { root, startServer } from './server.mjs';

const modules = join(root, 'tests/node_modules');
const node = promisify(execFile).bind(null, process.execPath);
let server, folder;

before(async () => {
  server = await startServer({ auth: 'on' });
  folder = mkdtempSync(join(tmpdir(), 'anchord clients '));
});
after(async () => {
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

test('TypeScript: openapi-typescript and openapi-fetch', async () => {
  const contract = await (await fetch(`${server.url}/api/v1/openapi.json`)).text();
  writeFileSync(join(folder, 'openapi.json'), contract);
  symlinkSync(modules, join(folder, 'node_modules'));
  for (const name of ['client.ts', 'tsconfig.json'])
    copyFileSync(join(root, 'tests/e2e/clients', name), join(folder, name));
  writeFileSync(join(folder, 'package.json'), '{"type":"module"}');
  const cwd = { cwd: folder, maxBuffer: 1 << 26 };
  await node(
    [
      join(modules, 'openapi-typescript/bin/cli.js'),
      'openapi.json',
      '-o',
      'schema.d.ts',
      '--default-non-nullable=false',
    ],
    cwd,
  );
  assert.match(readFileSync(join(folder, 'schema.d.ts'), 'utf8'), /postRanges/);
  mkdirSync(join(folder, 'out'));
  await node([join(modules, 'typescript/bin/tsc'), '-p', '.', '--outDir', 'out'], cwd).catch((e) =>
    assert.fail(e.stdout),
  );
  const { stdout } = await node(['out/client.js', server.url, server.token], cwd);
  const said = JSON.parse(stdout);
  assert.deepEqual(said.counts, { accepted: 2, rejected: 0 });
  assert.deepEqual(said.refused, { status: 422, type: '/problems/validation', rejected: 1 });
  assert.deepEqual(said.distances.sort(), [7.412, 7.5]);
  assert.equal(said.anchors, 0);
  assert.equal(said.absent.status, 404);
  assert.match(said.absent.detail, /0197a3b0/);
});
