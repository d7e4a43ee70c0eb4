// What a client of the last release would trip over in a newer contract. usage: node breaking.mjs OLD.yaml NEW.yaml [ACCEPTED.txt]
//
// Found: a path or method that is gone; a success status, media type or field of an answer that is gone or no longer sure to
// come; a field of an answer whose type is another; a parameter or request field that is new and required, gone, or takes
// less than before (type, values, length). Not found: what only words say.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { parse } from 'yaml';

const methods = ['get', 'put', 'post', 'delete', 'patch'];

/** A schema as one object: references followed, allOf folded in. */
function flat(doc, schema, seen = []) {
  if (!schema || typeof schema !== 'object') return {};
  if (schema.$ref) {
    if (seen.includes(schema.$ref)) return { recursive: true };
    const path = schema.$ref.replace('#/', '').split('/');
    const { $ref, ...beside } = schema;
    const target = path.reduce((at, key) => at?.[key], doc);
    return merge(flat(doc, target, [...seen, $ref]), beside);
  }
  if (!schema.allOf) return schema;
  const { allOf, ...beside } = schema;
  return [...allOf.map((one) => flat(doc, one, seen)), beside].reduce(merge, {});
}
const merge = (a, b) => ({
  ...a,
  ...b,
  properties: { ...a.properties, ...b.properties },
  required: [...(a.required ?? []), ...(b.required ?? [])],
});
/** A parameter, body or answer itself, where a reference stands for it. */
const deref = (doc, node) =>
  node?.$ref
    ? node.$ref
        .replace('#/', '')
        .split('/')
        .reduce((at, key) => at?.[key], doc)
    : (node ?? {});

const types = (schema) => {
  if (schema.type) return [schema.type].flat();
  if (schema.const !== undefined) return [typeof schema.const];
  if (schema.enum) return [...new Set(schema.enum.map((v) => (v === null ? 'null' : typeof v)))];
  return [];
};
const values = (schema) => (schema.const !== undefined ? [schema.const] : schema.enum);
const branches = (schema) => schema.anyOf ?? schema.oneOf;

/** Compares two schemas; `report(where, what)`. `sent`: by the client, so that taking less breaks; else giving less does. */
export class Comparison {
  constructor(before, after) {
    [this.before, this.after] = [before, after];
    this.found = [];
    this.done = new Set();
  }
  report(where, what) {
    this.found.push(`${where}: ${what}`);
  }

  schema(where, oldSchema, newSchema, sent, depth = 0) {
    // Named schemas are compared once for each direction, not for every place that names them.
    if (oldSchema?.$ref && newSchema?.$ref) {
      const key = `${oldSchema.$ref} ${newSchema.$ref} ${sent}`;
      if (this.done.has(key)) return;
      this.done.add(key);
      if (oldSchema.$ref === newSchema.$ref) where = oldSchema.$ref.replace('#/components/schemas/', '');
    }
    if (depth > 30) return;
    const a = flat(this.before, oldSchema);
    const b = flat(this.after, newSchema);
    if (a.recursive || b.recursive) return;
    if (this.alternatives(where, a, b, sent, depth)) return;
    this.type(where, a, b, sent);
    this.words(where, a, b, sent);
    if (a.items && b.items) this.schema(`${where}[]`, a.items, b.items, sent, depth + 1);
    this.properties(where, a, b, sent, depth);
  }

  /** One of several forms: each old one must be found again. True: that was all there is to compare. */
  alternatives(where, a, b, sent, depth) {
    const [olds, news] = [branches(a), branches(b)];
    if (!olds && !news) return false;
    if (olds && news) {
      const left = [...news];
      olds.forEach((old, i) => {
        const at = left.findIndex((one) => !this.tries(old, one, sent, depth));
        if (at >= 0) left.splice(at, 1);
        else if (sent || news.length >= olds.length)
          this.report(where, `form ${i + 1} of ${olds.length} is not what it was`);
      });
      return true;
    }
    if (news) {
      // A form was one of what are several now: for what is sent that is wider, an answer may be another.
      if (news.every((one) => this.tries(a, one, sent, depth)) || !sent) this.report(where, 'has several forms now');
      return true;
    }
    if (sent) this.report(where, 'has one form now');
    return true;
  }
  /** Whether there would be anything to report. */
  tries(a, b, sent, depth) {
    const trial = new Comparison(this.before, this.after);
    trial.schema('', a, b, sent, depth + 1);
    return trial.found.length > 0;
  }

  type(where, a, b, sent) {
    const [was, is] = [types(a), types(b)];
    if (!was.length || !is.length) return;
    const covers = (wide, one) => wide.includes(one) || (one === 'integer' && wide.includes('number'));
    // What is sent must still be taken; what comes must still be one of what came.
    const lost = sent ? was.filter((one) => !covers(is, one)) : is.filter((one) => !covers(was, one));
    if (lost.length) this.report(where, sent ? `${lost} is no longer taken` : `may be ${lost} now, was ${was}`);
  }

  words(where, a, b, sent) {
    if (!sent) return; // clients tolerate new words in answers (api.md section 1)
    const [was, is] = [values(a), values(b)];
    if (is && was) {
      const lost = was.filter((word) => !is.includes(word));
      if (lost.length) this.report(where, `no longer takes ${lost.join(', ')}`);
    } else if (is && !was && !types(a).includes('boolean')) {
      this.report(where, `takes only ${is.join(', ')} now`);
    }
    for (const [limit, tighter] of [
      ['maximum', (x, y) => y < x],
      ['maxLength', (x, y) => y < x],
      ['maxItems', (x, y) => y < x],
      ['minimum', (x, y) => y > x],
      ['minLength', (x, y) => y > x],
      ['minItems', (x, y) => y > x],
    ])
      if (b[limit] !== undefined && (a[limit] === undefined || tighter(a[limit], b[limit])))
        this.report(where, `${limit} is ${b[limit]}, was ${a[limit] ?? 'none'}`);
  }

  properties(where, a, b, sent, depth) {
    for (const [name, old] of Object.entries(a.properties ?? {})) {
      const now = b.properties?.[name];
      const at = `${where}.${name}`;
      if (now === undefined) {
        if (!sent || b.additionalProperties === false) this.report(at, sent ? 'is no longer taken' : 'is gone');
        continue;
      }
      if (!sent && a.required?.includes(name) && !b.required?.includes(name)) this.report(at, 'may be absent now');
      this.schema(at, old, now, sent, depth + 1);
    }
    if (!sent) return;
    for (const name of new Set(b.required ?? []))
      if (!a.required?.includes(name)) this.report(`${where}.${name}`, 'is required now');
  }

  parameters(where, old, now) {
    const key = (p) => `${p.in} ${p.name}`;
    const list = (doc, ps) => new Map((ps ?? []).map((p) => deref(doc, p)).map((p) => [key(p), p]));
    const [was, is] = [list(this.before, old), list(this.after, now)];
    for (const [name, p] of was)
      if (!is.has(name)) {
        // The name of a part of the path is nobody's but the document's.
        if (p.in !== 'path') this.report(`${where} ${name}`, 'is no longer taken');
      } else this.schema(`${where} ${name}`, p.schema, is.get(name).schema, true);
    for (const [name, p] of is)
      if (p.required && p.in !== 'path' && !was.get(name)?.required) this.report(`${where} ${name}`, 'is required now');
  }

  contents(where, old, now, sent) {
    for (const [type, { schema }] of Object.entries(old ?? {})) {
      if (!now?.[type]) this.report(`${where} ${type}`, sent ? 'is no longer taken' : 'is gone');
      else this.schema(`${where} ${type}`, schema, now[type].schema, sent);
    }
  }

  operation(where, old, now) {
    this.parameters(where, old.parameters, now.parameters);
    const [oldBody, newBody] = [deref(this.before, old.requestBody), deref(this.after, now.requestBody)];
    if (newBody.required && !oldBody.required) this.report(`${where} body`, 'is required now');
    this.contents(`${where} body`, oldBody.content, newBody.content, true);
    for (const [status, answer] of Object.entries(old.responses ?? {})) {
      if (!status.startsWith('2')) continue; // clients take any problem
      if (!now.responses?.[status]) this.report(`${where} ${status}`, 'is no longer an answer');
      else
        this.contents(
          `${where} ${status}`,
          deref(this.before, answer).content,
          deref(this.after, now.responses[status]).content,
          false,
        );
    }
  }

  run() {
    // /sites/{id} and /sites/{site} are the same address.
    const bare = (path) => path.replace(/\{\w+\}/g, '{}');
    const now = new Map(Object.entries(this.after.paths).map(([path, item]) => [bare(path), item]));
    for (const [path, old] of Object.entries(this.before.paths)) {
      const item = now.get(bare(path));
      for (const method of methods.filter((m) => old[m])) {
        const where = `${method.toUpperCase()} ${path}`;
        if (!item?.[method]) this.report(where, 'is gone');
        else {
          const all = (one, operation) => ({
            ...operation,
            parameters: [...(one.parameters ?? []), ...(operation.parameters ?? [])],
          });
          this.operation(where, all(old, old[method]), all(item, item[method]));
        }
      }
    }
    return this.found;
  }
}

export const breaking = (before, after) => new Comparison(before, after).run();

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [before, after, accepted] = process.argv.slice(2);
  const read = (file) => readFileSync(file, 'utf8');
  const found = breaking(parse(read(before)), parse(read(after)));
  const known = accepted
    ? read(accepted)
        .split('\n')
        .filter((line) => line && !line.startsWith('#'))
    : [];
  const fresh = found.filter((one) => !known.includes(one));
  const stale = known.filter((one) => !found.includes(one));
  for (const one of fresh) console.log(`breaking: ${one}`);
  for (const one of stale) console.log(`accepted, but not there: ${one}`);
  console.log(`${found.length} breaking changes, ${known.length - stale.length} of them accepted`);
  process.exitCode = fresh.length || stale.length ? 1 : 0;
}
