// A gateway under test and what is round it: a tag that speaks NDJSON over TCP, and a link to the server that can be slow, cut or silent.
import { spawn } from 'node:child_process';
import { randomUUID } from 'node:crypto';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { binary, eventually, run } from './server.mjs';

/** Ranges of one tag to several anchors, so many a second, each with its own number; what was sent is remembered. */
export class Feeder {
  sent = []; // {t_us, seq, anchor, mm}
  #sockets = new Set();
  #seq = 0;

  async start() {
    this.server = createServer((socket) => {
      socket.write('\n');
      this.#sockets.add(socket);
      socket.on('error', () => {}).on('close', () => this.#sockets.delete(socket));
    });
    await new Promise((done) => this.server.listen(0, '127.0.0.1', done));
    this.address = `tcp://127.0.0.1:${this.server.address().port}`;
    return this;
  }
  get connected() {
    return this.#sockets.size > 0;
  }
  /** Rows of now, about `count` of them. */
  burst(count) {
    let lines = '';
    const t_us = Date.now() * 1000;
    for (let i = 0; i < count; i++) {
      const row = { t_us: t_us + i, seq: this.#seq++, anchor: 100 + (this.#seq % 6), mm: 5000 + (this.#seq % 20000) };
      this.sent.push(row);
      lines += `{"t":${row.t_us},"n":${row.seq},"to":${row.anchor},"mm":${row.mm},"dbm":-80.5}\n`;
    }
    for (const socket of this.#sockets) socket.write(lines);
  }
  /** A line as it is; not among what was sent. */
  raw(line) {
    for (const socket of this.#sockets) socket.write(line);
  }
  run(rowsPerS) {
    const period = 50;
    let owed = 0;
    let last = performance.now();
    this.timer = setInterval(() => {
      const now = performance.now();
      owed += ((now - last) / 1000) * rowsPerS;
      last = now;
      const n = Math.floor(owed);
      owed -= n;
      if (n > 0) this.burst(n);
    }, period);
  }
  pause() {
    clearInterval(this.timer);
  }
  close() {
    this.pause();
    for (const socket of this.#sockets) socket.destroy();
    this.server.close();
  }
}

const mapping = {
  tag: { value: '0x6e01' },
  anchor: '/to',
  distance: { pointer: '/mm', unit: 'mm' },
  time: { pointer: '/t', unit: 'us', clock: 'utc' },
  rss: { pointer: '/dbm', unit: 'dBm' },
  seq: '/n',
};

/** The way to a server: `bytesPerS` each way (0: as fast as it goes); up, cut (nobody answers the door) or silent (nothing comes through). */
export class LinkProxy {
  bytesPerS = 0;
  delayMs = 0; // each way, of a link that has room for everything
  toServer = 0; // bytes
  toClient = 0;
  #pairs = new Set();
  #waiting = [];
  #state = 'up';

  constructor(port) {
    this.target = port;
  }
  async start() {
    await this.#listen(0);
    this.port = this.server.address().port;
    return this;
  }
  get url() {
    return `http://127.0.0.1:${this.port}`;
  }
  #listen(port) {
    this.server = createServer({ highWaterMark: 4096 }, (socket) => this.#accept(socket));
    return new Promise((done) => this.server.listen(port, '127.0.0.1', done));
  }
  #accept(client) {
    client.on('error', () => {});
    if (this.#state === 'silent') {
      client.pause();
      this.#waiting.push(client);
      return;
    }
    const server = connect({ port: this.target, host: '127.0.0.1', highWaterMark: 4096 });
    const pair = { client, server };
    this.#pairs.add(pair);
    const end = () => {
      client.destroy();
      server.destroy();
      this.#pairs.delete(pair);
    };
    server.on('error', end).on('close', end);
    client.on('error', end).on('close', end);
    this.#pump(client, server, (n) => (this.toServer += n));
    this.#pump(server, client, (n) => (this.toClient += n));
  }
  /** Bytes leave at the rate of the link, and no more are read than are on their way. */
  #pump(from, to, count) {
    let free = 0;
    from.on('data', (bytes) => {
      count(bytes.length);
      if (this.bytesPerS === 0) {
        if (this.delayMs === 0) to.write(bytes);
        else setTimeout(() => to.destroyed || to.write(bytes), this.delayMs);
        return;
      }
      from.pause();
      const now = performance.now();
      free = Math.max(now, free) + (bytes.length / this.bytesPerS) * 1000;
      setTimeout(() => {
        if (!to.destroyed) to.write(bytes);
        if (this.#state !== 'silent') from.resume();
      }, free - now);
    });
  }
  async cut() {
    this.#state = 'cut';
    for (const { client, server } of this.#pairs) {
      client.destroy();
      server.destroy();
    }
    await new Promise((done) => this.server.close(done));
  }
  silence() {
    this.#state = 'silent';
    for (const { client, server } of this.#pairs) {
      client.pause();
      server.pause();
    }
  }
  async restore() {
    const before = this.#state;
    this.#state = 'up';
    if (before === 'cut') await this.#listen(this.port);
    for (const { client, server } of this.#pairs) {
      client.resume();
      server.resume();
    }
    for (const client of this.#waiting.splice(0)) this.#accept(client);
  }
  close() {
    for (const { client, server } of this.#pairs) {
      client.destroy();
      server.destroy();
    }
    for (const client of this.#waiting) client.destroy();
    this.server.close();
  }
}

/** `anchord gateway` in a folder of its own, with the feeder for its device. */
export class GatewayProcess {
  log = '';
  env = {}; // beside that of the test
  constructor({ to, token, feeder, args = [] }) {
    this.folder = mkdtempSync(join(tmpdir(), 'anchord gateway '));
    this.dataDir = join(this.folder, 'data');
    this.to = to;
    this.args = args;
    this.tokenFile = join(this.folder, 'token');
    if (token) this.setToken(token);
    mkdirSync(this.dataDir, { mode: 0o700 });
    const device = { id: randomUUID(), kind: 'ndjson', name: 'tag', address: feeder.address, options: { mapping } };
    writeFileSync(
      join(this.dataDir, 'devices.json'),
      JSON.stringify({ schema: 'anchord.devices/1', devices: [{ ...device, enabled: true, version: 1 }] }),
    );
  }
  setToken(token) {
    writeFileSync(this.tokenFile, token + '\n', { mode: 0o600 });
  }
  async start(extra = []) {
    rmSync(join(this.dataDir, 'address'), { force: true });
    const args = ['gateway', '--to', this.to, '--data-dir', this.dataDir, '--token-file', this.tokenFile];
    this.child = spawn(binary, [...args, '--listen', '127.0.0.1:0', ...this.args, ...extra], {
      stdio: ['ignore', 'pipe', 'pipe'],
      env: { ...process.env, ...this.env },
    });
    const child = this.child;
    for (const stream of [child.stdout, child.stderr])
      stream.setEncoding('utf8').on('data', (text) => (this.log += text));
    this.exited = new Promise((done) => child.once('exit', (code, signal) => done({ code, signal })));
    await eventually('the gateway answers', () => {
      if (child.exitCode !== null) throw new Error(`the gateway ended with ${child.exitCode}: ${this.log}`);
      return this.status().catch(() => null);
    });
    return this;
  }
  get url() {
    return readFileSync(join(this.dataDir, 'address'), 'utf8').trim();
  }
  async status() {
    return (await fetch(`${this.url}/status`)).json();
  }
  async alarms() {
    return (await this.status()).alarms.map((alarm) => alarm.code);
  }
  cli(...words) {
    return run(['gateway', 'status', '--data-dir', this.dataDir, ...words]);
  }
  rejected() {
    const text = readFileSync(join(this.dataDir, 'rejected.ndjson'), 'utf8');
    return text
      .trim()
      .split('\n')
      .map((line) => JSON.parse(line));
  }
  async kill(signal = 'SIGKILL') {
    this.child.kill(signal);
    return this.exited;
  }
  async dispose() {
    if (this.child?.exitCode === null && this.child.signalCode === null) await this.kill();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** A token for gateways. */
export async function gatewayToken(server, roles = ['gateway', 'viewer']) {
  const made = await server.fetch('/api/v1/tokens', { json: { name: 'gateway', roles } });
  return (await made.json()).token;
}

/** A mission that records with the devices of its server. */
export async function recordingMission(server, name = 'flight') {
  const json = { name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] };
  const made = await server.fetch('/api/v1/missions', { json });
  return (await made.json()).id;
}

/** Numbers of the ranges that a server has of a mission, in the order in which it stored them. */
export async function storedNumbers(server, mission) {
  const answer = await server.fetch(`/api/v1/ranges?mission=${mission}&format=ndjson`);
  const text = await answer.text();
  if (!answer.ok) throw new Error(text);
  return text
    .split('\n')
    .filter(Boolean)
    .map((line) => JSON.parse(line).seq);
}

/** How many rows a server has of a mission, without reading them. */
export async function storedCount(server, mission) {
  return (await (await server.fetch(`/api/v1/missions/${mission}`)).json()).n_ranges;
}
