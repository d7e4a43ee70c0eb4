// ./dev torture cluster [ROUNDS]: two servers that stand by for one another on a real PostgreSQL, ten flights, and one fault a round. See
// README.md.
import assert from 'node:assert/strict';
import { chmodSync, cpSync, copyFileSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { simulatedFlight } from '../e2e/flight.mjs';
import { eventually, root } from '../e2e/server.mjs';
import { faults } from './faults.mjs';
import { Client, Flight, Maker, Straggler, Viewer } from './flights.mjs';
import { Historian, modelOf } from './histories.mjs';
import { shown, violations } from './linearizable.mjs';
import { Database, Network, Server, sleep, started, unable, Worker } from './machines.mjs';
import { generator } from './random.mjs';
import { Report } from './report.mjs';
import { Promoter, Publisher } from './work.mjs';

const k_flights = 10,
  k_rounds_of_a_flight = 4;

/** Everything that runs, and who is what of it. */
class Cell {
  constructor(folder, random) {
    this.folder = folder;
    this.random = random;
  }
  async start(seed) {
    this.network = await Network.make(seed);
    this.databases = ['db1', 'db2'].map((name) => new Database(this.network, name, this.folder));
    [this.primary, this.replica] = this.databases;
    await this.primary.init();
    const hosts = this.databases.map(({ address }) => address).join(','),
      url = `postgresql://anchord@${hosts}/anchord?target_session_attrs=read-write&connect_timeout=2`;
    this.servers = ['s1', 's2'].map((name) => new Server(this.network, name, this.folder, url));
    this.workers = ['first', 'second'].map((name) => new Worker(this.network, name, this.folder, url));
    const [first, second] = this.servers;
    first.start();
    await eventually('the first server is ready', () => fetch(`${first.url}/readyz`).then((r) => r.ok, () => false), 60_000, 100); // prettier-ignore
    this.token = readFileSync(join(first.folder, 'admin.token'), 'utf8').trim();
    copyFileSync(join(first.folder, 'models.key'), join(second.folder, 'models.key')); // what one signed the other one must trust
    second.start();
    for (const worker of this.workers) worker.start();
    await this.steady();
  }
  get sql() {
    return this.primary.sql;
  }
  get urls() {
    return this.servers.map(({ url }) => url);
  }
  /** {owner, other, fence} by the row in the database; null where it is away or names nobody. */
  async #lease() {
    const rows = await this.sql
      .rows(
        'SELECT server, fence, lease_t_ns > now_ns(), standby, standby_t_ns > now_ns() - 3000000000 FROM server_lease',
      )
      .catch(() => []);
    if (rows.length === 0) return null;
    const [[server, fence, holds, standby, waits]] = rows,
      named = (name) => this.servers.find(({ child }) => name.endsWith(`/${child.pid}`));
    return {
      fence: Number(fence),
      owner: holds === 't' ? named(server) : undefined,
      other: waits === 't' ? named(standby) : undefined,
    };
  }
  /** One has the database and answers, the other one stands by. */
  async steady() {
    await eventually('one server has the database, the other one stands by', async () => {
      const lease = await this.#lease();
      if (!lease?.owner?.alive || !lease.other?.alive || lease.owner === lease.other) return false;
      Object.assign(this, lease);
      return fetch(`${this.owner.url}/readyz`, { signal: AbortSignal.timeout(1000) }).then((r) => r.ok, () => false); // prettier-ignore
    }, 90_000, 100); // prettier-ignore
  }
  /** Another one has the lease; when that was seen is `taken_at`. */
  async taken() {
    const before = this.fence;
    await eventually(
      'the other server takes over',
      async () => ((await this.#lease())?.fence ?? before) > before,
      60_000,
      50,
    );
    this.taken_at = performance.now();
  }
  primary_is_gone() {
    [this.primary, this.replica] = [this.replica, this.primary];
  }
  /** Whether somebody took over in this round, seen at its end. */
  async taken_since() {
    const lease = await this.#lease();
    return lease !== null && lease.fence > this.fence;
  }
  async end() {
    for (const one of [...(this.workers ?? []), ...(this.servers ?? [])]) one.kept = false;
    for (const one of [...(this.workers ?? []), ...(this.servers ?? [])]) one.child?.kill('SIGKILL');
    for (const one of this.databases ?? []) {
      one.sql.close();
      await one.end('SIGINT');
    }
  }
}

class Torture {
  constructor(seed, print) {
    this.seed = seed;
    this.print = print;
    this.random = generator(seed);
    this.folder = mkdtempSync(join(tmpdir(), 'anchord-torture-cluster-'));
    chmodSync(this.folder, 0o755); // PostgreSQL of root is another user
    this.cell = new Cell(this.folder, generator(seed + 1));
    this.report = new Report();
    this.found = [];
    this.flights = [];
    this.number = 0;
  }
  async prepare() {
    const { cell } = this;
    await cell.start(this.seed);
    this.client = new Client(cell.urls, cell.token);
    const owner = {
      fetch: (path, { json, headers = {}, ...init } = {}) =>
        fetch(cell.owner.url + path, {
          ...init,
          ...(json !== undefined && { method: init.method ?? 'POST', body: JSON.stringify(json) }),
          headers: {
            authorization: `Bearer ${cell.token}`,
            ...(json !== undefined && { 'content-type': 'application/json' }),
            ...headers,
          },
        }),
    };
    const publisher = new Publisher(await simulatedFlight({ seed: 7, duration: 60 })),
      promoter = new Promoter(readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8'));
    await publisher.prepare(owner, 2);
    await promoter.prepare(owner);
    this.calibrations = publisher.ready.map(({ id }) => id);
    this.models = promoter.models;
    this.maker = new Maker(this.client);
    this.viewers = [0, 1].map((n) => new Viewer(cell.urls, cell.token, generator(this.seed + 1000 + n)));
  }
  async #mission(name) {
    const made = await this.client.call('/api/v1/missions?devices=false', {
      json: { name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
      headers: { 'idempotency-key': name },
    });
    assert.equal(made.status, 201, made.text);
    return made.json.id;
  }
  async #flights(round) {
    if (round % k_rounds_of_a_flight !== 0) return;
    for (const flight of this.flights) assert.ok((await flight.finish()).status < 300, 'finish');
    this.flights = Array.from(
      { length: k_flights },
      () => new Flight(this.number++, this.client, (answer, rows) => this.#acknowledged(answer, rows)),
    );
    for (const flight of this.flights) await flight.prepare();
  }
  #acknowledged({ url, began }, rows) {
    this.acknowledged.push({ url, began, at: performance.now(), rows });
  }
  /** What versioned things are before a round: nobody changes them now. */
  async #begun(sites) {
    const get = async (path) => {
        const answer = await this.client.call(path);
        assert.equal(answer.status, 200, answer.text);
        return answer;
      },
      version = ({ etag }) => Number(/(\d+)"$/.exec(etag)[1]),
      begun = {};
    for (const id of sites) {
      const site = await get(`/api/v1/sites/${id}`);
      begun[`site ${id}`] = [version(site), site.json.name];
    }
    const [newest] = (await get('/api/v1/revisions?limit=1')).json.items,
      active = await get('/api/v1/models/active');
    begun.revision = [newest?.revision ?? 0, newest?.calibration ?? null];
    begun.model = [version(active), active.json.models.nlos_id?.id ?? null];
    return begun;
  }

  async round(round, kind) {
    const { cell } = this,
      began = performance.now();
    await cell.steady();
    this.acknowledged = [];
    await this.#flights(round);
    const sites = [];
    for (const n of [0, 1]) {
      const name = `site ${round} ${n}`,
        made = await this.client.call('/api/v1/sites', {
          json: { name, origin: { lon: 3.7, lat: 51, h_m: 50 } },
          headers: { 'idempotency-key': name },
        });
      assert.equal(made.status, 201, made.text);
      sites.push(made.json.id);
    }
    const begun = await this.#begun(sites),
      historian = new Historian(cell.urls, cell.token, generator(this.seed + 2 + round)),
      straggler_mission = await this.#mission(`straggler ${round}`);
    let on = true;
    const going = () => on,
      work = [
        ...this.flights.map((flight) => flight.fly(going)),
        this.maker.make(going),
        ...sites.flatMap((id) => ['a', 'b', 'c'].map((who) => historian.site(who, id, going))),
        ...['a', 'b'].map((who) => historian.publish(who, this.calibrations, going)),
        ...['a', 'b'].map((who) => historian.promote(who, this.models, going)),
      ];
    let broken = null;
    for (const one of work) one.catch((error) => (broken ??= error));
    await sleep(2000);
    const owner = cell.owner;
    cell.taken_at = Infinity;
    const straggler = new Straggler(owner.url, cell.token, straggler_mission);
    const fault = await faults[kind](cell);
    straggler.going = false;
    const after = performance.now();
    await eventually('rows are acknowledged again', () => {
      if (broken) throw broken;
      return this.acknowledged.filter(({ began: asked }) => asked > after).length > k_flights;
    }, 60_000, 50); // prettier-ignore
    await sleep(2000);
    on = false;
    await Promise.all(work);
    if (broken) throw broken;
    if (fault.taken === true) assert.ok(await cell.taken_since(), 'another server took over');
    await cell.steady();
    const result = await this.#check({ round, kind, fault, owner, straggler, historian, begun }),
      took_s = (performance.now() - began) / 1000;
    this.print(`    round ${round + 1}, ${kind}: ${Report.words(result)}; ${took_s.toFixed(0)} s`);
  }

  async #check({ round, kind, fault, owner, straggler, historian, begun }) {
    const { cell } = this,
      wrong = [];
    let lost = 0,
      doubled = 0;
    for (const flight of this.flights) {
      const one = await flight.check(cell.sql);
      lost += one.lost;
      doubled += one.doubled;
      wrong.push(...one.wrong);
    }
    const late = await straggler.check(cell.sql, cell.taken_at);
    lost += late.lost;
    doubled += late.doubled;
    if (late.lost) wrong.push(`${late.lost} rows that ${owner.machine} alone acknowledged are not there`);
    wrong.push(...late.accepted);
    const made = await this.maker.check(cell.sql);
    if (made.lost) wrong.push(`${made.lost} sites that were acknowledged are not there`);
    wrong.push(...made.doubled);
    for (const viewer of this.viewers) wrong.push(...viewer.check(historian.published));
    const histories = violations(historian.operations, modelOf(begun));
    wrong.push(...histories.map(shown));
    const answered = this.acknowledged.filter((one) => one.began > fault.at).sort((one, next) => one.at - next.at),
      first = answered.find(({ url }) => url !== owner.url),
      gaps = answered.map(({ at }, i) => at - (answered[i - 1]?.at ?? fault.at)),
      seconds = (ms) => (fault.skipped ? null : ms / 1000);
    const result = {
      taken_s: fault.taken_s ?? (fault.taken === true ? seconds(cell.taken_at - fault.at) : null),
      served_s: fault.taken === true ? seconds(first.at - fault.at) : null,
      gap_s: seconds(Math.max(...gaps)),
      rows: this.acknowledged.reduce((sum, one) => sum + one.rows, 0),
      lost,
      doubled,
      late: late.late,
      accepted: late.accepted.length,
      calls: historian.operations.length,
      histories: histories.length,
      skipped: fault.skipped,
    };
    this.report.add(kind, result);
    for (const text of wrong) this.print(`VIOLATION in round ${round + 1} (${kind}): ${text}`);
    this.found.push(...wrong);
    return result;
  }
  table() {
    for (const line of this.report.lines()) this.print(line);
    const seen = this.viewers.map(
      ({ counts: one }) =>
        `${one.messages} messages, ${one.resumed} subscriptions resumed, ${one.anew} begun anew, ${one.gaps} gaps`,
    );
    this.print(`viewers: ${seen.join('; ')}`);
  }
  /** Logs of everything, for who looks for the cause. */
  keep(to) {
    rmSync(to, { recursive: true, force: true });
    cpSync(this.folder, to, { recursive: true });
  }
  async dispose() {
    for (const viewer of this.viewers ?? []) await viewer.close();
    await this.cell.end();
    rmSync(this.folder, { recursive: true, force: true, maxRetries: 3 });
  }
}

/** All kinds in a new order again and again, so that each has had its turn after as many rounds as there are kinds. */
function* drawn(random, kinds) {
  for (;;) {
    const left = [...kinds];
    while (left.length > 0) yield left.splice(Math.floor(random() * left.length), 1)[0];
  }
}

export async function clusterTorture({ rounds, seed, only, keepIn, print = console.log }) {
  const torture = new Torture(seed, print),
    began = performance.now();
  let done = 0;
  try {
    await torture.prepare();
    print(
      `==> ${rounds} rounds, seed ${seed}: ${k_flights} flights of 100 rows/s, two servers, two workers, PostgreSQL with a replica to fail over to`,
    );
    const kinds = drawn(
      torture.random,
      Object.keys(faults).filter((kind) => !only || kind.includes(only)),
    );
    for (; done < rounds; done++) await torture.round(done, kinds.next().value);
  } catch (error) {
    torture.found.push(String(error.stack));
    print(`FAILED in round ${done + 1} (seed ${seed}): ${error.stack}`);
    for (const server of torture.cell.servers ?? [])
      print(`${server.machine}: ${server.log.split('\n').slice(-12).join('\n')}`);
  }
  if (done > 0) torture.table();
  print(
    `==> ${done} rounds (seed ${seed}), ${torture.found.length} violations; ${((performance.now() - began) / 1000).toFixed(0)} s`,
  );
  if (torture.found.length > 0 && keepIn) {
    torture.keep(keepIn);
    print(`the folders are kept in ${keepIn}`);
  }
  await torture.dispose();
  return torture.found.length === 0;
}

/** In a network namespace of its own: this program again, as who may make more of them. */
async function inNamespace(args) {
  const root_too = ['unshare', '--net'],
    others = ['unshare', '--user', '--map-current-user', '--keep-caps', '--net'],
    make = process.getuid() === 0 ? root_too : others,
    why = unable(make);
  if (why) {
    console.log(`SKIPPED: torture of a cluster: ${why}`);
    return 0;
  }
  const env = { ...process.env, ANCHORD_TORTURE_INSIDE: 'yes' },
    words = [...make, process.execPath, fileURLToPath(import.meta.url), ...args],
    { code } = await started(words, { cwd: process.cwd(), stdio: 'inherit', env }).exited;
  return code ?? 1;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [rounds, seed] = [process.argv[2] ?? 30, process.env.ANCHORD_TORTURE_SEED ?? 1].map(Number);
  if (![rounds, seed].every((n) => Number.isInteger(n) && n >= 0)) {
    console.error('torture cluster [ROUNDS]: a number');
    process.exit(2);
  }
  if (!process.env.ANCHORD_TORTURE_INSIDE) process.exit(await inNamespace(process.argv.slice(2)));
  process.exit(
    (await clusterTorture({
      rounds,
      seed,
      only: process.env.ANCHORD_TORTURE_FAULT,
      keepIn: join(root, `build/torture-cluster-failure-${seed}`),
    }))
      ? 0
      : 1,
  );
}
