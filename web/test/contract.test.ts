import { describe, expect, it } from 'vitest';
import { address } from '../src/api/contract';

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
