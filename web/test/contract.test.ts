import { describe, expect, it } from 'vitest';
import { address, call, get, given, list, url } from '../src/api/contract';
import { num, unchecked, str, words_of } from '../src/live/messages';
import type { Topic } from '../src/live/stream';

describe('the address of a call of the contract', () => {
  it('has its parts filled in and escaped', () =>
    expect(address('/campaigns/{id}/samples/{sample}/cir', { id: 'hall 1/a', sample: 7 })).toBe(
      '/campaigns/hall%201%2Fa/samples/7/cir',
    ));
  it('asks for what is named, and for nothing that is absent', () =>
    expect(address('/ranges', {}, { anchor: '0x6a21', cir: true, cursor: null, until: undefined })).toBe(
      '/ranges?anchor=0x6a21&cir=true',
    ));
  it('keeps zero and false, which are values', () =>
    expect(address('/ranges', {}, { min_distance_m: 0, cir: false })).toBe('/ranges?min_distance_m=0&cir=false'));
});

describe('what is given', () => {
  it('is what was given, zero and false included', () =>
    expect(given<object>({ a: 0, b: false, c: '', d: null, e: undefined, f: 'x' })).toEqual({
      a: 0,
      b: false,
      f: 'x',
    }));
});

// Each line below is an error of the compiler, or this file does not compile. It is compiled, not run: there is no server here.
describe('what the contract does not have', () => {
  it('does not compile in a request', () => {
    const requests = [
      // @ts-expect-error no such path
      () => get('/anchor'),
      // @ts-expect-error no such method of the path
      () => call('put', '/anchors'),
      // @ts-expect-error which plan?
      () => get('/plans/{id}'),
      // @ts-expect-error the part of the path has another name
      () => get('/plans/{id}', { path: { plan: 'p' } }),
      // @ts-expect-error no such parameter
      () => list('/ranges', { query: { mission: 'm', anchors: '0x1' } }),
      // @ts-expect-error no such parameter where some are left out
      () => list('/ranges', { query: given({ mission: 'm', anchors: null }) }),
      // @ts-expect-error no such word of the parameter
      () => url('/anchors', { query: { format: 'xls' } }),
      // @ts-expect-error nothing to sign in with
      () => call('post', '/session'),
      // @ts-expect-error the body has another member
      () => call('post', '/session', { body: { secret: 's' } }),
      // @ts-expect-error rows are not taken in as this
      () => call('post', '/ranges', { file: { type: 'text/html', data: '' } }),
      // @ts-expect-error no such member of the answer
      async () => typeof (await get('/me')).nickname,
    ];
    expect(requests).toHaveLength(11);
  });
  it('does not compile where a message is read', () => {
    const o = unchecked<Topic<'anchors.estimates'>>({ h95_m: 0.05, reason: 'r' });
    // @ts-expect-error no such member
    expect(num(o?.h95)).toBeNull();
    // @ts-expect-error a text, not a number
    expect(num(o?.reason)).toBeNull();
    // @ts-expect-error a number, not a text
    expect(str(o?.h95_m)).toBe('');
    // @ts-expect-error no such topic
    expect(unchecked<Topic<'estimates'>>(null)).toBeNull();
    // @ts-expect-error a word of the enum is missing
    expect(words_of<Topic<'events'>['level']>()('info', 'warning')).toHaveLength(2);
    expect([num(o?.h95_m), str(o?.reason)]).toEqual([0.05, 'r']);
  });
});
