/// Every dialog is one of `ui/use_dialog`: what has the role of one beside it would have the focus, or the way back, of none.
import { readdirSync, readFileSync } from 'node:fs';
import { expect, it } from 'vitest';

const src = new URL('../src/', import.meta.url),
  files = readdirSync(src, { recursive: true, encoding: 'utf8' }).filter((f) => /\.tsx?$/.test(f)),
  at = (pattern: RegExp): string[] => files.filter((f) => pattern.test(readFileSync(new URL(f, src), 'utf8'))).sort();

it('gives the role of a dialog by the hook alone', () => {
  expect(at(/role(=|: )["'{]*(alert)?dialog|<dialog|aria-modal/)).toEqual(['ui/use_dialog.ts']);
});
it('listens to Escape there alone, but for what is no dialog', () => {
  expect(at(/'Escape'/)).toEqual([
    'ui/keyboard.ts', // leaves a field
    'ui/use_dialog.ts',
    'views/measurements/use_measurements.ts', // closes the row that is chosen
  ]);
});
it('is called by as many components as spread what it gives', () => {
  for (const f of at(/useDialog</)) {
    const text = readFileSync(new URL(f, src), 'utf8');
    for (const [, name] of text.matchAll(/(\w+) = useDialog</g)) expect(text, f).toContain(`{...${name}}`);
  }
});
