import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { drops, keep, newestOf, ratios } from './history.mjs';

test('a work that takes half of its peer is twice as fast', () => {
  assert.deepEqual(ratios([{ work: 'a', ours: 5, peer: 10 }]), { a: 2 });
});

test('a tenth lost is named, less is not, and what is new or gone says nothing', () => {
  const before = { tenth: 2, less: 2, gone: 1 };
  assert.deepEqual(drops(before, { tenth: 1.8, less: 1.81, fresh: 0.1 }), [{ work: 'tenth', before: 2, now: 1.8 }]);
});

test('a run is kept beside the works that it left out, and the newest day is the one compared with', () => {
  const folder = mkdtempSync(join(tmpdir(), 'anchord history '));
  try {
    assert.equal(newestOf(folder), undefined);
    writeFileSync(join(folder, 'README.md'), 'no run');
    keep(folder, '2026-01-02', { b: 1, a: 2 });
    keep(folder, '2026-01-10', { b: 3 });
    assert.deepEqual(newestOf(folder), { name: '2026-01-10.json', ratios: { a: 2, b: 3 } });
  } finally {
    rmSync(folder, { recursive: true });
  }
});
