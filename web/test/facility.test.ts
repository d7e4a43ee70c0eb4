import { describe, expect, it } from 'vitest';
import { fields_of, patch_of, type Fields } from '../src/api/facility';

const was: Fields = {
  name: 'Hall',
  building: 'B1',
  floor: '',
  space: '',
  asset_tag: '',
  ifc_guid: '',
  external_ids: [{ system: 'archibus', id: '7' }],
};

describe('a change of facility data', () => {
  it('is nothing where nothing differs but blanks', () =>
    expect(patch_of(was, { ...was, name: ' Hall ' })).toEqual({}));
  it('holds only what differs, so that what others typed meanwhile stays', () =>
    expect(patch_of(was, { ...was, space: 'A0.12' })).toEqual({ space: 'A0.12' }));
  it('clears an emptied field by null', () =>
    expect(patch_of(was, { ...was, building: ' ' })).toEqual({ building: null }));
  it('leaves out rows of names that were never filled in', () =>
    expect(patch_of(was, { ...was, external_ids: [...was.external_ids, { system: '', id: '' }] })).toEqual({}));
  it('sends all names in other systems, or null when none is left', () => {
    expect(patch_of(was, { ...was, external_ids: [...was.external_ids, { system: 'gis', id: ' 9' }] })).toEqual({
      external_ids: [
        { system: 'archibus', id: '7' },
        { system: 'gis', id: '9' },
      ],
    });
    expect(patch_of(was, { ...was, external_ids: [] })).toEqual({ external_ids: null });
  });
});

describe('facility data from the wire', () => {
  it('are the fields of the feature, empty where missing', () =>
    expect(
      fields_of({
        properties: {
          network_id: '0x6a21',
          status: 'accepted',
          revision: 1,
          name: 'Hall',
          building: 'B1',
          external_ids: [{ system: 'archibus', id: '7' }],
        },
      }),
    ).toEqual(was));
});
