// The AsyncAPI document against the published JSON schema of its version, and every example of it against its payload.
//   node tests/lint/asyncapi.mjs api/asyncapi.yaml
import { readFileSync } from 'node:fs';
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
for (const [name, message] of Object.entries(document.components?.messages ?? {})) {
  for (const [index, example] of (message.examples ?? []).entries()) {
    examples++;
    const check = payloads.compile({ $ref: `asyncapi#/components/messages/${name}/payload` });
    if (!check(example.payload)) complain(`/components/messages/${name}/examples/${index}`, check.errors);
  }
}
console.log(
  `${file}: AsyncAPI ${document.asyncapi}, ${Object.keys(document.channels ?? {}).length} channels, ${examples} examples, ${wrong} wrong`,
);
process.exit(wrong ? 1 : 0);
