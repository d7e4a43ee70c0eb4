import { expect, test } from 'vitest';
import type { Limits } from '../src/api/organizations';
import { limits_of, typed_of } from '../src/views/system/limits';

const none: Limits = { sites: null, missions: null, measurements: null, anchors: null, requests_per_minute: null };

test('limits are read as they were typed, an empty field as no limit', () => {
  const limits: Limits = { ...none, sites: 0, measurements: 10_484_133, requests_per_minute: 600 };
  expect(limits_of(typed_of(limits))).toEqual(limits);
  expect(limits_of(typed_of(none))).toEqual(none);
  expect(limits_of({ ...typed_of(none), missions: ' 2 000 ' })).toEqual({ ...none, missions: 2000 });
});
test('what is no limit is told by its field, and what to write', () => {
  for (const typed of ['-1', '1.5', 'many', '1e3', '9'.repeat(16)])
    expect(limits_of({ ...typed_of(none), anchors: typed })).toMatch(/^Anchors: .*is not a whole number.*no limit/);
  for (const typed of ['0', '1000001'])
    expect(limits_of({ ...typed_of(none), requests_per_minute: typed })).toMatch(/^Requests a minute: 1 to/);
});
