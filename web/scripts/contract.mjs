// What the page believes of the API comes from the contract: src/api/generated/schema.d.ts (types), limits.ts (of every property
// with a default: that, its least and most) and secrets.ts (names of what is only written). Not committed; written anew before each check, build and test.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import yaml from 'js-yaml';
import openapiTS, { astToString } from 'openapi-typescript';

const contract = new URL('../../api/openapi.yaml', import.meta.url),
  folder = fileURLToPath(new URL('../src/api/generated/', import.meta.url));

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
put('schema.d.ts', astToString(await openapiTS(contract, { emptyObjectsUnknown: true })));
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
