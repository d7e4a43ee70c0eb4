// Every JSON body of the OpenAPI document, asked for or answered with 2xx, has an example: its own, or that of its schema.
//   node tests/lint/examples.mjs api/openapi.yaml
import { readFileSync } from 'node:fs';
import { parse } from 'yaml';

const file = process.argv[2];
const document = parse(readFileSync(file, 'utf8'));
const at = (node) => {
  while (node?.$ref)
    node = node.$ref
      .split('/')
      .slice(1)
      .reduce((whole, key) => whole[key.replaceAll('~1', '/')], document);
  return node;
};
const shown = (node) => 'example' in node || 'examples' in node;
const missing = [];
let bodies = 0;
for (const operations of Object.values(document.paths)) {
  for (const operation of Object.values(operations)) {
    if (!operation?.operationId) continue;
    const all = Object.entries(operation.responses).filter(([code]) => code.startsWith('2'));
    if (operation.requestBody) all.push(['request', operation.requestBody]);
    for (const [what, body] of all) {
      for (const [type, media] of Object.entries(at(body).content ?? {})) {
        if (!type.includes('json') || type.includes('ndjson')) continue;
        bodies++;
        if (!shown(media) && !shown(at(media.schema))) missing.push(`${operation.operationId} ${what} ${type}`);
      }
    }
  }
}
for (const one of missing) console.error(`${file}: ${one}: no example`);
console.log(`${file}: ${bodies} JSON bodies, ${missing.length} without an example`);
process.exit(missing.length || bodies < 200 ? 1 : 0);
