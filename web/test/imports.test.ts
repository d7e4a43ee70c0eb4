import { describe, expect, it } from 'vitest';
import { ApiError, problem_of } from '../src/api/client';
import { row_report } from '../src/api/imports';

/// A 422 as the page gets it.
const refusal = (body: object) => Promise.reject(new ApiError(problem_of(body, 422), body));

describe('the report on rows', () => {
  const report = { accepted: 0, duplicates: 0, rejected: 2, errors: [{ line: 1, code: 'zero_distance' }] };
  it('is the answer', async () => expect(await row_report(Promise.resolve({ body: report }))).toEqual(report));
  it('is in the problem where not one row was taken', async () => {
    const body = { type: '/problems/validation', title: 'x', status: 422, ...report };
    expect(await row_report(refusal(body))).toEqual(body);
  });
  it('is no other problem', async () => {
    await expect(row_report(refusal({ title: 'x', status: 422, errors: [] }))).rejects.toThrow('x');
    await expect(row_report(Promise.reject(new TypeError('y')))).rejects.toThrow('y');
  });
});
