import { describe, expect, it } from 'vitest';
import { decimals, ticks } from '../src/views/chart';
import { method_words, why_words } from '../src/views/models/words';

describe('the name of a method', () => {
  it('is that people use', () => expect(method_words('random_forest')).toBe('Random forest'));
  it('tells settings and features of a run', () =>
    expect(method_words('logistic(c=3) on 3 features')).toBe('Logistic regression, C = 3, 3 features'));
  it('of several settings tells each', () =>
    expect(method_words('svm(c=3,gamma=0.1)')).toBe('Support vector machine, C = 3, gamma = 0.1'));
  it('has no underscore where a setting has one', () =>
    expect(method_words('average(c=3, leaf_share=0.03) on 7 features')).toBe(
      'Logistic, SVM and forest averaged, C = 3, leaf share = 0.03, 7 features',
    ));
  it('is in words in the reason of its choice too', () =>
    expect(why_words('lowest log loss: logistic(c=3) on 3 features 0.158 over 2 candidates')).toBe(
      'Lowest log loss: Logistic regression, C = 3, 3 features 0.158 over 2 candidates',
    ));
  it('stays as it is where it is none of these', () =>
    expect(method_words('average of (a) and (b)')).toBe('Average of (a) and (b)'));
});

describe('the decimals of ticks', () => {
  it('are those at which they differ', () =>
    expect([ticks(0, 100), ticks(4.98, 5.03), ticks(-80.4, -79.6), ticks(0, 0.5)].map(decimals)).toEqual([0, 2, 1, 1]));
  it('are none of a single one', () => expect(decimals([3])).toBe(0));
});
