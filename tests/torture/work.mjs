// What the clients of a tortured server do, and what each of them was promised. Every kind of work keeps a ledger of what was
// sent and what was acknowledged; `check` holds the restarted server, and its database, to it.
import assert from 'node:assert/strict';
import { eventually } from '../e2e/server.mjs';

export const k_batch_rows = 20;
const lines = (rows) => ({
  method: 'POST',
  headers: { 'content-type': 'application/x-ndjson' },
  body: rows.map((row) => JSON.stringify(row)).join('\n') + '\n',
});
const range = (mission, tag, seq) => ({
  t_us: 1777889472000000 + seq * 1000,
  mission,
  tag,
  anchor: '0x6a2f',
  distance_m: 7.5,
  seq,
});
const blob = (uuid) => `x'${uuid.replaceAll('-', '')}'`;

/** {status, json} or null when the server was gone before it answered. */
export async function ask(server, path, init = {}) {
  try {
    const answer = await server.fetch(path, init);
    const text = await answer.text();
    return { status: answer.status, etag: answer.headers.get('etag'), json: text ? JSON.parse(text) : null, text };
  } catch {
    return null;
  }
}
const must = (answer, status, what) => {
  assert.ok(answer, `${what}: no answer of a server that runs`);
  assert.ok([status].flat().includes(answer.status), `${what}: ${answer.status} ${answer.text.slice(0, 400)}`);
  return answer.json;
};
// Of a server that ends or whose queue is full: to be sent again.
const later = (answer) => answer === null || answer.status === 503 || answer.status === 429;

/** Id of what a job made, once it has ended. */
async function result(server, job) {
  const done = await eventually(
    `job ${job} ends`,
    async () => {
      const now = must(await ask(server, `/api/v1/jobs/${job}`), 200, 'GET job');
      return ['succeeded', 'failed', 'canceled'].includes(now.state) && now;
    },
    600_000,
    200,
  );
  const link = done.links.find((one) => one.rel === 'result');
  assert.ok(link, `job ${job}: ${JSON.stringify(done).slice(0, 400)}`);
  return link.href.split('/').at(-1);
}

export async function newMission(server, name) {
  return must(
    await ask(server, '/api/v1/missions?devices=false', {
      json: { name, frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
    }),
    201,
    'POST missions',
  ).id;
}

/** Batches one after the other, each again until it is answered for. */
export class Gateway {
  constructor(number) {
    this.tag = String(100 + number);
    this.acknowledged = 0;
    this.total = 0;
  }
  async prepare(server) {
    this.total += this.acknowledged * k_batch_rows;
    this.acknowledged = 0;
    this.mission = await newMission(server, `gateway ${this.tag}`);
  }
  async step(server) {
    const rows = Array.from({ length: k_batch_rows }, (_, i) =>
      range(this.mission, this.tag, this.acknowledged * k_batch_rows + i),
    );
    const answer = await ask(server, '/api/v1/ranges', lines(rows));
    if (later(answer)) return false;
    const json = must(answer, 200, 'POST ranges');
    assert.equal(json.rejected, 0, answer.text.slice(0, 400));
    assert.equal(json.accepted + json.duplicates, k_batch_rows, answer.text.slice(0, 400));
    ++this.acknowledged;
    return true;
  }
  check(sql) {
    const [row] = sql(
      'SELECT count(*) AS n, count(DISTINCT seq) AS different, coalesce(max(seq), -1) AS newest FROM uwb_range ' +
        `WHERE mission_key = (SELECT mission_key FROM mission WHERE id = ${blob(this.mission)})`,
    );
    const promised = this.acknowledged * k_batch_rows;
    assert.ok(row.n >= promised, `tag ${this.tag}: ${promised} rows acknowledged, ${row.n} there`);
    assert.ok(
      row.n <= promised + k_batch_rows,
      `tag ${this.tag}: ${row.n} rows there, ${promised} acknowledged and one batch under way`,
    );
    assert.equal(row.n % k_batch_rows, 0, `tag ${this.tag}: half a batch, ${row.n} rows`);
    assert.deepEqual([row.different, row.newest], [row.n, row.n - 1], `tag ${this.tag}: a row twice, or a hole`);
  }
  get count() {
    return this.total + this.acknowledged * k_batch_rows;
  }
}

/** Missions with rows, finished and deleted: each is there whole, or whole in the bin; every second one is then removed for good,
 *  and that goes on after a restart until nothing of it is left. */
export class Deleter {
  constructor() {
    this.open = [];
    this.count = 0;
  }
  prepare() {}
  async step(server) {
    const made = await ask(server, '/api/v1/missions?devices=false', {
      json: { name: 'to be deleted', frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
    });
    if (later(made)) return false;
    const mission = {
      id: must(made, 201, 'POST missions').id,
      rows: 0,
      sent: false,
      gone: false,
      purgeSent: false,
      purged: false,
    };
    this.open.push(mission);
    for (let i = 0; i < 2; i++) {
      const rows = Array.from({ length: k_batch_rows }, (_, n) => range(mission.id, '99', i * k_batch_rows + n));
      const answer = await ask(server, '/api/v1/ranges', lines(rows));
      if (later(answer)) return false;
      must(answer, 200, 'POST ranges');
      mission.rows += k_batch_rows;
    }
    const path = `/api/v1/missions/${mission.id}`;
    const finished = await ask(server, `${path}/actions`, { json: { action: 'finish' } });
    if (later(finished)) return false;
    must(finished, [200, 202], 'finish');
    const now = await ask(server, path);
    if (later(now)) return false;
    mission.sent = true;
    const gone = await ask(server, path, { method: 'DELETE', headers: { 'if-match': now.etag ?? '*' } });
    if (later(gone)) return false;
    must(gone, [200, 202, 204], `DELETE mission ${JSON.stringify(now.json).slice(0, 300)}`);
    mission.gone = true;
    if (++this.count % 2) return true;
    const binned = await ask(server, `${path}?deleted=true`);
    if (later(binned)) return false;
    mission.purgeSent = true;
    const purged = await ask(server, `${path}?purge=true`, {
      method: 'DELETE',
      headers: { 'if-match': binned.etag ?? '*' },
    });
    if (later(purged)) return false;
    must(purged, 204, 'DELETE mission for good');
    mission.purged = true;
    return true;
  }
  async check(sql, server) {
    for (const mission of this.open) {
      const key = `(SELECT mission_key FROM mission WHERE id = ${blob(mission.id)})`;
      const rows = () => sql(`SELECT count(*) AS n FROM uwb_range WHERE mission_key = ${key}`)[0].n;
      const now = await ask(server, `/api/v1/missions/${mission.id}`),
        gone = [404, 410].includes(now?.status);
      assert.ok(gone || now?.status === 200, `GET mission: ${now?.status}`);
      if (mission.gone) assert.ok(gone, `mission ${mission.id} was deleted, and is there again`);
      if (!mission.sent) assert.ok(!gone, `mission ${mission.id} was acknowledged, and is not there`);
      const [marked] = sql(`SELECT emptying FROM mission_bin WHERE mission_key = ${key}`);
      if (mission.purged || marked?.emptying) {
        await eventually(
          `mission ${mission.id}, removed for good, leaves nothing`,
          () => rows() === 0 && sql(`SELECT 1 FROM mission WHERE id = ${blob(mission.id)}`).length === 0,
          20_000,
          50,
        );
      } else if (!mission.purgeSent || marked) {
        const n = rows();
        assert.ok(
          n >= mission.rows && n % k_batch_rows === 0,
          `mission ${mission.id} has ${n} rows, ${mission.rows} were acknowledged`,
        );
      }
    }
    const [{ n }] = sql(
      'SELECT count(*) AS n FROM uwb_range WHERE mission_key NOT IN (SELECT mission_key FROM mission)',
    );
    assert.equal(n, 0, 'rows of a mission that is gone');
    this.open = [];
  }
}

/** Calibrations are published: a revision has every position of its calibration, and each acknowledged one is there. */
export class Publisher {
  constructor(flight) {
    this.flight = flight;
    this.ready = [];
    this.published = [];
    this.unanswered = null;
  }
  async prepare(server, want) {
    if (!this.mission) {
      this.mission = must(
        await ask(server, '/api/v1/missions?devices=false', { json: this.flight.mission }),
        201,
        'POST missions',
      ).id;
      must(await ask(server, `/api/v1/fixes?mission=${this.mission}`, lines(this.flight.fixes)), 200, 'POST fixes');
      must(await ask(server, `/api/v1/ranges?mission=${this.mission}`, lines(this.flight.ranges)), 200, 'POST ranges');
      must(
        await ask(server, `/api/v1/missions/${this.mission}/actions`, { json: { action: 'finish' } }),
        [200, 202],
        'finish',
      );
    }
    while (this.ready.length < want) {
      const solved = await ask(server, '/api/v1/calibrations', {
        json: { missions: [this.mission] },
        headers: { prefer: 'wait=60' },
      });
      const made = must(solved, [200, 201, 202], 'POST calibrations');
      // 202: a busy machine needs longer; the job says where the calibration is.
      this.ready.push({ id: solved.status === 202 ? await result(server, made.id) : made.id });
    }
  }
  async step(server) {
    const calibration = this.ready[0];
    if (!calibration) return false;
    const again = this.unanswered === calibration.id;
    this.unanswered = calibration.id;
    const answer = await ask(server, `/api/v1/calibrations/${calibration.id}/publish`, { json: {} });
    if (later(answer)) return false;
    // 409: the publication whose answer was lost did take place.
    const json = must(answer, again ? [201, 409] : 201, 'publish');
    this.ready.shift();
    this.unanswered = null;
    this.published.push({ id: calibration.id, revision: answer.status === 201 ? json.revision : null });
    return true;
  }
  check(sql) {
    const revisions = sql(
      'SELECT r.number AS number, lower(hex(c.id)) AS calibration, (SELECT count(*) FROM revision_position p WHERE ' +
        'p.number = r.number AND p.since_number = r.number) AS positions FROM revision r JOIN calibration c USING ' +
        '(calibration_key) ORDER BY r.number',
    );
    for (const { id, revision } of this.published) {
      const found = revisions.filter((r) => r.calibration === id.replaceAll('-', ''));
      assert.ok(found.length > 0, `calibration ${id} was published, and is not`);
      if (revision !== null)
        assert.ok(
          found.some((r) => r.number === revision),
          `calibration ${id} was published as revision ${revision}, found ${JSON.stringify(found)}`,
        );
    }
    this.whole ??= revisions[0]?.positions;
    for (const r of revisions)
      assert.ok(
        r.positions > 0 && r.positions === this.whole,
        `revision ${r.number} has ${r.positions} positions, the first had ${this.whole}: half of it was published`,
      );
  }
  get count() {
    return this.published.length;
  }
}

/** Two models take turns: what was acknowledged last is what judges ranges. */
export class Promoter {
  constructor(campaign_csv) {
    this.csv = campaign_csv;
    this.acknowledged = [];
    this.sent = null;
  }
  async prepare(server) {
    if (this.models) return;
    must(await ask(server, '/api/v1/campaigns', { json: { name: 'torture' } }), 201, 'POST campaigns');
    must(
      await ask(server, '/api/v1/campaigns/torture/samples', {
        method: 'POST',
        headers: { 'content-type': 'text/csv' },
        body: this.csv,
      }),
      200,
      'POST samples',
    );
    must(
      await ask(server, '/api/v1/datasets', {
        json: { name: 'torture', campaigns: ['torture'], split: { test: ['room 6'] } },
      }),
      201,
      'POST datasets',
    );
    this.models = [];
    for (const seed of [1, 2]) {
      const run = await ask(server, '/api/v1/training-runs', {
        headers: { prefer: 'wait=120' },
        json: { task: 'nlos_id', dataset: 'torture', methods: ['logistic'], cv: { folds: 3, seed } },
      });
      const made = must(run, [201, 202], 'POST training-runs');
      const done =
        run.status === 201
          ? made
          : must(await ask(server, `/api/v1/training-runs/${await result(server, made.id)}`), 200, 'GET training-run');
      this.models.push(done.model.split('/').at(-1));
    }
  }
  async step(server) {
    const model = this.models[this.acknowledged.length % 2],
      again = this.sent === model;
    this.sent = model;
    const answer = await ask(server, `/api/v1/models/${model}/promote`, { json: { reason: 'torture' } });
    if (later(answer)) return false;
    // 422: it is already the active one, by the promotion whose answer was lost.
    const json = must(answer, again ? [200, 409, 422] : 200, 'promote');
    this.acknowledged.push({ model, number: answer.status === 200 ? json.number : null });
    this.sent = null;
    return true;
  }
  async check(sql, server) {
    const promotions = sql(
      `SELECT p.number AS number, lower(hex(m.id)) AS model FROM model_promotion p JOIN model m USING (model_key) WHERE p.task = 'nlos_id' ORDER BY p.number`,
    );
    const by = new Map(promotions.map((p) => [p.number, p.model]));
    for (const { model, number } of this.acknowledged) {
      if (number !== null)
        assert.equal(by.get(number), model.replaceAll('-', ''), `promotion ${number} was acknowledged`);
    }
    const newest = promotions.at(-1)?.model,
      allowed = [this.acknowledged.at(-1)?.model, this.sent].filter(Boolean).map((id) => id.replaceAll('-', ''));
    if (newest)
      assert.ok(
        allowed.includes(newest),
        `the newest promotion is of ${newest}, acknowledged or under way: ${allowed}`,
      );
    const active = must(await ask(server, '/api/v1/models/active'), 200, 'GET active');
    if (newest)
      assert.ok(
        JSON.stringify(active).replaceAll('-', '').includes(newest),
        `the active model is not that of the newest promotion: ${JSON.stringify(active).slice(0, 300)}`,
      );
  }
  get count() {
    return this.acknowledged.length;
  }
}

/** Devices are kept in a file of their own: set up, taken out. */
export class Installer {
  constructor() {
    this.devices = new Map(); // id -> 'there' | 'going'
    this.count = 0;
    this.number = 0;
  }
  prepare() {}
  async step(server) {
    const made = await ask(server, '/api/v1/devices', {
      json: { kind: 'gnss', name: `d${++this.number}`, address: `serial:/dev/serial/by-id/torture-${this.number}` },
    });
    if (later(made)) return false;
    this.devices.set(must(made, 201, 'POST devices').id, 'there');
    ++this.count;
    if (this.devices.size < 4) return true;
    const [id] = this.devices.keys();
    this.devices.set(id, 'going');
    const gone = await ask(server, `/api/v1/devices/${id}`, { method: 'DELETE', headers: { 'if-match': '*' } });
    if (later(gone)) return false;
    must(gone, [204, 404], 'DELETE device');
    this.devices.set(id, 'gone');
    return true;
  }
  async check(_, server) {
    const now = new Set(
      must(await ask(server, '/api/v1/devices'), 200, 'GET devices')
        .items.filter((d) => d.address?.includes('torture-'))
        .map((d) => d.id),
    );
    for (const [id, state] of this.devices) {
      if (state === 'there') assert.ok(now.has(id), `device ${id} was acknowledged, and is not there`);
      if (state === 'gone') assert.ok(!now.has(id), `device ${id} was taken out, and is there again`);
      if (!now.has(id)) this.devices.delete(id);
      else this.devices.set(id, 'there');
    }
    // What was set up without an answer is taken out, so that the list stays short.
    for (const id of now)
      if (!this.devices.has(id))
        must(
          await ask(server, `/api/v1/devices/${id}`, { method: 'DELETE', headers: { 'if-match': '*' } }),
          204,
          'DELETE device',
        );
  }
}
