import { expect, test } from 'vitest';
import { Pace } from '../src/state/pace';

const rest_after = (took_ms: number): number => {
  const pace = new Pace();
  pace.begins(1000);
  pace.begins(1000 + took_ms / 2); // what joins a picture does not make it younger
  pace.ends(1000 + took_ms);
  return pace.rest_ms(1000 + took_ms);
};
test('a picture that took long is followed by as long a rest, at most a second', () => {
  expect(rest_after(16)).toBe(0);
  expect(rest_after(100)).toBe(0);
  expect(rest_after(400)).toBe(400);
  expect(rest_after(9000)).toBe(1000);
});
test('a rest ends by itself, and by a short picture it is not made longer', () => {
  const pace = new Pace();
  pace.begins(0);
  pace.ends(500);
  expect(pace.rest_ms(700)).toBe(300);
  pace.begins(900);
  pace.ends(920);
  expect(pace.rest_ms(920)).toBe(80);
  expect(pace.rest_ms(1200)).toBe(0);
});
