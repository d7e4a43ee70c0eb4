import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { note_of } from '../src/api/anchors';
import {
  at_instant,
  bearing_from,
  by_suspicion,
  common_shift,
  weight_by_sector,
  type Residual,
} from '../src/api/residuals';
import { dms } from '../src/ui/format';

const row = (part: Partial<Residual>): Residual => ({
  mission: 'm',
  t_us: 0,
  distance_m: 10,
  residual_m: 0,
  standardised: 0,
  weight: 1,
  bearing_deg: 0,
  ...part,
});

describe('where the tag was', () => {
  const way = {
    t_us: [0, 1e6, 10e6],
    at_m: [
      [0, 0, 0],
      [10, 0, 2],
      [100, 0, 0],
    ] as [number, number, number][],
  };
  it('is between two fixes by the share of time', () => expect(at_instant(way, 250_000)).toEqual([2.5, 0, 0.5]));
  it('is a fix at its own instant', () => expect(at_instant(way, 1e6)).toEqual([10, 0, 2]));
  it('is that of the near fix beside a gap, and unknown in the gap', () => {
    expect(at_instant(way, 1.5e6)).toEqual([10, 0, 2]);
    expect(at_instant(way, 5e6)).toBeNull();
  });
  it('is unknown before the first and after the last by more than a second', () =>
    expect([at_instant(way, -2e6), at_instant(way, 12e6), at_instant({ t_us: [], at_m: [] }, 0)]).toEqual([
      null,
      null,
      null,
    ]));
});

describe('the bearing from an anchor', () => {
  it.each([
    [0, 1, 0],
    [1, 0, 90],
    [0, -1, 180],
    [-1, 0, 270],
    [1, 1, 45],
  ])('to %d east, %d north is %d°', (e, n, deg) =>
    expect(bearing_from([5, 7, 1], [5 + e, 7 + n, 3])).toBeCloseTo(deg, 9),
  );
});

describe('the weight by direction', () => {
  it('adds up to one, north on both sides of zero', () =>
    expect(
      weight_by_sector([
        row({ bearing_deg: 350 }),
        row({ bearing_deg: 10 }),
        row({ bearing_deg: 91, weight: 0.5 }),
        row({ bearing_deg: 180, weight: 0 }),
        row({ bearing_deg: null }),
      ]),
    ).toEqual([0.8, 0, 0.2, 0, 0, 0, 0, 0]));
  it('is nothing where all were rejected', () =>
    expect(weight_by_sector([row({ weight: 0 })]).every((w) => w === 0)).toBe(true));
});

describe('a shift of all anchors', () => {
  const of = (...list: [number, number][]) =>
    common_shift(list.map(([e, n]) => ({ delta_m: [e, n, 0] as [number, number, number] })));
  it('is the base where all go the same way', () => {
    const shift = of([0.1, 0.11], [0.12, 0.09], [0.09, 0.1]);
    expect(shift?.size_m).toBeCloseTo(0.1438, 3);
    expect(shift?.bearing_deg).toBeCloseTo(45.9, 1);
  });
  it('is not, where some go further than others: those were moved', () =>
    expect(of([3.765, -2.075], [1.714, -0.192], [2.582, -0.925], [3.67, -1.224])).toBeNull());
  it('is nothing below two centimetres, in all directions, or of two', () =>
    expect([of([0.01, 0], [0.01, 0], [0.01, 0]), of([0.1, 0], [-0.1, 0], [0, 0.1]), of([1, 0], [1, 0])]).toEqual([
      null,
      null,
      null,
    ]));
});

describe('ranges to doubt', () => {
  it('are the rejected ones, then the furthest in sigmas', () =>
    expect(
      by_suspicion([
        row({ t_us: 1, standardised: -2 }),
        row({ t_us: 2, standardised: 9, weight: 0 }),
        row({ t_us: 3, standardised: 3 }),
        row({ t_us: 4, standardised: null }),
      ]).map((r) => r.t_us),
    ).toEqual([2, 3, 1, 4]));
});

describe('degrees, minutes, seconds', () => {
  it('are those of the degrees', () =>
    expect([dms(51.023181327, 'lat'), dms(-77.0647736, 'lon')]).toEqual([
      '51°01′23.45278″\u00a0N',
      '77°03′53.18496″\u00a0W',
    ]));
  it('carry over and never say 60', () =>
    expect([dms(59.9999999999, 'lat'), dms(0, 'lon'), dms(null, 'lat')]).toEqual([
      '60°00′00.00000″\u00a0N',
      '0°00′00.00000″\u00a0E',
      '–',
    ]));
});

describe('columns of the anchor table', () => {
  beforeEach(() => vi.stubGlobal('localStorage', { getItem: () => null, setItem: () => undefined }));
  afterEach(() => vi.unstubAllGlobals());
  it('are the usual ones without a choice, or with one that is not readable', async () => {
    const { choice_of, USUAL } = await import('../src/views/anchor_columns');
    expect([choice_of(null), choice_of('{'), choice_of('[]')]).toEqual([USUAL, USUAL, USUAL]);
  });
  it('are those that were chosen, without any that no longer exist', async () => {
    const { choice_of, USUAL } = await import('../src/views/anchor_columns');
    expect(choice_of('{"live":["gdop","gone"],"dms":true}')).toEqual({
      live: ['gdop'],
      published: USUAL.published,
      dms: true,
    });
  });
});

describe('the note of a revision', () => {
  it('names who was left out, and why where that was said', () => {
    expect(
      note_of(' second flight. ', [
        ['0x6a21', 'moved'],
        ['0x6a22', ' '],
      ]),
    ).toBe('second flight. Left out: 0x6a21 (moved), 0x6a22.');
    expect(note_of('', [])).toBe('');
  });
});
