// What the page believes of the API comes from the contract: src/api/generated/schema.d.ts (types of REST), stream.d.ts (types of the stream's
// messages), limits.ts (of every property with a default: that, its least and most) and secrets.ts (names of what is only written). Not committed;
// written anew before each check, build and test.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import yaml from 'js-yaml';
import openapiTS, { astToString } from 'openapi-typescript';

const contract = new URL('../../api/openapi.yaml', import.meta.url),
  stream = new URL('../../api/asyncapi.yaml', import.meta.url),
  folder = fileURLToPath(new URL('../src/api/generated/', import.meta.url));

const OPTIONS = { emptyObjectsUnknown: true, defaultNonNullable: false };

/** Only where it changed, so that nothing is built for nothing. */
function put(name, text) {
  let former;
  try {
    former = readFileSync(folder + name, 'utf8');
  } catch {
    /* the first time */
  }
  if (former !== text) writeFileSync(folder + name, text);
}

/** The payloads of AsyncAPI are JSON schemas, which is what an OpenAPI document has under its components: one generator reads both. */
async function message_types() {
  const { info, components } = yaml.load(readFileSync(stream, 'utf8')),
    schemas = Object.fromEntries(
      Object.entries(components.messages).map(([key, { name, payload }]) => [
        key.startsWith('topic.') ? `topic.${name}` : name,
        payload,
      ]),
    );
  return astToString(await openapiTS({ openapi: '3.1.0', info, paths: {}, components: { schemas } }, OPTIONS));
}

const KEYS = ['default', 'minimum', 'maximum', 'enum'];
function limits(schemas) {
  const out = {};
  for (const [name, schema] of Object.entries(schemas)) {
    const of = {};
    for (const [property, rule] of Object.entries(schema.properties ?? {})) {
      if ('default' in rule) of[property] = Object.fromEntries(KEYS.filter((k) => k in rule).map((k) => [k, rule[k]]));
    }
    if (Object.keys(of).length) out[name] = of;
  }
  return out;
}

/** Names of all fields that the contract has as passwords, or as written and never read: nothing of the page may keep them. */
function secrets(node, found = new Set()) {
  for (const [name, rule] of Object.entries(node ?? {})) {
    if (rule === null || typeof rule !== 'object') continue;
    if (rule.writeOnly === true || rule.format === 'password') found.add(name);
    secrets(rule, found);
  }
  return found;
}

mkdirSync(folder, { recursive: true });
put('schema.d.ts', astToString(await openapiTS(contract, OPTIONS)));
put('stream.d.ts', await message_types());
const whole = yaml.load(readFileSync(contract, 'utf8')),
  { components } = whole;
put(
  'limits.ts',
  `/// Written by scripts/contract.mjs from api/openapi.yaml.\nexport const LIMITS = ${JSON.stringify(limits(components.schemas), null, 1)} as const;\n`,
);
const names = JSON.stringify([...secrets(whole)].sort());
put(
  'secrets.ts',
  `/// Written by scripts/contract.mjs from api/openapi.yaml.\nexport const SECRETS: ReadonlySet<string> = new Set(${names});\n`,
);
