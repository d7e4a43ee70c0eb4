import { describe, expect, it } from 'vitest';
import { address_of } from '../src/ui/address';

describe('an address', () => {
  it('names a page, and what of it', () => {
    for (const [hash, page, named] of [
      ['', 'live', null],
      ['#/', 'live', null],
      ['#/live', 'live', null],
      ['#/anchors/0x6a2f', 'anchors', '0x6a2f'],
      ['#/plan/hall%20A', 'plan', 'hall A'],
      ['#/models/runs/7?compare=8,9', 'models', '7?compare=8,9'],
      ['#/models/runs/?compare=8,9', null, null],
      ['#/replay/7?t=12.5', 'replay', '7?t=12.5'],
      ['#/system/connect', 'system', 'connect'],
      ['#/guide/live', 'guide', 'live'],
    ] as const)
      expect([hash, address_of(hash)]).toEqual([hash, { page, named }]);
  });
  it('that is no page is none, never another page in silence', () => {
    for (const hash of ['#/nothing', '#/live/7', '#/anchors/7/8', '#/models/7', '#/measurements/7', '#/toString'])
      expect([hash, address_of(hash).page]).toEqual([hash, null]);
  });
  it('whose bytes are no text is shown as it is', () => {
    expect(address_of('#/anchors/%E0%A4%A')).toEqual({ page: 'anchors', named: '%E0%A4%A' });
  });
});
