// What happens to the cell of ./dev torture cluster, one a round. Each makes its fault, waits for what must come of it and puts the network
// right; it answers {at, taken}: when service was cut, and whether another server must have taken over (null: it may have).
import assert from 'node:assert/strict';
import { eventually } from '../e2e/server.mjs';
import { ask } from './flights.mjs';
import { haveFaketime, sleep } from './machines.mjs';

const now = () => performance.now(),
  databases = ['db1', 'db2'];
/** A training run of some ten seconds, so that its worker is killed in the middle. */
const k_training = {
  task: 'nlos_id',
  dataset: 'torture',
  methods: ['svm'],
  cv: { folds: 4, seed: 7 },
  importance: false,
  grid: { svm: { c: [1, 2, 4, 8, 16, 32], gamma: [0.001, 0.004, 0.016, 0.064, 0.256, 1] } },
};
const k_longest_statement_ms = 30_000; // of a transaction of the server: SET LOCAL statement_timeout

/** Resolves when the process that the server is now has ended by itself, since another one has the database. */
async function ends(server) {
  const { code } = await server.child.exited;
  assert.equal(code, 1, `${server.machine} ended with ${code}: ${server.log.slice(-1000)}`);
}

export const faults = {
  async 'owner killed'(cell) {
    const at = now();
    cell.owner.signal('SIGKILL');
    await cell.taken();
    return { at, taken: true };
  },

  async 'owner stopped and continued'(cell) {
    const at = now(),
      { owner } = cell,
      ended = ends(owner);
    owner.signal('SIGSTOP');
    await cell.taken();
    await sleep(1000 + cell.random() * 3000);
    owner.signal('SIGCONT');
    await ended;
    return { at, taken: true };
  },

  async 'owner cut off from the database'(cell) {
    const at = now(),
      { owner } = cell,
      ended = ends(owner);
    await cell.network.set(owner.machine, databases, { cut: true });
    await cell.taken();
    await sleep(cell.random() * 2000);
    await cell.network.heal();
    await ended;
    return { at, taken: true };
  },

  /** It has never seen another one stand by; what it wrote is on its way until after that one has taken over. */
  async 'owner delayed, and sure of itself'(cell) {
    const { owner, other } = cell,
      ended = ends(owner);
    await other.stop();
    await cell.sql.rows("UPDATE server_lease SET standby = '', standby_t_ns = 0");
    await sleep(2600);
    const at = now();
    for (const database of databases) await cell.network.oneWay(owner.machine, database, { delay_s: 8 });
    other.kept = true;
    other.start();
    await cell.taken();
    assert.ok(owner.alive, 'the owner is still sure of itself');
    await sleep(Math.max(0, at + 9000 - now()));
    await cell.network.heal();
    await ended;
    return { at, taken: true };
  },

  async 'database restarted'(cell) {
    const at = now();
    await cell.primary.end(cell.random() < 0.5 ? 'SIGKILL' : 'SIGINT');
    await sleep(300 + cell.random() * 5000);
    await cell.primary.start();
    return { at, taken: null };
  },

  async 'database failed over'(cell) {
    await cell.replica.follow(cell.primary);
    await sleep(1000);
    const at = now();
    await cell.primary.end('SIGKILL');
    await cell.replica.promote();
    await cell.primary_is_gone();
    return { at, taken: null };
  },

  /** The owner alone still reaches the database of before, longer than a statement of it may take. */
  async 'database failed over behind the owner'(cell) {
    const { owner, other, primary, replica } = cell,
      ended = ends(owner);
    await replica.follow(primary);
    await sleep(1000);
    const at = now();
    await cell.network.set(primary.name, [replica.name, other.machine, 'w'], { cut: true });
    await replica.promote();
    await cell.primary_is_gone();
    await cell.taken();
    await sleep(Math.max(0, at + k_longest_statement_ms + 4000 - now()));
    await primary.end('SIGKILL');
    await cell.network.heal();
    await ended;
    return { at, taken: true };
  },

  async 'slow and lossy network'(cell) {
    const at = now();
    for (const server of ['s1', 's2']) await cell.network.set(server, databases, { delay_s: 0.1, loss: 0.05 });
    await sleep(8000);
    await cell.network.heal();
    return { at, taken: null };
  },

  async 'clocks 30 s apart'(cell) {
    if (!haveFaketime) return { skipped: 'libfaketime is not installed' };
    const { owner, other } = cell;
    await other.stop();
    other.clock_s = cell.random() < 0.5 ? 30 : -30;
    owner.clock_s = 0; // when it starts again
    other.kept = true;
    other.start();
    await cell.steady();
    const at = now();
    owner.signal('SIGKILL');
    await cell.taken();
    return { at, taken: true };
  },

  async 'worker killed'(cell) {
    const on_owner = (path, init) => ask(cell.owner.url, cell.token, path, init),
      made = await on_owner('/api/v1/training-runs', { json: k_training });
    assert.equal(made.status, 202, made.text);
    const job = async () => (await on_owner(`/api/v1/jobs/${made.json.id}`)).json ?? {},
      first = await eventually('a worker computes', async () => {
        const { worker, progress } = await job();
        return progress?.stage === 'search' && cell.workers.find(({ name }) => name === worker);
      }, 60_000, 50), // prettier-ignore
      at = now();
    first.signal('SIGKILL');
    await eventually('the other worker takes it', async () => {
      const { worker } = await job();
      return worker && worker !== first.name;
    }, 60_000, 50); // prettier-ignore
    const taken_s = (now() - at) / 1000,
      ended = await eventually('the run ends', async () => {
        const one = await job();
        return ['succeeded', 'failed', 'canceled'].includes(one.state) && one;
      }, 120_000, 200); // prettier-ignore
    assert.equal(ended.state, 'succeeded', JSON.stringify(ended));
    const id = ended.links
        .find(({ rel }) => rel === 'result')
        .href.split('/')
        .at(-1),
      [[models]] = await cell.sql.rows(
        `SELECT count(*) FROM model JOIN training_run r USING (run_key) WHERE r.id = '\\x${id.replaceAll('-', '')}'`,
      );
    assert.equal(Number(models), 1, `models of a run whose worker was killed: ${models}`);
    return { at, taken: false, taken_s };
  },
};
