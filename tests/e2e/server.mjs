// Starts the real binary for a test: own port of the system's choice, own data folder, and its end by process id.
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

export const root = resolve(dirname(fileURLToPath(import.meta.url)), '../..');
export const binary = process.env.ANCHORD_BINARY ?? join(root, 'build/release/anchord');

/** Resolves with the first truthy answer of `probe`, asked again until `deadlineMs`; throws with `what` otherwise. */
export async function eventually(what, probe, deadlineMs = 10_000, stepMs = 20) {
  const end = Date.now() + deadlineMs;
  for (;;) {
    const answer = await probe();
    if (answer) return answer;
    if (Date.now() > end) throw new Error(`${what}: not within ${deadlineMs} ms`);
    await new Promise((done) => setTimeout(done, stepMs));
  }
}

// A test file that is ended from outside takes its servers with it.
const running = new Set();
process.on('exit', () => {
  for (const child of running) child.kill('SIGKILL');
});
for (const signal of ['SIGINT', 'SIGTERM', 'SIGHUP']) process.on(signal, () => process.exit(1));

/**
 * One server with its data folder.
 *
 *   const server = await startServer({ auth: 'on' });
 *   await server.fetch('/api/v1/missions');        // with the admin token, when auth is on
 *   await server.kill(); await server.start();     // SIGKILL, then again on the same data and the same port
 *   await server.dispose();                        // stops it and removes the folder
 */
export class Server {
  constructor({ auth = 'off', dataDir, args = [], env = {}, tls, program = binary } = {}) {
    this.program = program;
    this.auth = auth;
    this.ownsDataDir = !dataDir;
    this.dataDir = dataDir ?? mkdtempSync(join(tmpdir(), 'anchord e2e '));
    this.args = args;
    this.tls = tls; // {certificate, key}: HTTPS too, at secureUrl
    this.env = env;
    this.port = 0;
    this.log = '';
    this.exited = Promise.resolve({ code: 0, signal: null });
  }

  get url() {
    return `http://127.0.0.1:${this.port}`;
  }

  get secureUrl() {
    return `https://127.0.0.1:${this.securePort}`;
  }

  get pid() {
    return this.child?.pid;
  }

  /** Starts it and waits until /readyz answers 200. */
  async start(deadlineMs = 15_000) {
    const plain = `127.0.0.1:${this.port}`;
    const listen = this.tls ? `http://${plain},127.0.0.1:${this.securePort ?? 0}` : plain;
    const args = ['serve', '--listen', listen, `--auth=${this.auth}`, '--data-dir', this.dataDir, ...this.args];
    if (this.tls) args.push('--tls-certificate', this.tls.certificate, '--tls-key', this.tls.key);
    this.child = spawn(this.program, args, { stdio: ['ignore', 'pipe', 'pipe'], env: { ...process.env, ...this.env } });
    const child = this.child;
    running.add(child);
    child.once('exit', () => running.delete(child));
    let output = '';
    const collect = (chunk) => {
      output += chunk;
      this.log += chunk;
    };
    child.stdout.setEncoding('utf8').on('data', collect);
    child.stderr.setEncoding('utf8').on('data', collect);
    let ended = null;
    this.exited = new Promise((done) => {
      child.once('error', (error) => done((ended = { code: null, signal: null, error })));
      child.once('exit', (code, signal) => done((ended = { code, signal })));
    });
    // The system chooses the port of ":0"; the server says which one it got.
    await eventually(
      'the server tells its port',
      () => {
        if (ended) throw new Error(`the server ended (${JSON.stringify(ended)}):\n${output}`);
        const match = /http:\/\/127\.0\.0\.1:([1-9]\d*)/.exec(output); // the address of a device is not ours
        const secure = /https:\/\/127\.0\.0\.1:([1-9]\d*)/.exec(output);
        if (match) this.port = Number(match[1]);
        if (secure) this.securePort = Number(secure[1]);
        return match && (!this.tls || secure);
      },
      deadlineMs,
    );
    await eventually(
      'the server is ready',
      async () => {
        if (ended) throw new Error(`the server ended (${JSON.stringify(ended)}):\n${output}`);
        return fetch(`${this.url}/readyz`).then(
          (r) => r.status === 200,
          () => false,
        );
      },
      deadlineMs,
    );
    if (this.auth === 'on') this.token ??= this.#firstRunToken();
    return this;
  }

  /** The admin token of the first run: the only 0600 file with "token" in its name in the data folder. */
  #firstRunToken() {
    const name = readdirSync(this.dataDir).find((file) => file.includes('token'));
    if (!name) throw new Error(`no token file in ${this.dataDir}: ${readdirSync(this.dataDir)}`);
    return readFileSync(join(this.dataDir, name), 'utf8').trim().split(/\s+/).at(-1);
  }

  /** fetch() on the server, with the token; `json` becomes the body and sets the content type. */
  fetch(path, { json, headers = {}, token = this.token, ...init } = {}) {
    const all = { ...headers };
    if (token) all.authorization = `Bearer ${token}`;
    if (json !== undefined) {
      all['content-type'] ??= 'application/json';
      init.body = JSON.stringify(json);
      init.method ??= 'POST';
    }
    return fetch(this.url + path, { ...init, headers: all });
  }

  /** SIGTERM; answers {code, signal} of its end. */
  async stop(deadlineMs = 15_000) {
    return this.#end('SIGTERM', deadlineMs);
  }

  /** SIGKILL, as a crash. */
  async kill() {
    return this.#end('SIGKILL', 60_000); // of a machine that does much else
  }

  async restart() {
    await this.stop();
    return this.start();
  }

  async dispose() {
    await this.stop().catch(() => this.kill());
    if (this.ownsDataDir) rmSync(this.dataDir, { recursive: true, force: true });
  }

  async #end(signal, deadlineMs) {
    const child = this.child;
    if (child && child.exitCode === null && child.signalCode === null) child.kill(signal);
    let timer;
    const late = new Promise((_, fail) => {
      timer = setTimeout(() => fail(new Error(`the server ignores ${signal} for ${deadlineMs} ms`)), deadlineMs);
    });
    try {
      return await Promise.race([this.exited, late]);
    } finally {
      clearTimeout(timer);
    }
  }
}

export async function startServer(options) {
  const server = new Server(options);
  try {
    return await server.start();
  } catch (error) {
    await server.kill().catch(() => {});
    throw error;
  }
}

/** Runs one subcommand to its end: {code, stdout, stderr}. */
export function run(args, { input, env = {}, deadlineMs = 120_000 } = {}) {
  return new Promise((done, fail) => {
    const child = spawn(binary, args, { stdio: ['pipe', 'pipe', 'pipe'], env: { ...process.env, ...env } });
    let stdout = '',
      stderr = '';
    const timer = setTimeout(() => {
      child.kill('SIGKILL');
      fail(new Error(`anchord ${args.join(' ')}: not within ${deadlineMs} ms\n${stderr}`));
    }, deadlineMs);
    child.stdout.setEncoding('utf8').on('data', (chunk) => (stdout += chunk));
    child.stderr.setEncoding('utf8').on('data', (chunk) => (stderr += chunk));
    child.once('error', fail);
    child.once('close', (code) => {
      clearTimeout(timer);
      done({ code, stdout, stderr });
    });
    child.stdin.end(input);
  });
}

export const haveBinary = existsSync(binary);
