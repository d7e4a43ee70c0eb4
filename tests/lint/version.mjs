// The version stands once, in CMakeLists.txt; what repeats it must agree, and the changelog must know it.
//   node tests/lint/version.mjs
import { readFileSync } from 'node:fs';

const root = new URL('../../', import.meta.url);
const text = (path) => readFileSync(new URL(path, root), 'utf8');
const version = /project\(anchord VERSION (\d+\.\d+\.\d+)/.exec(text('CMakeLists.txt'))?.[1];
const wrong = [];
if (!version) wrong.push('CMakeLists.txt: no project(anchord VERSION x.y.z)');

const said = [
  ['web/package.json', JSON.parse(text('web/package.json')).version],
  ['web/package-lock.json', JSON.parse(text('web/package-lock.json')).version],
  ['web/package-lock.json, packages', JSON.parse(text('web/package-lock.json')).packages[''].version],
  ['tests/data/wire/rest.version.json', JSON.parse(text('tests/data/wire/rest.version.json')).version],
];
for (const [file, pattern] of [
  ['api/openapi.yaml', /\bversion: (\d+\.\d+\.\d+), git\b/g],
  ['api/asyncapi.yaml', /\banchord (\d+\.\d+\.\d+)\b/g],
  ['tests/data/wire/ws.hello.json', /\banchord (\d+\.\d+\.\d+)\b/g],
]) {
  const found = [...text(file).matchAll(pattern)].map((m) => m[1]);
  if (!found.length) wrong.push(`${file}: no version where one was expected`);
  for (const v of found) said.push([file, v]);
}
for (const [file, v] of said) if (v !== version) wrong.push(`${file}: ${v}, but CMakeLists.txt says ${version}`);
if (!text('CHANGELOG.md').includes(`\n## ${version}`)) wrong.push(`CHANGELOG.md: no section "## ${version}"`);

for (const line of wrong) console.error(line);
console.log(`version ${version}: ${said.length} places, ${wrong.length} wrong`);
process.exit(wrong.length ? 1 : 0);
