// The words of the product: what a reader stopped at is held out of everything that a user reads.
//   node tests/lint/words.mjs [--all]        every finding with its place; --all counts the words beside
// Read are: strings with a blank and text of the dashboard, descriptions and summaries of the contract, strings with a blank of the
// C++ sources (messages, problems, help of the command line), the documentation. Comments and identifiers are not.
import { readdirSync, readFileSync } from 'node:fs';
import { join, sep } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parse } from 'yaml';

const root = fileURLToPath(new URL('../../', import.meta.url));

/** Word, and what stands for it. A word that means something else too has what makes it the one meant. */
export const FORBIDDEN = [
  [/\btwins?\b|\bsecond places?\b|\b(the )?other place that\b|\btwo places fit\b/i, 'mirror solution'],
  [/\bsaid N?LOS\b/, 'predicted'],
  [/\bLevel( over distance|, dBm)/, 'RSS'],
  [/\bclues?\b/i, 'prior'],
  [/\bbeliefs?\b/i, 'range error model'],
  [/\bjudg(e|es|ed|ing)\b/i, 'validate (input), evaluate (model), assess (estimate), compare'],
  [/\bjudge?ments?\b/i, 'prediction (of a range), check, evaluation'],
  [/\bhappenings?\b/i, 'event'],
  [/\bowed\b/i, 'pending'],
  [/\b(hear|hears|heard|ears?)\b/i, 'receive, in range, last seen'],
  [/\bkeep-?out\b/i, 'clearance (distance), no-fly zone (area)'],
  [/\bfront door\b/i, 'authenticator'],
  [/\bthe house\b/i, 'the codebase'],
  [/\btempered cost\b|\bloss tukey\b/i, 'a sentence with value and limit'],
  [/\bat all costs?\b|\bcost (%|[+−-]?\d)/i, 'misfit; what makes it bad'],
  [/\b(signal|first-path) levels?\b|\b(no|a) level( for a line|,)/i, 'RSS, first-path power'],
  [
    /\b(it|tag|receiver|module|device) (talks|spoke|says nothing)\b|\b(autopilot|laser metre) says\b|\bit says: |\btalks to no\b/i,
    'reports, sends, shows, answers, is connected',
  ],
  [/\bspeaks as (?!PX4)|\bnothing known spoke\b|\blistened to\b/i, 'identifies itself as, answers, is measured'],
  [/\btakes? the order\b/i, 'accept the command'],
  [
    /\b(range|epoch|position) (before )?once more\b|\bthat cannot be\b(?! \w)/i,
    'a repeated range, an impossible position',
  ],
  [/\bgarbage comes\b/i, 'unreadable bytes come'],
  [/\bnobody (said|asked)\b|\bwas not said\b|\bsaid class\b/i, 'is not stated, unexpected, predicted'],
  [/\branges? to doubt\b|\bminus explained\b/i, 'to check, computed'],
  [
    /\b(as|what) (it|they) was dropped\b|\b(what|rows?|messages?) (was|were) dropped\b/i,
    'rejected (with a reason); dropped of a full queue',
  ],
  [/\bobey(s|ed)?\b/i, 'apply'],
  [/\bsuffic(e|es|ed)\b/i, 'cover, be enough'],
  [/\b(tell|tells|told|telling)\b/i, 'report, show, publish, notify, log'],
  [/\blook(s|ed|ing)? out\b/i, 'monitor'],
  [/\b(RX|received) levels?\b/i, 'RSS'],
  [/\bthe way (flown|of (a|the) flight)\b/i, 'flight path'],
];

function* files(folder, ...endings) {
  for (const entry of readdirSync(join(root, folder), { withFileTypes: true })) {
    if (['node_modules', 'generated', 'build'].includes(entry.name)) continue;
    const path = join(folder, entry.name);
    if (entry.isDirectory()) yield* files(path, ...endings);
    else if (endings.some((e) => entry.name.endsWith(e))) yield path;
  }
}
const read = (path) => readFileSync(join(root, path), 'utf8');

/** String literals of C++, TypeScript or JavaScript with their line; comments are skipped, neighbours stay apart. */
export function* literals(text, { jsx = false } = {}) {
  const line_of = (at) => text.slice(0, at).split('\n').length;
  const token =
    /\/\/[^\n]*|\/\*[\s\S]*?\*\/|#\s*include[^\n]*|R"(\w*)\(([\s\S]*?)\)\1"|'(?:\\.|[^'\\\n])*'|"(?:\\.|[^"\\\n])*"|`(?:\\.|[^`\\])*`/g;
  for (const match of text.matchAll(token)) {
    const [all] = match;
    if (all.startsWith('//') || all.startsWith('/*') || all.startsWith('#')) continue;
    const inner = match[2] ?? all.slice(1, -1).replace(/\$\{[^}]*\}/g, '0');
    if (/\s/.test(inner.trim())) yield [line_of(match.index), inner];
  }
  if (!jsx) return;
  // Text between tags and expressions; comments keep their lines and lose their words.
  const bare = text.replace(/\/\/[^\n]*|\/\*[\s\S]*?\*\//g, (c) => c.replace(/[^\n]/g, ' '));
  for (const match of bare.matchAll(/(?<=[>}])([^<>{}=;[\]]*[A-Za-z][^<>{}=;[\]]*)(?=[<{])/g))
    if (/\s/.test(match[1].trim())) yield [line_of(match.index + match[1].search(/\S/)), match[1]];
}

/** Descriptions, summaries and titles of a contract, with their path in it. */
export function* sayings(node, path = '') {
  if (Array.isArray(node)) for (const [i, item] of node.entries()) yield* sayings(item, `${path}/${i}`);
  else if (node && typeof node === 'object')
    for (const [key, value] of Object.entries(node)) {
      if (['description', 'summary', 'title'].includes(key) && typeof value === 'string')
        yield [`${path}/${key}`, value];
      else yield* sayings(value, `${path}/${key}`);
    }
}

/** Prose of a page: blocks and spans of code are not words. */
export function* prose(text) {
  let code = false;
  for (const [i, line] of text.split('\n').entries()) {
    if (/^\s*```/.test(line)) code = !code;
    else if (!code && !/^ {4}\S/.test(line)) yield [i + 1, line.replace(/`[^`]*`/g, '').replace(/\]\([^)]*\)/g, ']')];
  }
}

function* everything() {
  for (const path of files('web/src', '.ts', '.tsx'))
    for (const [line, words] of literals(read(path), { jsx: path.endsWith('.tsx') })) yield [`${path}:${line}`, words];
  for (const path of ['api/openapi.yaml', 'api/asyncapi.yaml'])
    for (const [at, words] of sayings(parse(read(path)))) yield [`${path}${at}`, words];
  for (const folder of ['api', 'core', 'drivers', 'server'])
    for (const path of files(folder, '.cpp', '.hpp'))
      for (const [line, words] of literals(read(path))) yield [`${path}:${line}`, words];
  for (const path of ['README.md', 'CHANGELOG.md', ...files('docs', '.md')])
    if (!path.startsWith(join('docs', 'adr')))
      for (const [line, words] of prose(read(path))) yield [`${path}:${line}`, words];
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const counts = new Map();
  let looked = 0;
  for (const [where, words] of everything()) {
    looked++;
    const plain = words.replace(/`[^`]*`/g, ''); // names of fields and commands
    for (const [pattern, instead] of FORBIDDEN) {
      const found = pattern.exec(plain);
      if (!found) continue;
      counts.set(found[0].toLowerCase(), (counts.get(found[0].toLowerCase()) ?? 0) + 1);
      const near = plain
        .slice(Math.max(0, found.index - 50), found.index + 60)
        .replace(/\s+/g, ' ')
        .trim();
      console.error(`${where.split(sep).join('/')}: "${found[0]}" -> ${instead}\n    ${near}`);
    }
  }
  const wrong = [...counts.values()].reduce((a, b) => a + b, 0);
  if (process.argv.includes('--all'))
    for (const [word, n] of [...counts].sort((a, b) => b[1] - a[1])) console.log(n, word);
  console.log(`${looked} texts, ${wrong} forbidden words`);
  process.exit(wrong ? 1 : 0);
}
