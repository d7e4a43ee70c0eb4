import { readFileSync } from 'node:fs';
import { expect, it } from 'vitest';
import { guessed_ranges, guessed_track } from '../src/views/start/fields';
import { NAMES, type Columns } from '../src/views/start/names';
import {
  flight_of,
  guessed_reading,
  needs_of,
  place_of,
  type About,
  type Reading,
} from '../src/views/start/flight_files';
import { enu_attitude } from '../src/views/start/axes';
import { anchor_columns, decoded, table_of, with_a_row_for_each_range } from '../src/views/start/table_file';
import { tags_of } from '../src/views/start/tags';

/// Cases that the command line runs too, so that both read the same tables the same way.
const file = (name: string): unknown =>
  JSON.parse(readFileSync(new URL(`../../tests/data/import/${name}`, import.meta.url), 'utf8'));
interface Given extends Partial<Omit<Reading, 'track_time' | 'range_time' | 'fix'>> {
  readonly track_columns?: Columns;
  readonly range_columns?: Columns;
  readonly fix_numbers?: Reading['fix'];
  readonly track_time_scale?: 'utc' | 'gps';
  readonly epoch_utc?: string;
  readonly tag?: string;
}
interface Case {
  readonly name: string;
  readonly track?: string;
  readonly track_base64?: string;
  readonly ranges: string;
  readonly given?: Given;
  readonly column_for_each_anchor?: boolean;
  readonly needs?: readonly string[];
  readonly error?: string;
  readonly source?: object;
  readonly fixes?: readonly object[];
  readonly ranges_read?: readonly object[];
  readonly refused?: readonly string[];
  readonly unknown_fix?: Readonly<Record<string, number>>;
}

function run(c: Case) {
  const { track_columns, range_columns, fix_numbers, track_time_scale, epoch_utc, tag, ...given } = c.given ?? {},
    bytes = c.track_base64 ? Buffer.from(c.track_base64, 'base64') : new TextEncoder().encode(c.track),
    track = table_of('track', decoded(bytes)),
    wide = table_of('ranges', c.ranges),
    ranges = c.column_for_each_anchor
      ? with_a_row_for_each_range(wide, anchor_columns(wide, Object.values(guessed_ranges(wide))))
      : wide,
    [tc, rc] = [
      { ...guessed_track(track), ...track_columns },
      { ...guessed_ranges(ranges), ...range_columns },
    ],
    guess = guessed_reading(track, tc, ranges, rc, null),
    reading: Reading = {
      ...guess,
      ...given,
      ...(fix_numbers ? { fix: fix_numbers } : {}),
      track_time: { ...guess.track_time, ...(track_time_scale ? { scale: track_time_scale } : {}) },
    },
    about: About = {
      name: '',
      kit: '',
      epoch_ms: epoch_utc ? Date.parse(epoch_utc) : 0,
      point: 'gnss_antenna',
      lever_arm_m: [0, 0, 0],
      lever_arm_sigma_m: null,
      tag: tag ?? '0x6e01',
    };
  return {
    needs: needs_of(track, tc, rc, reading, about.tag),
    flight: () => flight_of(track, tc, ranges, rc, reading, about, null),
  };
}

it.each((file('cases.json') as readonly Case[]).map((c) => [c.name, c] as const))('reads %s', (_, c) => {
  if (c.error !== undefined) {
    expect(() => run(c).flight()).toThrow(c.error);
    return;
  }
  const { needs, flight } = run(c);
  expect(needs).toEqual(c.needs ?? []);
  if (c.needs) return;
  const f = flight();
  expect(
    f.fixes.map((p) => {
      const { lon: _lon, lat: _lat, h_m: _h, local_m: _local, ...rest } = p;
      return { ...rest, place: place_of(p) };
    }),
  ).toEqual(c.fixes!.map((x) => expect.objectContaining(near(x)) as object));
  expect(f.ranges).toEqual(
    c.ranges_read!.map((r) => {
      const { tag, anchor, ...rest } = r as { tag: number; anchor: number };
      return {
        ...rest,
        tag: expect.toSatisfy((t: string) => Number(t) === tag) as string,
        anchor: expect.toSatisfy((t: string) => Number(t) === anchor) as string,
      };
    }),
  );
  expect(f.refused).toEqual(c.refused ?? []);
  expect(Object.fromEntries(f.unknown_fix)).toEqual(c.unknown_fix ?? {});
  expect(f.source).toEqual(c.source ?? null);
});
/// Places to 1e-9 of a degree or of a metre: sums of two columns have a last bit.
const near = (fix: object): object => ({
  ...fix,
  place: (fix as { place: readonly number[] }).place.map((v) => expect.closeTo(v, 9) as number),
});

it('knows the columns that the command line knows', () => {
  expect(Object.fromEntries(Object.entries(NAMES).map(([f, names]) => [f, names.split(' ')]))).toEqual(
    file('columns.json'),
  );
});

/// A row each `spacing`, of a place that stays above zero.
const every = (name: string, head: string, cells: string, spacing: number) =>
  table_of(name, `${[head, ...Array.from({ length: 1200 }, (_, i) => `${1e8 + i * spacing},${cells}`)].join('\n')}\n`);
it('asks for a unit of times where two fit', () => {
  // 5000 apart: one row in 5 s by milliseconds, 200 Hz by microseconds.
  const t = every('t', 't,x,y,z', '1,2,3', 5000),
    r = every('r', 't,anchor,range_m', '0x6a21,7.4', 5000),
    [tc, rc] = [guessed_track(t), guessed_ranges(r)];
  expect(needs_of(t, tc, rc, guessed_reading(t, tc, r, rc, null), '0x6e01')).toEqual([
    'unit of the track times',
    'unit of the range times',
  ]);
});
it('turns attitudes of a track that counts downwards', () => {
  // Nose to the north and level; then to the east and 10 degrees up: in NED a yaw of 90 and a pitch of 10 degrees.
  const half = Math.SQRT1_2,
    same = (q: readonly number[], wanted: readonly number[]): void => {
      expect(Math.abs(q.reduce((sum, v, i) => sum + v * wanted[i]!, 0))).toBeCloseTo(1, 12);
    };
  same(enu_attitude([0, 0, 0, 1], 'ned'), [0, 0, half, half]);
  const [c, s] = [Math.cos(Math.PI / 36), Math.sin(Math.PI / 36)];
  same(enu_attitude([-half * s, half * s, half * c, half * c], 'ned'), [0, -s, 0, c]);
});
it('knows several tags, and addresses that are tag and anchor', () => {
  const r = table_of('r', 'time,tag,anchor,range_m,kind\n1,10,3,7,\n1,11,3,7,\n1,2,10,7,\n1,5,2,7,anchor_anchor\n');
  expect(tags_of(r, guessed_ranges(r))).toEqual([['10', '11', '2'], ['10']]);
});
it('gives each of several tags its lever arm', () => {
  const t = table_of('t', 'time,x,y,z\n1777888801.5,1,2,3\n'),
    r = table_of('r', 'time,tag,anchor,range_m\n1777888801.5,10,3,7\n1777888801.6,0x0b,3,7\n'),
    [tc, rc] = [guessed_track(t), guessed_ranges(r)],
    f = flight_of(
      t,
      tc,
      r,
      rc,
      guessed_reading(t, tc, r, rc, null),
      {
        name: '',
        kit: '',
        epoch_ms: 0,
        point: 'gnss_antenna',
        lever_arm_m: [0, 0, 0],
        lever_arms_m: { '0x0b': [0.1, 0, -0.2] },
        lever_arm_sigma_m: null,
        tag: '',
      },
      null,
    );
  expect(f.mission.tags).toEqual([
    { tag: '10', antenna: 0, lever_arm_body_m: [0, 0, 0] },
    { tag: '0x0b', antenna: 0, lever_arm_body_m: [0.1, 0, -0.2] },
  ]);
});
