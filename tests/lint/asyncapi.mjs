// The AsyncAPI document against the published JSON schema of its version; and every example against its payload, those of the document and those of
// tests/data/wire, which both the server's writers and the dashboard's guards are tested with.
//   node tests/lint/asyncapi.mjs api/asyncapi.yaml
import { readFileSync, readdirSync } from 'node:fs';
import { createRequire } from 'node:module';
import Ajv from 'ajv';
import Ajv2020 from 'ajv/dist/2020.js';
import addFormats from 'ajv-formats';
import { parse } from 'yaml';

const require = createRequire(import.meta.url);
const file = process.argv[2];
const document = parse(readFileSync(file, 'utf8'));
let wrong = 0;

function complain(where, errors) {
  wrong++;
  for (const error of errors.slice(0, 20))
    console.error(`${file}: ${where}${error.instancePath}: ${error.message} ${JSON.stringify(error.params)}`);
}

let schema;
try {
  schema = require(`@asyncapi/specs/schemas/${document.asyncapi}-without-$id.json`);
} catch {
  console.error(`${file}: no published schema for AsyncAPI version ${document.asyncapi}`);
  process.exit(1);
}
const meta = new Ajv({ strict: false, allErrors: true, logger: false });
addFormats(meta);
const valid = meta.compile(schema);
if (!valid(document)) complain('', valid.errors);

const payloads = new Ajv2020({ strict: false, allErrors: true, logger: false });
addFormats(payloads);
payloads.addSchema(document, 'asyncapi');
let examples = 0;
const messages = Object.entries(document.components?.messages ?? {});
function compare(name, payload, where) {
  examples++;
  const check = payloads.compile({ $ref: `asyncapi#/components/messages/${name}/payload` });
  if (!check(payload)) complain(where, check.errors);
}
for (const [name, message] of messages)
  for (const [index, example] of (message.examples ?? []).entries())
    compare(name, example.payload, `/components/messages/${name}/examples/${index}`);

const wire = new URL('../data/wire/', import.meta.url);
for (const path of readdirSync(wire).filter((one) => /^(topic|ws)\..*json$/.test(one))) {
  // topic.anchors.estimates.found.json is of the topic anchors.estimates, ws.time.request.json of the message timeRequest.
  const [kind, ...words] = path.split('.').slice(0, -1),
    named = (n) => {
      const said = words.slice(0, n).join('.');
      return kind === 'topic'
        ? messages.find(([key, m]) => key.startsWith('topic.') && m.name === said)
        : messages.find(([key]) => key.toLowerCase() === said.replaceAll('.', ''));
    },
    [name] = words.map((_, i) => named(words.length - i)).find((m) => m) ?? [];
  if (name) compare(name, JSON.parse(readFileSync(new URL(path, wire), 'utf8')), `tests/data/wire/${path}`);
  else complain(path, [{ instancePath: '', message: 'is of no message', params: {} }]);
}
console.log(
  `${file}: AsyncAPI ${document.asyncapi}, ${Object.keys(document.channels ?? {}).length} channels, ${examples} examples, ${wrong} wrong`,
);
process.exit(wrong ? 1 : 0);
