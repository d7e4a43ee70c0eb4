// Grid search of each method by the real command line, on a made table: a place takes its own level, a wall 6 dB of the first path.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { binary } from '../e2e/server.mjs';

function table(n) {
  let state = 1;
  const noise = () => ((state = (state * 48271) % 2147483647) / 2147483647) * 2 - 1;
  const lines = ['env,setup_id,true_range_m,nlos,range_m,rx_dbm,fp_dbm'];
  for (let i = 0; i < n; ++i) {
    const nlos = i % 2,
      truth = 2 + (i % 97) / 5,
      rx = -75 - truth + ((i % 20) - 10) / 5 + 2 * noise();
    lines.push(
      [
        `room ${i % 20}`,
        i,
        truth.toFixed(2),
        nlos,
        (truth + 0.05 + nlos * 0.5 + 0.05 * noise()).toFixed(3),
        rx.toFixed(2),
        (rx - 3 - 6 * nlos + 4 * noise()).toFixed(2),
      ].join(','),
    );
  }
  return `${lines.join('\n')}\n`;
}

/** 943 samples are the dissertation's training set. A search of more than `limitS` is ended and says so. */
export function grid(row, sizes = [943, 50_000], limitS = 300) {
  const dir = mkdtempSync(join(tmpdir(), 'anchord-grid-'));
  try {
    for (const n of sizes) {
      const data = join(dir, `${n}.csv`);
      writeFileSync(data, table(n));
      for (const [task, method] of [
        ['nlos_id', 'logistic'],
        ['nlos_id', 'svm'],
        ['nlos_id', 'random_forest'],
        ['nlos_id', 'boosted'],
        ['bias', 'polynomial'],
        ['bias', 'multivariate'],
        ['bias', 'svm'],
        ['bias', 'random_forest'],
      ]) {
        const start = performance.now();
        try {
          const out = JSON.parse(
            execFileSync(
              binary,
              [
                'train',
                '--data',
                data,
                '--task',
                task,
                '--method',
                method,
                '--grid',
                '--folds',
                '5',
                '--out',
                join(dir, 'm.json'),
                '--json',
              ],
              { timeout: limitS * 1000, maxBuffer: 1 << 28, stdio: ['ignore', 'pipe', 'ignore'] },
            ),
          );
          row(
            `grid search of ${method}, ${task}, ${n} samples, 5 folds`,
            `${((performance.now() - start) / 1000).toFixed(1)} s`,
            `${out.candidates.length} candidates`,
          );
        } catch (error) {
          if (error.code !== 'ETIMEDOUT' && error.signal !== 'SIGTERM') throw error;
          row(`grid search of ${method}, ${task}, ${n} samples, 5 folds`, `more than ${limitS} s`);
        }
      }
    }
  } finally {
    rmSync(dir, { recursive: true, force: true });
  }
}
