// ./dev torture [KILLS [CUTS]]: the server is killed again and again in the middle of its work, and its power is cut. After each,
// it starts, its database is whole, what was acknowledged is there once, and nothing is half done. See README.md.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { simulatedFlight } from '../e2e/flight.mjs';
import { root, Server } from '../e2e/server.mjs';
import { Disk } from './disk.mjs';
import { generator } from './random.mjs';
import { Deleter, Gateway, Installer, Promoter, Publisher } from './work.mjs';

const k_args = ['--rate-per-s', '100000', '--rate-burst', '100000', '--backup-schedule', 'off'];
const k_rest_every = 25; // kills between two rests, in which missions begin anew and calibrations are made
const k_start_ms = 90_000; // a hang is found all the same; a busy machine is none
const k_other_every = 10; // kills between two of a migration, and of a first start

/** Rows of a query on the live database, as objects; a reader of its own that never writes. */
const query = (file) => (sql) =>
  JSON.parse(
    execFileSync('sqlite3', ['-readonly', '-json', file, sql], { encoding: 'utf8', maxBuffer: 1 << 28 }) || '[]',
  );

class Torture {
  constructor({ seed, shim, print }) {
    this.random = generator(seed);
    this.seed = seed;
    this.print = print;
    this.folder = mkdtempSync(join(tmpdir(), 'anchord-torture-'));
    if (shim) {
      // LD_PRELOAD splits at spaces: by a path of our own.
      this.shim = join(this.folder, 'power_cut.so');
      copyFileSync(shim, this.shim);
    }
    this.counts = { kills: 0, cuts: 0, migrations: 0, firstStarts: 0 };
    this.restarts = [];
  }

  wait(longestMs) {
    return new Promise((done) => setTimeout(done, this.random() * longestMs));
  }

  /** A server on `disk`, whose power is cut when `cut`; `end` ends it one way or the other. */
  begin(disk, cut) {
    const env = cut ? disk.prepare() : {};
    const server = new Server({ dataDir: disk.data, args: k_args, env });
    server.end = async () => {
      await server.kill();
      if (cut) disk.cut();
    };
    return server;
  }

  /** Ready, and whole. */
  async restarted(server, disk) {
    const began = performance.now();
    await server.start(k_start_ms);
    this.restarts.push(performance.now() - began);
    const sql = query(join(disk.data, 'anchord.db'));
    assert.deepEqual(sql('PRAGMA integrity_check'), [{ integrity_check: 'ok' }]);
    assert.deepEqual(sql('PRAGMA foreign_key_check'), []);
    return sql;
  }

  /** `times` ends in the middle of everything that writes. */
  async underLoad(times, cut) {
    const what = cut ? 'power cut' : 'kill';
    const disk = new Disk(join(this.folder, cut ? 'cut' : 'kill'), this.shim, this.seed);
    mkdirSync(disk.data, { recursive: true, mode: 0o700 });
    const gateways = [0, 1, 2].map((n) => new Gateway(n));
    const work = [
      ...gateways,
      new Deleter(),
      new Publisher(await simulatedFlight({ seed: 7, duration: 60 })),
      new Promoter(readFileSync(join(root, 'docs/examples/campaign.csv'), 'utf8')),
      new Installer(),
    ];
    this.work = work;
    const calibrations = Math.min(20, Math.ceil(times / 2)); // each is published once
    let server = this.begin(disk, cut);
    this.server = server;
    await server.start(k_start_ms);
    for (const one of work) await one.prepare(server, calibrations);
    for (let n = 1; n <= times; n++) {
      let running = true,
        fault = null;
      const clients = work.map(async (one) => {
        while (running) if (!(await one.step(server))) break;
      });
      for (const client of clients) client.catch((error) => (fault ??= error));
      // Long enough now and then for what takes several requests.
      await this.wait(n % 5 === 0 ? 2000 : 350);
      await server.end();
      running = false;
      await Promise.allSettled(clients);
      if (fault) throw fault;
      server = this.server = this.begin(disk, cut);
      const sql = await this.restarted(server, disk);
      for (const one of work) await one.check(sql, server);
      cut ? ++this.counts.cuts : ++this.counts.kills;
      if (n % k_other_every === 0) await this.migration(cut);
      if (n % k_other_every === 5) await this.firstStart(cut);
      if (n % k_rest_every === 0 && n < times) {
        for (const one of work) await one.prepare(server, calibrations);
        this.print(`    ${n} of ${times} ${what}s: ${this.summary(work)}`);
      }
    }
    this.print(`==> ${times} ${what}s: ${this.summary(work)}; 0 lost, 0 twice, 0 half`);
    await server.kill();
    rmSync(disk.data, { recursive: true });
  }

  summary([a, b, c, deleter, publisher, promoter, installer]) {
    return (
      `${a.count + b.count + c.count} rows, ${deleter.count} deletions, ${publisher.count} publications, ` +
      `${promoter.count} promotions, ${installer.count} devices acknowledged`
    );
  }

  /** A database of an older version; its first start with today's program is ended, the second must find one version or the other. */
  async migration(cut) {
    const stored = readdirSync(join(root, 'tests/data/storage'))
      .filter((name) => /^version_\d+\.sql$/.test(name))
      .sort();
    const newest = readdirSync(join(root, 'migrations/sqlite')).filter((name) => name.endsWith('.sql')).length;
    const version = 1 + Math.floor(this.random() * Math.min(stored.length, newest - 1));
    const disk = new Disk(join(this.folder, 'migration'), this.shim, this.seed);
    rmSync(join(this.folder, 'migration'), { recursive: true, force: true });
    mkdirSync(disk.data, { recursive: true, mode: 0o700 });
    const file = join(disk.data, 'anchord.db'),
      sql = query(file);
    execFileSync('sqlite3', [file], {
      input: readFileSync(join(root, 'tests/data/storage', `version_${version}.sql`)),
    });
    const counted = () =>
      sql(
        'SELECT (SELECT count(*) FROM mission) AS missions, (SELECT count(*) FROM uwb_range) AS ranges, (SELECT ' +
          'count(*) FROM fix) AS fixes, (SELECT count(*) FROM anchor) AS anchors',
      );
    const before = counted();
    await this.interrupted(disk, cut, 120);
    const server = (this.other = this.begin(disk, false));
    await this.restarted(server, disk);
    // What recorded before is followed again by itself: the anchors it received are found, none is lost.
    const [{ anchors, ...rows }] = counted(),
      [{ anchors: had, ...rows_before }] = before;
    assert.deepEqual(rows, rows_before, `rows of a database of version ${version} after its migration`);
    assert.ok(anchors >= had, `anchors of a database of version ${version} after its migration`);
    const [{ user_version: now }] = sql('PRAGMA user_version');
    assert.equal(now, newest, 'the version after the migration');
    const copies = readdirSync(join(disk.data, 'backups')).filter(
      (name) => name.startsWith('before-migration-') && name.endsWith('.db'),
    );
    assert.ok(copies.length > 0, 'the copy from before the migration is gone');
    for (const copy of copies) {
      const old = query(join(disk.data, 'backups', copy));
      assert.deepEqual(old('PRAGMA integrity_check'), [{ integrity_check: 'ok' }], copy);
      assert.ok(old('PRAGMA user_version')[0].user_version < now, copy);
    }
    await server.kill();
    ++this.counts.migrations;
  }

  /** Ended while it makes its folder and database; then it starts. */
  async firstStart(cut) {
    const disk = new Disk(join(this.folder, 'first'), this.shim, this.seed);
    rmSync(join(this.folder, 'first'), { recursive: true, force: true });
    await this.interrupted(disk, cut, 150);
    const server = (this.other = this.begin(disk, false));
    await this.restarted(server, disk);
    await server.kill();
    ++this.counts.firstStarts;
  }

  async interrupted(disk, cut, longestMs) {
    const server = (this.other = this.begin(disk, cut));
    const started = server.start();
    started.catch(() => {}); // it is killed before it is ready
    await this.wait(longestMs);
    await server.end();
    await Promise.allSettled([started]);
  }

  /** Everything below the folder, for who looks for the cause. */
  keep(to) {
    rmSync(to, { recursive: true, force: true, maxRetries: 3 });
    cpSync(this.folder, to, { recursive: true });
  }

  async dispose() {
    await this.server?.kill().catch(() => {});
    await this.other?.kill().catch(() => {});
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** True when nothing was lost. `keepIn`: where the folders of a failure go. */
export async function torture({
  kills,
  cuts,
  seed = 1,
  shim = process.env.ANCHORD_POWER_CUT_SHIM,
  keepIn,
  print = console.log,
}) {
  const run = new Torture({ seed, shim, print });
  const began = performance.now();
  try {
    if (kills > 0) await run.underLoad(kills, false);
    if (cuts > 0) {
      assert.ok(shim && existsSync(shim), `no ANCHORD_POWER_CUT_SHIM: ${shim}`);
      await run.underLoad(cuts, true);
    }
    const sorted = run.restarts.sort((a, b) => a - b),
      { migrations, firstStarts } = run.counts;
    print(
      `==> ${run.counts.kills} kills, ${run.counts.cuts} power cuts, ${migrations} interrupted migrations, ` +
        `${firstStarts} interrupted first starts (seed ${seed}); restart to ready: median ` +
        `${(sorted[sorted.length >> 1] / 1000).toFixed(2)} s, worst ${(sorted.at(-1) / 1000).toFixed(2)} s; ` +
        `${((performance.now() - began) / 1000).toFixed(0)} s`,
    );
    return true;
  } catch (error) {
    print(`FAILED after ${run.counts.kills} kills and ${run.counts.cuts} power cuts (seed ${seed}): ${error.stack}`);
    print((run.server?.log ?? '').split('\n').slice(-15).join('\n'));
    print((run.other?.log ?? '').split('\n').slice(-15).join('\n'));
    if (keepIn) {
      run.keep(keepIn);
      print(`the folders are kept in ${keepIn}`);
    }
    return false;
  } finally {
    await run.dispose();
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [kills, cuts, seed] = [
    process.argv[2] ?? 1000,
    process.argv[3] ?? 100,
    process.env.ANCHORD_TORTURE_SEED ?? 1,
  ].map(Number);
  if (![kills, cuts, seed].every((n) => Number.isInteger(n) && n >= 0)) {
    console.error('torture [KILLS [CUTS]]: numbers');
    process.exit(2);
  }
  process.exit((await torture({ kills, cuts, seed, keepIn: join(root, `build/torture-failure-${seed}`) })) ? 0 : 1);
}
