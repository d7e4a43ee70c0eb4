import { describe, expect, it } from 'vitest';
import type { Sample } from '../src/api/measurements';
import { chosen, EVERYTHING, histogram, percentile } from '../src/views/measurements/choice';

const sample = (id: number, over: Partial<Sample> = {}): Sample => ({ id, t_us: id, who: '0x6a01', distance_m: id, rx_dbm: -80, truth_m: null, los: null, has_cir: false, features: {}, ...over });

describe('the filter of measurements', () => {
  const all = [sample(1, { los: true }), sample(2, { los: false, who: '0x6a02' }), sample(3)];
  it('keeps everything when nothing is asked', () => expect(chosen(all, EVERYTHING)).toHaveLength(3));
  it('tells LOS, NLOS and no label apart', () => {
    expect(chosen(all, { ...EVERYTHING, label: 'los' }).map((s) => s.id)).toEqual([1]);
    expect(chosen(all, { ...EVERYTHING, label: 'nlos' }).map((s) => s.id)).toEqual([2]);
    expect(chosen(all, { ...EVERYTHING, label: 'unlabelled' }).map((s) => s.id)).toEqual([3]);
  });
  it('includes both ends of a distance band', () => expect(chosen(all, { ...EVERYTHING, min_m: 1, max_m: 2 }).map((s) => s.id)).toEqual([1, 2]));
  it('keeps one anchor', () => expect(chosen(all, { ...EVERYTHING, who: '0x6a02' }).map((s) => s.id)).toEqual([2]));
});

describe('the histogram of a feature', () => {
  it('counts every measurement once, outliers in the end bins', () => {
    const all = Array.from({ length: 200 }, (_, i) => sample(i, { los: i % 2 === 0, features: { kurtosis: i === 199 ? 1e6 : i } })), h = histogram(all, 'kurtosis')!;
    const sum = (v: readonly number[]): number => v.reduce((a, b) => a + b, 0);
    expect(sum(h.los)).toBe(100);
    expect(sum(h.nlos)).toBe(100);
    expect(h.unlabelled.every((n) => n === 0)).toBe(true);
  });
  it('is absent where every value is the same', () => expect(histogram([sample(1, { features: { a: 2 } }), sample(2, { features: { a: 2 } })], 'a')).toBeNull());
});

describe('the percentile of a feature', () => {
  it('is the share below', () => expect(percentile([1, 2, 3, 4, 5, 6, 7, 8, 9, 10], 4)).toBe(30));
  it('says nothing of fewer than five', () => expect(percentile([1, 2, 3, 4], 2)).toBeNull());
});
