// The load of ./dev torture cluster, and what each client was promised: flights whose rows come in, somebody who makes sites under an
// Idempotency-Key, somebody who writes to the server that was the owner and to no other, viewers of the live stream.
import WebSocket from 'ws';
import { sleep } from './machines.mjs';

const k_patience_ms = 45_000; // of who waits for longer than a statement of the server may take
const k_anchors = [
    [0, 0, 4],
    [30, 0, 4],
    [30, 20, 5],
    [0, 20, 3],
  ], // metres east, north, up
  k_origin = { lon: 3.7131, lat: 51.0231, h_m: 50 },
  k_start_us = 1_790_000_000_000_000,
  k_rows_a_second = 100, // of one flight: ten fixes, the rest ranges
  k_post_every_ms = 500,
  k_most_rows = 300; // in one request

/** Where the tag is after so many rows, in metres: round the building. */
function place(row) {
  const turn = row / 4000;
  return [15 + 28 * Math.cos(turn), 10 + 22 * Math.sin(turn), 6 + 2 * Math.sin(turn * 3)];
}
function rowOf(seq) {
  const t_us = k_start_us + seq * 10_000,
    [east, north, up] = place(seq);
  if (seq % 10 === 0)
    return {
      fix: true,
      row: {
        t_us,
        seq,
        lon: k_origin.lon + east / 70_040,
        lat: k_origin.lat + north / 111_250,
        h_m: k_origin.h_m + up,
        fix: 'fixed',
        sigma_m: [0.01, 0.01, 0.02],
      },
    };
  const number = seq % k_anchors.length,
    anchor = k_anchors[number];
  return {
    row: {
      t_us,
      seq,
      tag: '0x6e01',
      anchor: `0x6a2${number}`,
      distance_m: Number(Math.hypot(east - anchor[0], north - anchor[1], up - anchor[2]).toFixed(3)),
    },
  };
}
const ndjson = (rows) => ({
  method: 'POST',
  headers: { 'content-type': 'application/x-ndjson' },
  body: rows.map((row) => JSON.stringify(row)).join('\n') + '\n',
});

/** One request to one server: {status, json, etag}; status 0 where nobody answered, with `never` when it cannot have been received. */
export async function ask(url, token, path, { json, headers = {}, timeout_ms = 5000, ...init } = {}) {
  const all = { authorization: `Bearer ${token}`, ...headers };
  if (json !== undefined) {
    all['content-type'] = 'application/json';
    init.body = JSON.stringify(json);
    init.method ??= 'POST';
  }
  try {
    const answer = await fetch(url + path, { ...init, headers: all, signal: AbortSignal.timeout(timeout_ms) }),
      text = await answer.text();
    return { status: answer.status, etag: answer.headers.get('etag'), json: text ? JSON.parse(text) : null, text };
  } catch (error) {
    return { status: 0, never: error.cause?.code === 'ECONNREFUSED', text: String(error.cause ?? error) };
  }
}

/** A good client: asks the server that answered last, then the other one, until it has an answer that is one. */
export class Client {
  constructor(urls, token) {
    this.urls = urls;
    this.token = token;
    this.at = 0;
    this.going = true;
  }
  async call(path, init) {
    for (;;) {
      const url = this.urls[this.at],
        began = performance.now(),
        answer = await ask(url, this.token, path, init);
      if (answer.status !== 0 && answer.status !== 503 && answer.status !== 429) return { ...answer, url, began };
      if (!this.going) return null;
      // Unless another call has moved on already.
      if (this.urls[this.at] === url) this.at = (this.at + 1) % this.urls.length;
      await sleep(100);
    }
  }
}

/** Rows of one flight, as a gateway sends them: in order, each until it is acknowledged. */
export class Flight {
  constructor(number, client, acknowledged) {
    this.name = `flight ${number}`;
    this.client = client;
    this.acknowledged = acknowledged; // called with each answer that counts
    this.patience_ms = number % 2 === 0 ? k_patience_ms : 8000;
    this.made = 0;
    this.sent = 0;
  }
  async prepare() {
    const mission = { name: this.name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
      made = await this.client.call('/api/v1/missions?devices=false', {
        json: mission,
        headers: { 'idempotency-key': this.name },
      });
    if (made.status !== 201) throw new Error(`POST missions: ${made.status} ${made.text}`);
    this.mission = made.json.id;
  }
  async fly(going) {
    const began = performance.now(),
      before = this.made;
    while (going()) {
      this.made = before + Math.floor(((performance.now() - began) / 1000) * k_rows_a_second);
      await this.#send();
      await sleep(k_post_every_ms);
    }
    await this.#send();
  }
  async #send() {
    while (this.sent < this.made) {
      const next = Math.min(this.made, this.sent + k_most_rows),
        rows = Array.from({ length: next - this.sent }, (_, i) => rowOf(this.sent + i));
      await this.#post(
        'fixes',
        rows.filter(({ fix }) => fix),
      );
      await this.#post(
        'ranges',
        rows.filter(({ fix }) => !fix),
      );
      this.sent = next;
    }
  }
  async #post(kind, rows) {
    if (rows.length === 0) return;
    const answer = await this.client.call(`/api/v1/${kind}?mission=${this.mission}`, {
        ...ndjson(rows.map(({ row }) => row)),
        timeout_ms: this.patience_ms,
      }),
      { accepted = 0, duplicates = 0 } = answer.json ?? {};
    if (answer.status !== 200 || accepted + duplicates !== rows.length)
      throw new Error(`${this.name}, POST ${kind}: ${answer.status} ${answer.text.slice(0, 300)}`);
    this.acknowledged(answer, rows.length);
  }
  finish() {
    return this.client.call(`/api/v1/missions/${this.mission}/actions`, {
      json: { action: 'finish' },
      headers: { 'idempotency-key': `${this.name} finish` },
    });
  }
  /** {lost, doubled, wrong}: of all rows that were acknowledged by now. */
  async check(sql) {
    const key = `(SELECT mission_key FROM mission WHERE id = '\\x${this.mission.replaceAll('-', '')}')`,
      of = (table) =>
        sql.rows(
          `SELECT count(*), count(DISTINCT seq), coalesce(max(seq), -1), coalesce(min(seq), 0) FROM ${table} WHERE mission_key = ${key}`,
        ),
      fixes = Math.ceil(this.sent / 10),
      out = { lost: 0, doubled: 0, wrong: [] };
    for (const [table, want] of [
      ['fix', fixes],
      ['uwb_range', this.sent - fixes],
    ]) {
      const [[n, different, newest]] = (await of(table)).map((row) => row.map(Number));
      out.doubled += n - different;
      out.lost += Math.max(0, want - different);
      if (n !== want || newest >= this.sent)
        out.wrong.push(
          `${this.name}: ${want} rows of ${table} were acknowledged, ${n} are there, ${different} different, the newest is number ${newest}`,
        );
    }
    return out;
  }
}

/** Sites under an Idempotency-Key: what is sent again after a lost answer must not be done twice. */
export class Maker {
  constructor(client) {
    this.client = client;
    this.names = [];
    this.doubled = new Set(); // each is reported once
  }
  async make(going) {
    while (going()) {
      const name = `made ${this.names.length}`,
        made = await this.client.call('/api/v1/sites', {
          json: { name, origin: k_origin },
          headers: { 'idempotency-key': name },
        });
      if (!made) return;
      // 409: it is still being done, or was, and its answer was lost: who asks then looks.
      if (made.status !== 201 && made.status !== 409) throw new Error(`POST sites: ${made.status} ${made.text}`);
      if (made.status === 201 || (await this.#there(name))) this.names.push(name);
      await sleep(500);
    }
  }
  async #there(name) {
    for (let cursor = ''; cursor !== null;) {
      const page = await this.client.call(`/api/v1/sites?limit=1000${cursor && `&cursor=${cursor}`}`);
      if (!page) return false;
      if (page.json.items.some((site) => site.name === name)) return true;
      cursor = page.json.next_cursor;
    }
    return false;
  }
  async check(sql) {
    const rows = await sql.rows("SELECT name, count(*) FROM site WHERE name LIKE 'made %' GROUP BY name"),
      there = new Map(rows.map(([name, n]) => [name, Number(n)]));
    return {
      lost: this.names.filter((name) => !there.has(name)).length,
      doubled: [...there]
        .filter(([name, n]) => n > 1 && !this.doubled.has(name) && this.doubled.add(name))
        .map(([name, n]) => `${n} sites "${name}" of one Idempotency-Key`),
    };
  }
}

/** Rows to one server alone, each sent once: none that was sent after another one had the lease may be stored. */
export class Straggler {
  constructor(url, token, mission) {
    this.url = url;
    this.token = token;
    this.mission = mission;
    this.rows = [];
    this.open = new Set();
    this.going = true;
    this.done = this.#send();
  }
  async #send() {
    while (this.going) {
      const row = { seq: this.rows.length, at: performance.now(), status: null };
      this.rows.push(row);
      const body = ndjson([
        { t_us: k_start_us + row.seq, seq: row.seq, tag: '0x7001', anchor: '0x6a20', distance_m: 10 },
      ]);
      const asked = ask(this.url, this.token, `/api/v1/ranges?mission=${this.mission}`, {
        ...body,
        timeout_ms: k_patience_ms,
      }).then((answer) => {
        row.status = answer.status;
        this.open.delete(asked);
      });
      this.open.add(asked);
      await sleep(150);
    }
    await Promise.all(this.open);
  }
  /** `taken`: when another server was seen to have the lease; Infinity where none took it. */
  async check(sql, taken) {
    this.going = false;
    await this.done;
    const key = `(SELECT mission_key FROM mission WHERE id = '\\x${this.mission.replaceAll('-', '')}')`,
      rows = await sql.rows(`SELECT seq, count(*) FROM uwb_range WHERE mission_key = ${key} GROUP BY seq`),
      there = new Map(rows.map(([seq, n]) => [Number(seq), Number(n)]));
    const late = this.rows.filter(({ at }) => at > taken);
    return {
      late: late.length,
      lost: this.rows.filter(({ seq, status }) => status === 200 && !there.has(seq)).length,
      doubled: [...there.values()].filter((n) => n > 1).length,
      accepted: late
        .filter(({ seq, status }) => status === 200 || there.has(seq))
        .map(
          ({ seq, status }) =>
            `row ${seq}, sent to a server that had lost the lease: answer ${status}, ${there.has(seq) ? 'stored' : 'not stored'}`,
        ),
    };
  }
}

/** One page that watches: within an epoch nothing is missing that was not announced as a gap, and after another owner it begins anew. */
export class Viewer {
  constructor(urls, token, random) {
    this.urls = urls;
    this.token = token;
    this.random = random;
    this.at = 0;
    this.wrong = [];
    this.epochs = new Map(); // epoch: the server it came from
    this.last = new Map(); // topic: {epoch, seq}
    this.revisions = new Map(); // number: epoch
    this.counts = { messages: 0, resumed: 0, anew: 0, gaps: 0 };
    this.covered = null; // {epoch, url, from, to}: seen without a hole
    this.coverage = [];
    this.going = true;
    this.done = this.#watch();
  }
  async #watch() {
    while (this.going) {
      if (!(await this.#connected(this.urls[this.at]))) this.at = (this.at + 1) % this.urls.length;
      await sleep(100);
    }
  }
  #connected(url) {
    return new Promise((ended) => {
      const socket = new WebSocket(url.replace('http', 'ws') + '/api/v1/ws', 'anchord.v1', {
        headers: { authorization: `Bearer ${this.token}` },
        perMessageDeflate: false,
        handshakeTimeout: 2000,
      });
      this.socket = socket;
      const topics = new Map();
      let epoch = null,
        heartbeat = performance.now();
      // As the dashboard does: five seconds without a sign of life are a lost connection.
      const timer = setInterval(() => performance.now() - heartbeat > 5000 && socket.terminate(), 500),
        away = setTimeout(() => socket.terminate(), 2000 + 4000 * this.random()); // its Wi-Fi, now and then
      socket.on('error', () => {});
      socket.once('close', () => {
        clearInterval(timer);
        clearTimeout(away);
        ended(epoch !== null);
      });
      socket.on('message', (data) => {
        heartbeat = performance.now();
        for (const message of [JSON.parse(String(data))].flat()) {
          if (message.op === 'hello') {
            epoch = message.epoch;
            const before = this.epochs.get(epoch);
            if (before !== undefined && before !== url)
              this.wrong.push(`epoch ${epoch} came from ${before} and from ${url}`);
            this.epochs.set(epoch, url);
            ['events', 'revisions', 'ranges'].forEach((topic, id) => {
              const last = this.last.get(topic);
              socket.send(JSON.stringify({ op: 'sub', id, topic, ...(last && { since: last }) }));
            });
          } else this.#message(message, topics, epoch, url);
        }
      });
    });
  }
  #message(message, topics, epoch, url) {
    const topic = topics.get(message.sub);
    if (message.op === 'ack') {
      const name = ['events', 'revisions', 'ranges'][message.id],
        last = this.last.get(name);
      topics.set(message.sub, name);
      if (message.recovered && last?.epoch !== epoch)
        this.wrong.push(`${name}: recovered from epoch ${last?.epoch} in epoch ${epoch}`);
      if (message.recovered && message.from_seq !== last.seq + 1)
        this.wrong.push(`${name}: resumed from ${message.from_seq}, asked for ${last.seq + 1}`);
      message.recovered ? ++this.counts.resumed : ++this.counts.anew;
      this.last.set(name, { epoch, seq: message.from_seq - 1 });
      if (name !== 'revisions') return;
      if (!message.recovered || this.covered?.epoch !== epoch)
        this.coverage.push((this.covered = { epoch, url, from: performance.now(), to: performance.now() }));
    } else if (message.op === 'data' && topic) {
      const last = this.last.get(topic);
      ++this.counts.messages;
      // Lossless topics have each number, also where one frame has several; of a stream what is missing was announced.
      const whole = topic === 'ranges' || [message.data].flat().length === message.seq - message.prev;
      if (message.prev !== last.seq || message.seq <= last.seq || !whole)
        this.wrong.push(`${topic}, epoch ${epoch}: ${message.seq} (before it ${message.prev}) came after ${last.seq}`);
      this.last.set(topic, { epoch, seq: message.seq });
      if (topic === 'revisions')
        for (const { number, revision } of [message.data].flat()) this.revisions.set(number ?? revision, epoch);
    } else if (message.op === 'snap' && topic === 'revisions') {
      for (const { number, revision } of [message.data ?? []].flat()) this.revisions.set(number ?? revision, epoch);
    } else if (message.op === 'gap') {
      ++this.counts.gaps;
      if (topic !== 'ranges') this.wrong.push(`${topic}: a gap in what is lossless: ${JSON.stringify(message)}`);
      this.last.set(topic, { epoch, seq: message.to_seq });
    }
    if (this.covered?.epoch === epoch) this.covered.to = performance.now();
  }
  /** `published`: {number, url, call, end} of what was acknowledged: who watched that server all the time has seen it. */
  check(published) {
    for (const { number, url, call, end } of published) {
      const watched = this.coverage.find((one) => one.url === url && one.from < call && one.to > end + 1500);
      if (watched && !this.revisions.has(number))
        this.wrong.push(`revision ${number} was acknowledged by ${url} and never shown in epoch ${watched.epoch}`);
    }
    return this.wrong.splice(0);
  }
  async close() {
    this.going = false;
    this.socket?.terminate();
    await this.done;
  }
}
