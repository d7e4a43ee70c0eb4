// `anchord worker` over a PostgreSQL, for tests that hold it in the middle of a job.
import { spawn } from 'node:child_process';
import { readFileSync, readdirSync } from 'node:fs';
import { binary, eventually } from './server.mjs';

const running = new Set();

/** A role with the rights that docs/workers.md names, once the server has made its tables. */
export const allow_workers = (postgres) =>
  postgres.psql(
    `CREATE ROLE anchord_worker LOGIN PASSWORD '${postgres.password}';` +
      'GRANT SELECT ON schema_migration TO anchord_worker;' +
      'GRANT SELECT, UPDATE ON work TO anchord_worker;' +
      'GRANT SELECT, INSERT, UPDATE, DELETE ON worker TO anchord_worker',
    'anchord',
  );

/** It has read its message, and is asked to stop from here on. */
const has_begun = (pid) => {
  try {
    return readdirSync(`/proc/${pid}/task`).some(
      (thread) => readFileSync(`/proc/${pid}/task/${thread}/comm`, 'utf8').trim() === 'listener',
    );
  } catch {
    return false; // it ended while we looked
  }
};

/** A worker with the rights that docs/workers.md names. */
class Worker {
  constructor(postgres, name) {
    this.name = name;
    this.log = '';
    const args = ['worker', '--database', postgres.url('anchord', { user: 'anchord_worker' }), '--name', name];
    this.child = spawn(binary, [...args, '--lease-s', '1'], {
      stdio: ['ignore', 'pipe', 'inherit'],
      env: { ...process.env, ...postgres.env },
    });
    this.child.stdout.setEncoding('utf8').on('data', (text) => (this.log += text));
    this.exited = new Promise((done) => this.child.once('exit', (code, signal) => done({ code, signal })));
    running.add(this);
  }
  says(text) {
    return eventually(`${this.name} says "${text}"`, () => this.log.includes(text), 15_000);
  }
  async end(signal = 'SIGTERM') {
    this.child.kill(signal);
    running.delete(this);
    return this.exited;
  }
  /** The processes that compute for it. */
  computing() {
    return readdirSync('/proc').filter((name) => {
      if (!/^\d+$/.test(name)) return false;
      try {
        const stat = readFileSync(`/proc/${name}/stat`, 'utf8');
        const [state, parent] = stat.slice(stat.lastIndexOf(')') + 2).split(' ');
        return stat.includes('(anchord-worker)') && Number(parent) === this.child.pid && state !== 'Z';
      } catch {
        return false; // it ended while we looked
      }
    });
  }
  /** Holds its job in the middle, however quick the machine is, until thaw(). */
  async freeze() {
    await eventually(`${this.name} computes`, () => this.computing().some(has_begun), 15_000, 5);
    this.frozen = this.computing().find(has_begun);
    process.kill(Number(this.frozen), 'SIGSTOP');
  }
  thaw() {
    process.kill(Number(this.frozen), 'SIGCONT');
  }
}

export async function startWorker(postgres, name) {
  const worker = new Worker(postgres, name);
  await worker.says('waiting for jobs');
  return worker;
}

/** Whatever a failed test left. */
export async function endWorkers() {
  for (const worker of [...running]) {
    worker.child.kill('SIGCONT');
    await worker.end('SIGKILL');
  }
}
