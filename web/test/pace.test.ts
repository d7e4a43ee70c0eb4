import { options } from 'preact';
import { expect, test, vi } from 'vitest';
import { Pace, pace_components } from '../src/state/pace';

const rest_after = (took_ms: number): number => {
  const pace = new Pace();
  pace.begins(1000);
  pace.begins(1000 + took_ms / 2); // what joins a picture does not make it younger
  pace.ends(1000 + took_ms);
  return pace.rest_ms(1000 + took_ms);
};
test('a picture that took long is followed by as long a rest, at most four seconds', () => {
  expect(rest_after(16)).toBe(0);
  expect(rest_after(100)).toBe(0);
  expect(rest_after(400)).toBe(400);
  expect(rest_after(2500)).toBe(2500);
  expect(rest_after(9000)).toBe(4000);
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
test('whoever asks between the frame of a picture and its end waits for its rest', () => {
  const pace = new Pace();
  pace.begins(0);
  expect(pace.rest_ms(20)).toBe(0); // joins it
  pace.paints();
  expect(pace.rest_ms(3000)).toBeGreaterThan(0);
  pace.ends(3001);
  expect(pace.rest_ms(3001)).toBe(3001);
});
test('what a person does is not kept waiting, and is answered with what was said before it', async () => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'performance'] });
  const page = new EventTarget(),
    drawn: string[] = [],
    turns = async (): Promise<void> => {
      for (let i = 0; i < 20; i++) await new Promise((done) => setImmediate(done));
    },
    draw = (what: string, takes_ms = 0): void =>
      options.debounceRendering!(() => {
        vi.advanceTimersByTime(takes_ms);
        drawn.push(what);
      });
  globalThis.requestAnimationFrame = (f) => Number(!setImmediate(() => f(performance.now())));
  pace_components(page);
  draw('a long picture', 400);
  await turns();
  draw('from the stream');
  await turns();
  expect(drawn).toEqual(['a long picture']); // the page rests
  page.dispatchEvent(Object.assign(new Event('pointermove'), { buttons: 0 }));
  expect(drawn).toHaveLength(1);
  page.addEventListener('keydown', () => {
    expect(drawn).toEqual(['a long picture', 'from the stream']);
    draw('the answer');
  });
  page.dispatchEvent(new Event('keydown'));
  await turns();
  expect(drawn).toEqual(['a long picture', 'from the stream', 'the answer']);
  vi.advanceTimersByTime(1);
  draw('from the stream again');
  await turns();
  expect(drawn).toHaveLength(3); // it rests on
  page.addEventListener('input', () => expect(drawn).toHaveLength(3)); // what was typed stands in the page until it is taken
  page.dispatchEvent(new Event('input'));
  expect(drawn).toHaveLength(3);
  vi.advanceTimersByTime(1);
  expect(drawn).toHaveLength(4);
  draw('and again');
  await turns();
  expect(drawn).toHaveLength(4);
  vi.advanceTimersByTime(1000);
  await turns();
  expect(drawn).toHaveLength(5);
  vi.useRealTimers();
});
