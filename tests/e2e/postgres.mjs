// A PostgreSQL of the test's own: its folder, a port that the system chose, passwords asked for, and its end by process id.
import { execFileSync, spawn } from 'node:child_process';
import { chmodSync, chownSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { connect } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { free_tcp_port } from './ports.mjs';
import { eventually } from './server.mjs';

const programs = '/usr/lib/postgresql/15/bin';

/** It refuses to be root: then it is the user that Debian's package made. */
function ordinaryUser() {
  if (process.getuid() !== 0) return {};
  const id = (what) => Number(execFileSync('id', [what, 'postgres'], { encoding: 'utf8' }));
  return { uid: id('-u'), gid: id('-g') };
}

const running = new Set();
process.on('exit', () => {
  for (const child of running) child.kill('SIGINT');
});

/**
 *   const postgres = await startPostgres();
 *   startServer({ args: ['--database', postgres.url('anchord')], env: postgres.env });
 *   await postgres.stop(); await postgres.start();    // the same rows, the same port
 *   await postgres.dispose();
 */
export class Postgres {
  password = `secret ${process.pid}`;

  constructor(settings) {
    this.settings = settings;
    this.user = ordinaryUser();
    this.folder = mkdtempSync(join(tmpdir(), 'anchord postgres '));
    this.data = join(this.folder, 'data');
    mkdirSync(this.data);
    if (this.user.uid !== undefined)
      for (const folder of [this.folder, this.data]) chownSync(folder, this.user.uid, this.user.gid);
    chmodSync(this.folder, 0o755);
  }

  url(database, { user = 'anchord', port = this.port, parameters = '' } = {}) {
    return `postgresql://${user}@127.0.0.1:${port}/${database}${parameters}`;
  }

  /** Where libpq finds the password. */
  get env() {
    return { PGPASSFILE: this.passfile(this.password) };
  }

  passfile(password) {
    const file = join(this.folder, `pass ${password.length}`);
    writeFileSync(file, `*:*:*:*:${password}\n`, { mode: 0o600 });
    return file;
  }

  async init() {
    const secret = join(this.folder, 'superuser');
    writeFileSync(secret, this.password, { mode: 0o644 });
    const how = ['--auth=scram-sha-256', `--pwfile=${secret}`, '-E', 'UTF8', '--no-locale', '--no-sync'];
    execFileSync(`${programs}/initdb`, ['-D', this.data, '-U', 'anchord', ...how], {
      ...this.user,
      cwd: '/',
      stdio: 'pipe',
    });
    this.port = await free_tcp_port();
    return this.start();
  }

  async start() {
    const settings = [`port=${this.port}`, 'listen_addresses=127.0.0.1', 'unix_socket_directories=', ...this.settings];
    const words = settings.flatMap((setting) => ['-c', setting]);
    this.child = spawn(`${programs}/postgres`, ['-D', this.data, ...words], {
      ...this.user,
      cwd: '/',
      stdio: 'ignore',
    });
    const child = this.child;
    running.add(child);
    this.exited = new Promise((done) => child.once('exit', done));
    child.once('exit', () => running.delete(child));
    await eventually('PostgreSQL answers', () => this.psql('SELECT 1').catch(() => ''), 30_000, 100);
    return this;
  }

  /** SIGINT: sessions are cut off at once, as by a restart. */
  async stop() {
    this.child?.kill('SIGINT');
    await this.exited;
  }

  /** To it and every session. SIGSTOP: connections stay and nothing is answered, until SIGCONT. */
  signalAll(signal) {
    const { pid } = this.child;
    process.kill(pid, signal); // first: one that is stopped begins no session
    for (const one of readFileSync(`/proc/${pid}/task/${pid}/children`, 'utf8').trim().split(/\s+/))
      try {
        process.kill(Number(one), signal);
      } catch (error) {
        if (error.code !== 'ESRCH') throw error; // it ended meanwhile
      }
  }

  /** What one statement prints, columns apart by a bar. */
  async psql(sql, database = 'postgres') {
    if (!(await this.listens())) throw new Error('nobody listens');
    const long = sql.length > 100_000, // more than an argument may have
      words = ['-X', '-A', '-t', '-v', 'ON_ERROR_STOP=1', ...(long ? ['-q', '-f', '-'] : ['-c', sql])];
    return execFileSync('psql', [...words, this.url(database)], {
      env: { ...process.env, ...this.env },
      encoding: 'utf8',
      input: long ? sql : '',
      stdio: 'pipe',
    }).trim();
  }

  listens() {
    return new Promise((done) => {
      const socket = connect(this.port, '127.0.0.1');
      socket.once('connect', () => done(true)).once('error', () => done(false));
      socket.once('connect', () => socket.destroy());
    });
  }

  async dispose() {
    await this.stop();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** `settings`: of postgresql.conf, 'name=value'. */
export async function startPostgres(settings = []) {
  const postgres = new Postgres(settings);
  try {
    return await postgres.init();
  } catch (error) {
    await postgres.dispose().catch(() => {});
    throw error;
  }
}
