// The machines of ./dev torture cluster: network namespaces of its own with cable.py between them, PostgreSQL, servers and workers in them.
import { execFileSync, spawn } from 'node:child_process';
import { appendFileSync, chownSync, existsSync, mkdirSync, readlinkSync, rmSync, writeFileSync } from 'node:fs';
import { createInterface } from 'node:readline';
import { join } from 'node:path';
import { clockAhead, faketime } from '../e2e/other_clock.mjs';
import { binary, eventually } from '../e2e/server.mjs';

const programs = '/usr/lib/postgresql/15/bin';
export const k_addresses = {
  h: '10.77.0.1',
  s1: '10.77.0.2',
  s2: '10.77.0.3',
  db1: '10.77.0.4',
  db2: '10.77.0.5',
  w: '10.77.0.6',
};
export const haveFaketime = faketime !== undefined;
export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

const running = new Set();
process.on('exit', () => {
  for (const child of running) child.kill('SIGKILL');
});
for (const signal of ['SIGINT', 'SIGTERM', 'SIGHUP']) process.on(signal, () => process.exit(130));
/** A child that ends with this process; `exited` resolves with {code, signal}. */
export function started(words, options = {}) {
  const child = spawn(words[0], words.slice(1), { cwd: '/', stdio: 'ignore', ...options });
  running.add(child);
  child.exited = new Promise((done) => {
    child.once('error', (error) => done({ code: null, error }));
    child.once('exit', (code, signal) => done({ code, signal }));
  });
  child.exited.then(() => running.delete(child));
  return child;
}
const alive = (child) => child !== undefined && child.exitCode === null && child.signalCode === null;

/** Why this machine cannot have such networks; null when it can. `make`: the words that make a namespace. */
export function unable(make) {
  const lacking = ['/dev/net/tun', '/usr/bin/python3', `${programs}/initdb`].filter((path) => !existsSync(path));
  if (lacking.length > 0) return `there is no ${lacking}`;
  try {
    const tries = 'ip link set lo up && ip tuntap add dev probe mode tun && unshare --net true';
    execFileSync(make[0], [...make.slice(1), 'sh', '-c', tries], { stdio: 'pipe' });
    return null;
  } catch (error) {
    return `no network namespaces or TUN devices for this user: ${String(error.stderr ?? error.message)
      .trim()
      .split('\n')
      .at(-1)}`;
  }
}

/** Who is where, and what happens to packets between them. */
export class Network {
  static async make(seed) {
    const network = new Network();
    const machines = Object.entries(k_addresses),
      words = machines.map(([name, address]) => `${name}=${address}`);
    network.cable = started(['/usr/bin/python3', join(import.meta.dirname, 'cable.py'), String(seed), ...words], {
      stdio: ['pipe', 'pipe', 'inherit'],
    });
    network.waiting = [];
    createInterface({ input: network.cable.stdout }).on('line', () => network.waiting.shift()?.());
    await new Promise((done) => network.waiting.push(done));
    network.holders = {};
    const up = (name, within) =>
      execFileSync('sh', [
        '-c',
        `${within} ip link set lo up && ${within} ip addr add ${k_addresses[name]}/24 dev ${name} && ${within} ip link set dev ${name} up`,
      ]);
    up('h', '');
    for (const [name] of machines.slice(1)) {
      const holder = started(['setpriv', '--pdeathsig', 'KILL', 'unshare', '--net', 'sleep', 'infinity']),
        own = readlinkSync('/proc/self/ns/net');
      await eventually('its namespace', () => readlinkSync(`/proc/${holder.pid}/ns/net`) !== own);
      execFileSync('ip', ['link', 'set', 'dev', name, 'netns', String(holder.pid)]);
      network.holders[name] = holder;
      up(name, network.within(name).join(' '));
    }
    return network;
  }
  /** Words before a command that runs on that machine, and ends with this process. */
  within(name, as = []) {
    return ['nsenter', `--net=/proc/${this.holders[name].pid}/ns/net`, 'setpriv', ...as, '--pdeathsig', 'KILL'];
  }
  async #rule(from, to, rule) {
    const done = new Promise((fine) => this.waiting.push(fine));
    this.cable.stdin.write(JSON.stringify({ from, to, ...rule }) + '\n');
    await done;
  }
  /** Both directions between one and each of the others. */
  async set(one, others, rule) {
    for (const other of others) {
      await this.#rule(one, other, rule);
      await this.#rule(other, one, rule);
    }
  }
  /** One direction. */
  oneWay(from, to, rule) {
    return this.#rule(from, to, rule);
  }
  async heal() {
    for (const one of Object.keys(k_addresses))
      for (const other of Object.keys(k_addresses)) if (one !== other) await this.#rule(one, other, {});
  }
}

/** One psql that stays connected; starts again after it lost its server. */
export class Sql {
  constructor(address) {
    this.address = address;
    this.number = 0;
    this.last = Promise.resolve();
  }
  #open() {
    const words = ['psql', '-X', '-A', '-t', '-q', `postgresql://anchord@${this.address}/anchord?connect_timeout=5`];
    const child = started(words, { stdio: ['pipe', 'pipe', 'pipe'] });
    child.stdin.on('error', () => {});
    this.out = '';
    this.wrong = '';
    child.stdout.setEncoding('utf8').on('data', (text) => {
      this.out += text;
      this.look?.();
    });
    child.stderr.setEncoding('utf8').on('data', (text) => (this.wrong += text));
    child.exited.then(() => this.look?.());
    this.child = child;
  }
  /** Lines of what it prints, columns apart by a bar. */
  rows(text) {
    const mine = this.last.then(() => this.#ask(text));
    this.last = mine.catch(() => {});
    return mine;
  }
  #ask(text) {
    if (!alive(this.child)) this.#open();
    const mark = `-- end ${++this.number}`;
    this.out = this.wrong = '';
    this.child.stdin.write(`${text};\n\\warn ${mark}\n\\echo ${mark}\n`);
    return new Promise((done, fail) => {
      const timer = setTimeout(() => this.child.kill('SIGKILL'), 20_000);
      const finish = (how, value) => {
        clearTimeout(timer);
        this.look = null;
        how(value);
      };
      this.look = () => {
        const ended = this.out.indexOf(`${mark}\n`);
        if (ended >= 0 && /ERROR|FATAL/.test(this.wrong)) return finish(fail, new Error(this.wrong));
        if (ended >= 0)
          return finish(
            done,
            this.out
              .slice(0, ended)
              .split('\n')
              .filter(Boolean)
              .map((row) => row.split('|')),
          );
        if (!alive(this.child)) finish(fail, new Error(`psql ended: ${this.wrong}`));
      };
      this.look();
    });
  }
  close() {
    this.child?.kill('SIGKILL');
    this.child = undefined;
  }
}

/** A PostgreSQL on a machine of its own. It refuses to be root: then it is the user that Debian's package made. */
export class Database {
  constructor(network, name, folder) {
    this.network = network;
    this.name = name;
    this.address = `${k_addresses[name]}:5432`;
    this.data = join(folder, name);
    this.log = join(folder, `${name}.log`);
    this.root = process.getuid() === 0;
    this.sql = new Sql(this.address);
  }
  get as() {
    return this.root ? ['--reuid', 'postgres', '--regid', 'postgres', '--clear-groups'] : [];
  }
  #folder() {
    rmSync(this.data, { recursive: true, force: true });
    mkdirSync(this.data, { mode: 0o700 });
    writeFileSync(this.log, '', { flag: 'a' });
    const id = (what) => Number(execFileSync('id', [what, 'postgres'], { encoding: 'utf8' }));
    if (this.root) for (const path of [this.data, this.log]) chownSync(path, id('-u'), id('-g'));
  }
  async #run(words) {
    const child = started([...this.network.within(this.name, this.as), ...words], {
      stdio: ['ignore', 'ignore', 'pipe'],
    });
    let wrong = '';
    child.stderr.setEncoding('utf8').on('data', (text) => (wrong += text));
    const { code } = await child.exited;
    if (code !== 0) throw new Error(`${words[0]}: ${code} ${wrong}`);
  }
  async init() {
    this.#folder();
    await this.#run([
      `${programs}/initdb`,
      '-D',
      this.data,
      '-U',
      'anchord',
      '--auth=trust',
      '-E',
      'UTF8',
      '--no-locale',
      '--no-sync',
    ]);
    // Nobody but these machines is in their network.
    const all = '10.77.0.0/24 trust\n';
    writeFileSync(join(this.data, 'pg_hba.conf'), `host all all ${all}host replication all ${all}`, { flag: 'a' });
    await this.start();
    const as_postgres = new Sql(this.address);
    await this.#run([`${programs}/createdb`, '-h', k_addresses[this.name], '-U', 'anchord', 'anchord']);
    as_postgres.close();
  }
  /** A copy of `primary` that follows it; it commits nothing that this one has not on its disk. */
  async follow(primary) {
    this.#folder();
    await this.#run([
      `${programs}/pg_basebackup`,
      '-D',
      this.data,
      '-d',
      `postgresql://anchord@${primary.address}?application_name=${this.name}`,
      '-R',
      '-X',
      'stream',
      '-c',
      'fast',
      '--no-sync',
    ]);
    await this.start();
    await primary.sql.rows("ALTER SYSTEM SET synchronous_standby_names = '*'");
    await primary.sql.rows('SELECT pg_reload_conf()');
    await eventually(
      'the replica is synchronous',
      async () => (await primary.sql.rows("SELECT 1 FROM pg_stat_replication WHERE sync_state = 'sync'")).length > 0,
      60_000,
      200,
    );
  }
  async promote() {
    await this.sql.rows("ALTER SYSTEM SET synchronous_standby_names = ''");
    await this.sql.rows('SELECT pg_promote(true, 60)');
    await this.sql.rows('SELECT pg_reload_conf()');
  }
  async start() {
    const settings = [
        'port=5432',
        'listen_addresses=*',
        'unix_socket_directories=',
        'log_min_messages=warning',
        'wal_receiver_timeout=10s',
      ],
      words = settings.flatMap((setting) => ['-c', setting]);
    this.child = started([
      ...this.network.within(this.name, this.as),
      'sh',
      '-c',
      `exec "$@" 2>>"$0"`,
      this.log,
      `${programs}/postgres`,
      '-D',
      this.data,
      ...words,
    ]);
    const asked = ['-q', '-U', 'anchord', '-h', k_addresses[this.name]];
    await eventually('PostgreSQL answers', () => {
      try {
        execFileSync(`${programs}/pg_isready`, asked, { stdio: 'pipe' });
        return true;
      } catch {
        if (!alive(this.child)) throw new Error(`PostgreSQL on ${this.name} ended`);
        return false;
      }
    }, 60_000, 100); // prettier-ignore
  }
  /** SIGINT: sessions are cut off; SIGKILL: as the machine would lose its power. */
  async end(signal) {
    this.sql.close();
    if (!alive(this.child)) return;
    this.child.kill(signal);
    await this.child.exited;
  }
}

/** One program of ours on a machine, with what its service manager does: it starts again six seconds after its end. */
class Service {
  constructor(network, machine, file, env) {
    this.network = network;
    this.machine = machine;
    this.file = file;
    this.env = env;
    this.clock_s = 0;
    this.log = '';
    this.kept = true; // the service manager is at work
  }
  start() {
    const env = { ...process.env, ...this.env };
    if (this.clock_s !== 0) Object.assign(env, clockAhead(this.clock_s));
    const child = started([...this.network.within(this.machine), binary, ...this.words()], {
      stdio: ['ignore', 'pipe', 'pipe'],
      env,
    });
    this.child = child;
    for (const stream of [child.stdout, child.stderr])
      stream.setEncoding('utf8').on('data', (text) => {
        this.log = (this.log + text).slice(-200_000);
        appendFileSync(this.file, text);
      });
    child.exited.then(async () => {
      await sleep(6000);
      if (this.kept && this.child === child) this.start();
    });
  }
  get pid() {
    return this.child.pid;
  }
  get alive() {
    return alive(this.child);
  }
  signal(name) {
    this.child.kill(name);
  }
  async stop() {
    this.kept = false;
    this.child.kill('SIGCONT');
    this.child.kill('SIGTERM');
    const late = setTimeout(() => this.child.kill('SIGKILL'), 15_000);
    await this.child.exited;
    clearTimeout(late);
  }
}

export class Server extends Service {
  constructor(network, machine, folder, database) {
    super(network, machine, join(folder, `${machine}.log`), {
      ANCHORD_JOBS_RUN_HERE: 'off',
      ANCHORD_JOBS_LEASE_S: '2',
    });
    this.folder = join(folder, machine);
    this.database = database;
    this.url = `http://${k_addresses[machine]}:8420`;
    mkdirSync(this.folder, { mode: 0o700 });
  }
  words() {
    const where = [
        '--listen',
        `${k_addresses[this.machine]}:8420`,
        '--insecure',
        '--allowed-hosts',
        k_addresses[this.machine],
      ],
      limits = [
        '--rate-per-s',
        '100000',
        '--rate-burst',
        '100000',
        '--solve-after-landing',
        'off',
        '--log-slow-ms',
        '5000',
      ];
    return ['serve', '--data-dir', this.folder, '--database', this.database, '--standby', ...where, ...limits];
  }
}

export class Worker extends Service {
  constructor(network, name, folder, database) {
    super(network, 'w', join(folder, `${name} worker.log`), {});
    this.name = name;
    this.database = database;
  }
  words() {
    return ['worker', '--database', this.database, '--name', this.name, '--lease-s', '2'];
  }
}
