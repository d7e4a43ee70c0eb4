// The lint of words finds a word in each kind of text, and leaves comments, code and identifiers alone.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FORBIDDEN, literals, prose, sayings } from './words.mjs';

const hits = (texts) => [...texts].filter(([, words]) => FORBIDDEN.some(([p]) => p.test(words))).map(([at]) => at);

test('messages of C++ are read, comments, identifiers and includes are not', () => {
  const source = [
    '#include "core/localize/side_clues.hpp"  // clues',
    '// the twin is told',
    'auto clues = object.at("clues");',
    'fail("the twin of the anchor");',
    'fail("a prior of the anchor", R"(no clue here)");',
  ].join('\n');
  assert.deepEqual(hits(literals(source)), [4, 5]);
});
test('text and attributes of the dashboard are read, names of classes and properties are not', () => {
  const source = [
    '<p class="twin">',
    '  {row.twin} Radios heard',
    '</p>',
    '<b title="was told so">ok</b>',
    'say(`$' + '{n} of $' + '{clues.heard} clues`)',
  ];
  assert.deepEqual(hits(literals(source.join('\n'), { jsx: true })).sort(), [2, 4, 5]);
});
test('text with parentheses is read, and what is written of a thing as of a person is found', () => {
  const source = [
    '<p>',
    '  Tables (.csv) whose names are told on a page',
    '</p>',
    '<p>{"The receiver talks, but it has no position"}</p>',
    '<p>the tag says nothing (yet)</p>',
    'text("mirror: a solution %.2f m away fits as well (cost %+.2f)")',
    '<p>the worst error, at all cost</p>',
    '<p>Garbage comes between its messages</p>',
  ];
  assert.deepEqual([...new Set(hits(literals(source.join('\n'), { jsx: true })))].sort(), [2, 4, 5, 6, 7, 8]);
});
test('descriptions, summaries and titles of a contract are read, wherever they are', () => {
  const contract = { paths: { '/heard': { get: { summary: 'Radios that were heard', tags: ['heard them'] } } } };
  assert.deepEqual(hits(sayings(contract)), ['/paths//heard/get/summary']);
});
test('prose is read, code is not', () => {
  assert.deepEqual(
    hits(prose('What is heard\n```\nheard\n```\n`heard`\n    heard in a command\n[a clue](clue.md)')),
    [1, 7],
  );
});
test('a word is found as a word', () => {
  for (const fine of ['tellurium', 'twinned', 'the household', 'a judgemental', 'nearby', 'hearing aid'])
    assert.ok(!FORBIDDEN.some(([p]) => p.test(fine)), fine);
});
