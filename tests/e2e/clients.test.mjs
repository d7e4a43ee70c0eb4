// Clients that kept generators make from the contract as it is served, and the ten-line clients of the live interface that the
// documentation shows: they compile, and speak with the real server.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { promisify } from 'node:util';
import { eventually, root, startServer } from './server.mjs';

const modules = join(root, 'tests/node_modules');
const execute = promisify(execFile);
const node = execute.bind(null, process.execPath);
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

/** The schemas of the contract as the generator takes them: one document of JSON Schema whose properties are the classes wanted. */
function as_json_schema({ components: { schemas } }) {
  const moved = JSON.stringify(schemas).replaceAll('#/components/schemas/', '#/definitions/');
  const properties = Object.fromEntries(Object.keys(schemas).map((name) => [name, { $ref: `#/definitions/${name}` }]));
  return {
    $schema: 'http://json-schema.org/draft-07/schema#',
    type: 'object',
    properties,
    definitions: JSON.parse(moved),
  };
}

test('Python: quicktype and the standard library', async () => {
  const contract = await (await fetch(`${server.url}/api/v1/openapi.json`)).json();
  writeFileSync(join(folder, 'schema.json'), JSON.stringify(as_json_schema(contract)));
  copyFileSync(join(root, 'tests/e2e/clients/client.py'), join(folder, 'client.py'));
  const options = ['--src-lang', 'schema', '--lang', 'python', '--python-version', '3.7', '--top-level', 'Contract'];
  const cwd = { cwd: folder, maxBuffer: 1 << 26 };
  const quicktype = join(modules, 'quicktype/dist/index.js');
  await node([quicktype, ...options, '--no-combine-classes', '-o', 'model.py', 'schema.json'], cwd);
  const { stdout } = await execute('/usr/bin/python3', ['client.py', server.url, server.token], cwd);
  const read = JSON.parse(stdout);
  assert.deepEqual(read.mission, { state: 'recording', year: new Date().getUTCFullYear() });
  assert.deepEqual(read.counts, { accepted: 2, rejected: 0 });
  assert.deepEqual(read.refused, { status: 422, type: '/problems/validation', rejected: 1 });
  assert.deepEqual(read.distances, [7.412, 7.5]);
  assert.equal(read.anchors, 0);
  assert.equal(read.absent.status, 404);
  assert.match(read.absent.detail, /0197a3b0/);
});

/** Runs a client until it has printed a whole line of JSON, which it answers. */
async function first_line(program, args) {
  const child = spawn(program, args, { stdio: ['pipe', 'pipe', 'pipe'] });
  let printed = '',
    wrong = '';
  child.stdout.setEncoding('utf8').on('data', (part) => (printed += part));
  child.stderr.setEncoding('utf8').on('data', (part) => (wrong += part));
  try {
    return await eventually(
      `${program} ${args[0]} prints`,
      () => {
        if (child.exitCode !== null) throw new Error(`it ended with ${child.exitCode}: ${wrong}`);
        const line = printed
          .split('\n')
          .slice(0, -1)
          .find((one) => one.includes('{')); // wscat puts a mark before it
        return line && JSON.parse(line.slice(line.indexOf('{')));
      },
      20_000,
    );
  } finally {
    child.kill();
  }
}

/** Runs a program with the names of arguments that websockets 14 and newer have; Debian 12 has 10.4. */
const since_websockets_14 = `
import runpy, sys, websockets
real = websockets.connect
def connect(uri, *, subprotocols=None, additional_headers=None):
    return real(uri, subprotocols=subprotocols, extra_headers=additional_headers)
websockets.connect = connect
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
`;

test('the live interface in ten lines of Python, of JavaScript, and by wscat', async () => {
  const example = (name) => join(root, 'docs/examples', name),
    live = server.url.replace('http', 'ws');
  for (const name of ['live.py', 'live.mjs'])
    assert.ok(
      readFileSync(example(name), 'utf8')
        .split('\n')
        .filter((line) => line && !/^(#|\/\/)/.test(line)).length <= 10,
      name,
    );
  const python = await first_line('/usr/bin/python3', [example('live.py'), live, server.token, 'system']);
  assert.ok(python.db_bytes > 0, JSON.stringify(python));
  const newer = await first_line('/usr/bin/python3', [
    '-c',
    since_websockets_14,
    example('live.py'),
    live,
    server.token,
    'system',
  ]);
  assert.ok(newer.db_bytes > 0, JSON.stringify(newer));
  // Node 20 has its WebSocket behind a flag.
  const script = await first_line(process.execPath, [
    '--experimental-websocket',
    example('live.mjs'),
    server.url,
    server.token,
    'system',
  ]);
  assert.equal(script.synchronous, 'full', JSON.stringify(script));
  // The command of the documentation, with the token and address of this server.
  const page = readFileSync(join(root, 'docs/integration.md'), 'utf8');
  const [, options] = /^ {4}npx wscat (.*)$/m.exec(page);
  const words = [...options.matchAll(/'([^']*)'|"([^"]*)"|(\S+)/g)].map(([, a, b, c]) => a ?? b ?? c);
  const args = words.map((word) => word.replace('$T', server.token).replace('ws://127.0.0.1:8420', live));
  const hello = await first_line(process.execPath, [join(modules, 'wscat/bin/wscat'), ...args]);
  assert.equal(hello.op, 'hello');
});
