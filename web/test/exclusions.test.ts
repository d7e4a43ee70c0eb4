import { describe, expect, test } from 'vitest';
import { selection_of, words_of, type Exclusion } from '../src/api/exclusions';
import { EVERYTHING } from '../src/api/measurements';

describe('what is taken out of use', () => {
  test('rows by their ids, and never none of them', () => {
    expect(selection_of('ranges', [7, 9], EVERYTHING)).toEqual({ kind: 'ranges', ids: [7, 9] });
    expect(selection_of('ranges', [], EVERYTHING)).toBeNull();
  });
  test('the time and anchor of the filter; an empty filter is not the whole flight', () => {
    const filter = { ...EVERYTHING, who: '0x6a21', since_us: 5, until_us: 9 };
    expect(selection_of('ranges', null, filter)).toEqual({ kind: 'ranges', since: 5, until: 9, anchor: '0x6a21' });
    expect(selection_of('fixes', null, filter)).toEqual({ kind: 'fixes', since: 5, until: 9 });
    expect(selection_of('ranges', null, EVERYTHING)).toBeNull();
    expect(selection_of('fixes', null, { ...EVERYTHING, who: '0x6a21' })).toBeNull();
  });
  test('what the server tells of it, in words', () => {
    const told: Exclusion = {
      id: 'a',
      mission: 'm',
      tag: null,
      kind: 'ranges',
      rows: [],
      since: '2026-05-04T10:11:12.345678Z',
      until: null,
      anchor: '0x6a21',
      n_rows: 40,
      reason: 'a bird',
      by: 'op',
      created_at: 'x',
      included: null,
    };
    expect(words_of(told)).toBe('0x6a21 from 10:11:12.345');
    expect(words_of({ ...told, rows: [{ t_us: 5 }] })).toBe('1 row by name');
  });
});
