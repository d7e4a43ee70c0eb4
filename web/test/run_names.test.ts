import { describe, expect, it } from 'vitest';
import { course_words, run_names } from '../src/views/models/words';

const run = (id: string, method: string, created_at: string) => ({ id, method, created_at });

describe('names of runs', () => {
  it('are those of their methods while no two are alike', () => {
    const names = run_names([
      run('a', 'logistic', '2026-05-04T10:00:00Z'),
      run('b', 'random_forest', '2026-05-04T10:00:00Z'),
    ]);
    expect(names.get('a')).not.toContain('2026');
    expect(names.get('a')).not.toBe(names.get('b'));
  });
  it('tell two of one method apart by time, and two of one minute by number', () => {
    const names = run_names([
      run('c', 'logistic', '2026-05-04T11:30:40Z'),
      run('b', 'logistic', '2026-05-04T11:30:10Z'),
      run('a', 'logistic', '2026-05-04T10:00:00Z'),
    ]);
    expect(new Set(names.values()).size).toBe(3);
    expect(names.get('a')).toMatch(/10:00/);
    expect(names.get('b')).toMatch(/11:30.*no\. 1$/);
    expect(names.get('c')).toMatch(/11:30.*no\. 2$/);
  });
});

describe('the course of a run', () => {
  const of_server = { stage: 'search', fraction: 0.404, worker: '', attempts: 1 };
  it('names the worker that has it, and no attempt while it is the first', () => {
    expect(course_words(of_server)).toBe('search 40 %');
    expect(course_words({ ...of_server, worker: 'lab-pc/812' })).toBe('search 40 % on lab-pc/812');
  });
  it('counts the attempts once a worker was taken over', () => {
    expect(course_words({ ...of_server, worker: 'lab-pc/9', attempts: 2 })).toBe('search 40 % on lab-pc/9, attempt 2');
  });
});
