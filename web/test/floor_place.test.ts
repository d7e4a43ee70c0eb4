import { describe, expect, it } from 'vitest';
import { place_of } from '../src/views/plan/floor_plan';

describe('a place that is typed', () => {
  it.each([
    '51.02328, 3.7131',
    '51,02328, 3,7131',
    '51,02328; 3,7131',
    '51,02328 3,7131',
    ' 51.02328 3.7131 ',
    '51.02328,3.7131',
  ])('is understood with a decimal point or comma: %s', (text) =>
    expect(place_of(text)).toEqual({ lat: 51.02328, lon: 3.7131 }),
  );
  it.each(['', '51', '51,02,3,71', '91, 3', 'here, there'])('is none where it is not clear: %s', (text) =>
    expect(place_of(text)).toBeNull(),
  );
});
