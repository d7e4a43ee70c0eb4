// Holds every answer of a server against api/openapi.yaml, and keeps count of the operations that were called.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import Ajv2020 from 'ajv/dist/2020.js';
import addFormats from 'ajv-formats';
import { parse } from 'yaml';
import { root } from './server.mjs';

const methods = ['get', 'put', 'post', 'delete', 'options', 'head', 'patch', 'trace'];
const escape = (part) => part.replaceAll('~', '~0').replaceAll('/', '~1');

export class Contract {
  constructor(document = parse(readFileSync(process.env.ANCHORD_OPENAPI ?? join(root, 'api/openapi.yaml'), 'utf8'))) {
    this.document = document;
    this.ajv = new Ajv2020({ strict: false, allErrors: true, logger: false, validateFormats: true });
    addFormats(this.ajv);
    this.ajv.addSchema(document, 'openapi');
    this.compiled = new Map();
    this.called = new Set();
    const base = new URL(document.servers?.[0]?.url ?? '/', 'http://anchord').pathname.replace(/\/$/, '');
    this.operations = [];
    for (const [path, item] of Object.entries(document.paths)) {
      const own = item.servers ? new URL(item.servers[0].url, 'http://anchord').pathname.replace(/\/$/, '') : base;
      for (const method of methods.filter((m) => item[m])) {
        const template = own + path;
        // Fixed segments win over parameters: /anchors/import before /anchors/{id}.
        const pattern = new RegExp(
          `^${template
            .split(/(\{[^}]+\})/)
            .map((part) => (part.startsWith('{') ? '[^/]+' : part.replace(/[.*+?^$()|[\]\\]/g, '\\$&')))
            .join('')}$`,
        );
        this.operations.push({
          method,
          template,
          pattern,
          name: `${method.toUpperCase()} ${template}`,
          pointer: `/paths/${escape(path)}/${method}`,
          parameters: (template.match(/\{/g) ?? []).length,
        });
      }
    }
    this.operations.sort((a, b) => a.parameters - b.parameters);
  }

  at(pointer) {
    let node = this.document;
    for (const part of pointer.split('/').slice(1)) node = node?.[part.replaceAll('~1', '/').replaceAll('~0', '~')];
    return node;
  }

  /** Follows $ref; answers [node, pointer]. */
  deref(pointer) {
    let node = this.at(pointer);
    while (node?.$ref) {
      pointer = node.$ref.slice(1);
      node = this.at(pointer);
    }
    return [node, pointer];
  }

  check(pointer, value, what) {
    // A pointer in a URI fragment is percent-encoded: `{id}` in a path is not a URI character.
    const ref = 'openapi#' + pointer.split('/').map(encodeURIComponent).join('/');
    let valid = this.compiled.get(ref);
    if (!valid) this.compiled.set(ref, (valid = this.ajv.compile({ $ref: ref })));
    if (valid(value)) return;
    const errors = valid.errors
      .slice(0, 8)
      .map((e) => `  ${e.instancePath || '/'} ${e.message} ${JSON.stringify(e.params)}`);
    throw new Error(
      `${what} does not keep the contract:\n${errors.join('\n')}\n${JSON.stringify(value).slice(0, 1500)}`,
    );
  }

  operation(method, path) {
    return this.operations.find((o) => o.method === method.toLowerCase() && o.pattern.test(path));
  }

  /** Throws when the answer is not one that the document promises. `text` is the body as received. */
  checkAnswer(method, path, response, text) {
    const operation = this.operation(method, path);
    if (!operation) throw new Error(`${method} ${path} is not in the contract`);
    this.called.add(operation.name);
    const what = `${operation.name} -> ${response.status}`;
    const responses = this.at(`${operation.pointer}/responses`);
    const key = [String(response.status), `${String(response.status)[0]}XX`, 'default'].find((k) => responses[k]);
    if (!key)
      throw new Error(`${what}: the contract has no such status (${Object.keys(responses)}): ${text.slice(0, 300)}`);
    const [promised, pointer] = this.deref(`${operation.pointer}/responses/${key}`);
    for (const name of Object.keys(promised.headers ?? {})) {
      const [header] = this.deref(`${pointer}/headers/${escape(name)}`);
      if (header.required && !response.headers.has(name)) throw new Error(`${what}: header ${name} is missing`);
    }
    // What comes twice reaches a client joined: "1, 1" is no number of seconds, and whoever waits for it waits not at all.
    for (const name of ['retry-after', 'content-type', 'etag', 'location'])
      if (/^(.+), \1$/.test(response.headers.get(name) ?? '')) throw new Error(`${what}: header ${name} comes twice`);
    const type = (response.headers.get('content-type') ?? '').split(';')[0].trim();
    if (!promised.content || text === '') {
      if (text !== '') throw new Error(`${what}: a body of ${type} where none is promised: ${text.slice(0, 200)}`);
      if (promised.content && method.toUpperCase() !== 'HEAD') throw new Error(`${what}: the promised body is missing`);
      return;
    }
    if (!promised.content[type])
      throw new Error(
        `${what}: type '${type}' is not promised (${Object.keys(promised.content)}): ${text.slice(0, 300)}`,
      );
    if (type.includes('json') && !type.includes('ndjson') && promised.content[type].schema) {
      let body;
      try {
        body = JSON.parse(text);
      } catch (error) {
        throw new Error(`${what}: not JSON: ${text.slice(0, 200)}`, { cause: error });
      }
      this.check(`${pointer}/content/${escape(type)}/schema`, body, what);
    }
  }

  /** A request that was accepted must be one that the document allows. */
  checkRequest(method, path, json) {
    const operation = this.operation(method, path);
    const [body, pointer] = this.deref(`${operation.pointer}/requestBody`);
    if (!body?.content) throw new Error(`${operation.name}: took a body, the contract knows none`);
    const type = Object.keys(body.content).find((t) => /^application\/(merge-patch\+)?json$/.test(t));
    if (type && body.content[type].schema)
      this.check(`${pointer}/content/${escape(type)}/schema`, json, `request of ${operation.name}`);
  }

  uncalled() {
    return this.operations.map((o) => o.name).filter((name) => !this.called.has(name));
  }
}

/**
 * `server.fetch` with every answer checked. The answer has `.status`, `.headers`, `.text` (string) and `.json`.
 * `expect` is the status wanted; anything else fails with the body in the message.
 */
export function checked(server, contract) {
  return async (method, path, { expect, ...init } = {}) => {
    const bare = path.split('?')[0];
    const send = async () => {
      const response = await server.fetch(path, { method, ...init });
      const text = await response.text();
      contract.checkAnswer(method, bare, response, text);
      return [response, text];
    };
    let [response, text] = await send();
    // A quick machine asks faster than the limit of a token allows: wait for as long as the answer says, as clients do.
    for (let tries = 0; response.status === 429 && expect !== 429 && tries < 5; ++tries) {
      await sleep(Number(response.headers.get('retry-after')) * 1000);
      [response, text] = await send();
    }
    if (response.ok && init.json !== undefined) contract.checkRequest(method, bare, init.json);
    if (expect !== undefined && response.status !== expect) {
      throw new Error(`${method} ${path}: ${response.status} instead of ${expect}: ${text.slice(0, 600)}`);
    }
    const type = response.headers.get('content-type') ?? '';
    return {
      status: response.status,
      headers: response.headers,
      text,
      json: type.includes('json') && !type.includes('ndjson') && text ? JSON.parse(text) : undefined,
    };
  };
}
