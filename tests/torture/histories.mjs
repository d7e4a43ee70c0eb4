// Clients that change one thing together - the name of a site by PATCH with If-Match, the published revision, the promoted model - and write
// down each call: who, when it began and ended, what was asked and answered. linearizable.mjs then tells whether that can be.
import { ask } from './flights.mjs';
import { versioned } from './linearizable.mjs';
import { sleep } from './machines.mjs';

const number = (etag) => Number(/(\d+)"$/.exec(etag ?? '')?.[1]);
/** What a server that ends, or whose database is away, answers: it may have been done. */
const unknown = ({ status }) => status === 0 || status >= 500 || status === 429;

/** Each asks a server of its own choice, so that an owner of before is asked too. */
export class Historian {
  constructor(urls, token, random, { rest_ms = 30 } = {}) {
    this.urls = urls;
    this.rest_ms = rest_ms;
    this.token = token;
    this.random = random;
    this.operations = [];
    this.values = 0;
    this.published = []; // of the viewers' check
  }
  /** `call` on one server: its result as {output} of a known outcome, {} of an unknown one, null where nothing was asked. */
  async #record(who, key, input, path, init, read) {
    const url = this.urls[Math.floor(this.random() * this.urls.length)],
      op = { key, who, call: performance.now(), end: undefined, input, output: undefined },
      answer = await ask(url, this.token, path, { timeout_ms: 3000, ...init });
    if (answer.never) return null; // nobody listens there: it was not asked
    if (unknown(answer)) {
      if (input.op !== 'read') this.operations.push(op);
      return null;
    }
    op.end = performance.now();
    op.output = read(answer);
    this.operations.push(op);
    if (input.op === 'publish' && !op.output.refused)
      this.published.push({ number: op.output.version, url, call: op.call, end: op.end });
    return op.output;
  }
  #refused({ status, text }) {
    if (status === 422 && text.includes('already active')) return { refused: 'same' };
    if (status === 409 || status === 412) return { refused: 'changed' };
    throw new Error(`${status} ${text.slice(0, 300)}`);
  }
  async #rest() {
    await sleep(this.rest_ms * (1 + 4 * this.random()));
  }

  /** Reads a site, changes it: as two engineers would who do not speak to one another. */
  async site(who, id, going) {
    const path = `/api/v1/sites/${id}`,
      read = (answer) =>
        answer.status === 200 ? { version: number(answer.etag), value: answer.json.name } : this.#refused(answer);
    while (going()) {
      const seen = await this.#record(who, `site ${id}`, { op: 'read' }, path, {}, read);
      await this.#rest();
      if (!seen) continue;
      const value = `name ${++this.values}`,
        init = { method: 'PATCH', json: { name: value }, headers: { 'if-match': `"s-${seen.version}"` } };
      await this.#record(who, `site ${id}`, { op: 'change', match: seen.version, value }, path, init, read);
    }
  }
  /** Two calibrations take turns. */
  async publish(who, calibrations, going) {
    while (going()) {
      await this.#record(who, 'revision', { op: 'read' }, '/api/v1/revisions?limit=1', {}, ({ json }) => ({
        version: json.items[0]?.revision ?? 0,
        value: json.items[0]?.calibration ?? null,
      }));
      await this.#rest();
      const value = calibrations[Math.floor(this.random() * calibrations.length)],
        take = (answer) => (answer.status === 201 ? { version: answer.json.revision } : this.#refused(answer));
      await this.#record(
        who,
        'revision',
        { op: 'publish', value },
        `/api/v1/calibrations/${value}/publish`,
        { json: {} },
        take,
      );
      await this.#rest();
    }
  }
  /** Two models take turns; whoever promotes has read which one is active. */
  async promote(who, models, going) {
    while (going()) {
      const seen = await this.#record(who, 'model', { op: 'read' }, '/api/v1/models/active', {}, (answer) => ({
        version: number(answer.etag),
        value: answer.json.models.nlos_id?.id ?? null,
      }));
      await this.#rest();
      if (!seen) continue;
      const value = models.find((model) => model !== seen.value),
        take = (answer) => (answer.status === 200 ? { version: answer.json.number } : this.#refused(answer)),
        init = { json: { reason: 'torture' }, headers: { 'if-match': `"m-${seen.version}"` } };
      await this.#record(
        who,
        'model',
        { op: 'promote', match: seen.version, value },
        `/api/v1/models/${value}/promote`,
        init,
        take,
      );
      await this.#rest();
    }
  }
}

/** What each key was when its history began: {key: [version, value]}. */
export const modelOf = (begun) => {
  const models = new Map(
    Object.entries(begun).map(([key, [version, value]]) => [
      key,
      versioned(version, value, { again: key.startsWith('site'), gaps: key === 'model' }),
    ]),
  );
  return (key) => models.get(key);
};
