// What a person or a script sees of the program itself: words on stdout, exit codes.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { run } from './server.mjs';

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

test('an unknown subcommand ends with 2 and says something on stderr', async () => {
  const { code, stdout, stderr } = await run(['fly-me-to-the-moon']);
  assert.equal(code, 2);
  assert.equal(stdout, '');
  assert.notEqual(stderr, '');
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
