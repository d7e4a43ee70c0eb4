import { expect, test } from 'vitest';
import { Press } from '../src/views/flight/press';

const asked = (put_ms: number, shown_ms: number): Press => {
  const press = new Press();
  press.ask(put_ms);
  press.shown(shown_ms);
  return press;
};
test('a second tap within four seconds of the question confirms, however late the page hears of it', () => {
  expect(asked(1000, 1100).confirms(5000)).toBe(true);
  expect(asked(1000, 1100).confirms(5200)).toBe(false);
  expect(asked(1000, 6000).confirms(9900)).toBe(true); // a picture of five seconds is not the person's time
});
test('a tap from before the question answers nothing, and one answer is taken once', () => {
  expect(new Press().confirms(10)).toBe(false);
  const press = new Press();
  press.ask(1000); // of a tap at 300, taken up late
  expect(press.confirms(450)).toBe(false); // a double tap
  expect(press.confirms(1200)).toBe(true); // seen, and the page knows of its own picture later
  expect(press.confirms(1300)).toBe(false);
});
test('a hold answers an open question: no single tap confirms after it, though the picture comes later', () => {
  for (const hold of [(p: Press) => p.held_until(3500), (p: Press) => p.rings(3500, 3500) === 'fire']) {
    const press = new Press();
    press.ask(1000);
    press.down(2500);
    expect(hold(press)).toBe(true);
    press.shown(3600);
    expect(press.confirms(3700)).toBe(false);
  }
});
test('a hold is as long as the finger was down, and no longer', () => {
  const press = new Press();
  press.down(0);
  expect(press.held_until(999)).toBe(false);
  press.down(2000);
  expect(press.held_until(3000)).toBe(true); // both taken up at once
  press.down(4000);
  press.left();
  expect(press.held_until(5500)).toBe(false);
});
test('a timer that rings late waits once for the finger that may be up already', () => {
  const press = new Press();
  expect(press.rings(1000, 1000)).toBe('nothing');
  press.down(0);
  expect(press.rings(1000, 1020)).toBe('fire');
  expect(press.rings(1000, 1020)).toBe('nothing');
  press.down(2000);
  expect(press.rings(3000, 4200)).toBe('wait');
  press.left(); // its event had waited: a tap, no hold
  expect(press.rings(4200, 4210)).toBe('nothing');
  press.down(5000);
  expect(press.rings(6000, 7000)).toBe('wait');
  expect(press.rings(7000, 8000)).toBe('fire'); // down all the while
});
