// libfaketime: another clock for a program that the tests start; times that only run on stay right.
import { existsSync } from 'node:fs';

export const faketime = ['x86_64', 'aarch64']
  .map((cpu) => `/usr/lib/${cpu}-linux-gnu/faketime/libfaketimeMT.so.1`)
  .find(existsSync);

/** What such a program needs in its environment, beside the FAKETIME... variable that says the time. */
export const otherClock = () => ({ LD_PRELOAD: faketime, FAKETIME_DONT_FAKE_MONOTONIC: '1' });
/** The same for a clock that is ahead by so much, or behind. */
export const clockAhead = (seconds) => ({ ...otherClock(), FAKETIME: `${seconds > 0 ? '+' : ''}${seconds}s` });
