import { expect, test } from 'vitest';
import { typed_number } from '../src/ui/typed_number';

test('a number is read with a point or a comma, and with the minus of any keyboard or table', () => {
  expect(['4.5', '4,5', ' 4,5 ', '+4.5', '.5', '7', '1e3'].map(typed_number)).toEqual([
    4.5, 4.5, 4.5, 4.5, 0.5, 7, 1000,
  ]);
  expect(['-0,28', '−0.28', '–0.28'].map(typed_number)).toEqual([-0.28, -0.28, -0.28]);
});
test('nothing is nothing, and what is no number is none', () => {
  expect(['', '  '].map(typed_number)).toEqual([null, null]);
  for (const text of ['0.1 m', '1.2.3', '1,2,3', '1 000', '0x10', 'Infinity', '-', 'abc'])
    expect(typed_number(text)).toBeNaN();
});
