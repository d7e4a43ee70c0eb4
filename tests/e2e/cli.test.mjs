// What a person or a script sees of the program itself: words on stdout, exit codes.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { run } from './server.mjs';

test('version prints the name and a version', async () => {
  const { code, stdout } = await run(['version']);
  assert.equal(code, 0);
  assert.match(stdout, /^anchord \d+\.\d+\.\d+/);
});

test('an unknown subcommand ends with 2 and says something on stderr', async () => {
  const { code, stdout, stderr } = await run(['fly-me-to-the-moon']);
  assert.equal(code, 2);
  assert.equal(stdout, '');
  assert.notEqual(stderr, '');
});
