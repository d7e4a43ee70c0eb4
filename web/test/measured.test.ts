import { describe, expect, it } from 'vitest';
import { Measured, type TimeOf } from '../src/state/measured';

/// A server whose clock is right, and a page that has been open for `page_ms`: what at_ms() says is turned into an age.
const T0_US = 1_800_000_000_000_000;
class Page {
  readonly measured = new Measured();
  now_ms = 50_000;
  private server_us = T0_US;
  wait(ms: number): void {
    this.now_ms += ms;
    this.server_us += ms * 1000;
  }
  /// Age of a row that was measured `ago_ms` ago, by a clock that is ahead by `ahead_ms`.
  age(
    ago_ms: number,
    how: { ahead_ms?: number; live?: boolean; of?: TimeOf; data_age_ms?: number; teaches?: boolean } = {},
  ): number {
    const { ahead_ms = 0, live = true, of = 'position', data_age_ms = 100, teaches = true } = how,
      arrival = {
        t_us: this.server_us - ago_ms * 1000 + ahead_ms * 1000,
        now_ms: this.now_ms,
        server_now_us: this.server_us,
        data_age_ms,
        live,
      };
    return this.now_ms - this.measured.at_ms('m', of, arrival, teaches);
  }
  /// A device that sends ten rows a second, each `late_ms` on its way.
  hears(ms: number, late_ms: number, ahead_ms = 0): number {
    let age = NaN;
    for (let t = 0; t < ms; t += 100) {
      age = this.age(late_ms, { ahead_ms });
      this.wait(100);
    }
    return age;
  }
}

describe('the age of a value', () => {
  it('counts from when it was measured in what a page is given as it is loaded', () => {
    expect(new Page().age(240_000, { live: false })).toBe(240_000);
  });
  it('is none of a row that comes as it is made', () => {
    const page = new Page();
    page.hears(1000, 80);
    expect(page.age(80)).toBe(0);
  });
  it('is the lateness of a row that comes later than the others', () => {
    const page = new Page();
    page.hears(3000, 80);
    expect(page.age(480)).toBe(400);
  });
  it('is never negative', () => {
    const page = new Page();
    page.hears(1000, 80);
    expect(page.age(-5000)).toBe(0);
    expect(page.age(0, { live: false })).toBeGreaterThanOrEqual(0);
  });
  it('leaves out by how much the clock of the rover is ahead', () => {
    const page = new Page();
    expect(page.hears(200, 80, 360_000)).toBe(0);
    page.wait(20_000);
    expect(page.age(20_000, { live: false, ahead_ms: 360_000 })).toBeCloseTo(20_000 - 80, 6);
  });
  it('is unknown, not young, of a silent rover whose clock is ahead', () => {
    expect(new Page().age(240_000, { live: false, ahead_ms: 360_000 })).toBe(Infinity);
  });
  it('leaves out by how much the clock of the rover is behind, once its lag stays', () => {
    const page = new Page();
    expect(page.age(80, { ahead_ms: -360_000, live: false })).toBe(360_080);
    expect(page.hears(3000, 80, -360_000)).toBe(0);
  });
  it('is that of the measurement while a gateway catches up', () => {
    const page = new Page();
    page.hears(1000, 80);
    for (let late_ms = 600_000; late_ms > 20_000; late_ms -= 2000) {
      expect(page.age(late_ms)).toBe(late_ms - 80);
      page.wait(100);
    }
  });
  it('learns nothing of a clock from a link that is late', () => {
    const page = new Page();
    for (let i = 0; i < 50; i++, page.wait(100)) page.age(4000, { data_age_ms: 4000 });
    expect(page.age(4000, { data_age_ms: 4000 })).toBe(4000);
  });
  it('is counted from its arrival while nothing was timely yet: a recording replayed faster than it was flown', () => {
    const page = new Page();
    for (let late_ms = 60_000, i = 0; i < 50; i++, late_ms -= 500, page.wait(100)) expect(page.age(late_ms)).toBe(0);
  });
  it('is by the clock of the server of what the server itself says', () => {
    const page = new Page();
    page.hears(3000, 80, -360_000);
    expect(page.age(7000, { of: 'server' })).toBe(7000);
  });
  it('of an estimate follows the clock that timed its ranges', () => {
    const page = new Page();
    for (let i = 0; i < 30; i++, page.wait(100)) page.age(80, { of: 'range', ahead_ms: -5000 });
    expect(page.age(480_000, { of: 'range', ahead_ms: -5000, live: false, teaches: false })).toBeCloseTo(479_920, 6);
  });
});
