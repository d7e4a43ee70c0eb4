import { readFileSync } from 'node:fs';
import { deflateRawSync, gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import {
  declared_of,
  flight_of,
  guessed_ranges,
  guessed_track,
  missing_ranges,
  missing_track,
  range_unit,
  table_of,
  time_unit,
  type About,
} from '../src/views/start/flight_files';
import { entries_of, inflated } from '../src/views/start/unzip';
import { page_for, PAGES } from '../src/views/guide/pages';

const about: About = {
  name: 'Hall',
  kit: '',
  epoch_ms: Date.parse('2026-05-04T10:00:00Z'),
  point: 'gnss_antenna',
  lever_arm_m: [0.12, 0, -0.28],
  lever_arm_sigma_m: null,
  tag: '0x6e01',
};
const flight = (
  track: string,
  ranges: string,
  more: Partial<About> = {},
  declared = null as ReturnType<typeof declared_of> | null,
) => {
  const [t, r] = [table_of('track.csv', track), table_of('ranges.csv', ranges)],
    [tc, rc] = [guessed_track(t), guessed_ranges(r)];
  return flight_of(
    t,
    tc,
    r,
    rc,
    { track: time_unit(t, tc.time), ranges: time_unit(r, rc.time), range: range_unit(r, rc.range) },
    { ...about, ...more },
    declared,
  );
};

describe('a flight from files', () => {
  it('takes the columns of a flight folder by their names', () => {
    const f = flight(
      't_s,lat_deg,lon_deg,alt_m,fix,sd_h_m,sd_v_m,qx,qy,qz,qw\n0.1,51.0231,3.7131,57.2,2,0.01,0.02,0,0,0.6,0.8\n',
      't_s,anchor_id,range_m,rx_dbm,seq\n0.15,0x6A21,7.412,-81.5,3\n',
    );
    expect(f.fixes).toEqual([
      {
        t_us: 1777888800100000,
        seq: 0,
        lon: 3.7131,
        lat: 51.0231,
        h_m: 57.2,
        fix: 'fixed',
        sigma_m: [0.01, 0.01, 0.02],
        q: [0, 0, 0.6, 0.8],
      },
    ]);
    expect(f.ranges).toEqual([
      { t_us: 1777888800150000, tag: '0x6e01', anchor: '0x6a21', distance_m: 7.412, rx_dbm: -81.5, seq: 3 },
    ]);
    expect(f.mission).not.toHaveProperty('lever_arm_sigma_m'); // nobody says
    expect(f.mission).toMatchObject({
      frame: 'wgs84',
      track_point: 'gnss_antenna',
      tags: [{ tag: '0x6e01', antenna: 0, lever_arm_body_m: [0.12, 0, -0.28] }],
    });
  });
  it('reads dates, milliseconds and millimetres, semicolons and other names', () => {
    const f = flight(
      'Timestamp;Latitude;Longitude;Altitude;RTK\n2026-05-04T10:00:01.5Z;51;3.7;55;float\n',
      'time_ms;anchor;distance_mm\n1777888801500;27169;7412\n',
    );
    expect(f.fixes[0]).toMatchObject({ t_us: 1777888801500000, lat: 51, fix: 'float' });
    expect(f.ranges[0]).toMatchObject({ t_us: 1777888801500000, anchor: '27169', distance_m: 7.412, seq: 0 });
  });
  it('knows what is missing, and lets a person say it', () => {
    const t = table_of('a.csv', 'when,phi,lambda,h\n1,51,3.7,55\n'),
      r = table_of('b.csv', 'when,who,how_far\n1,0x6a21,7.4\n');
    expect(missing_track(guessed_track(t))).toEqual(['time', 'lat', 'lon', 'height']);
    expect(missing_ranges(guessed_ranges(r))).toEqual(['time', 'anchor', 'range']);
    const f = flight_of(
      t,
      { time: 'when', lat: 'phi', lon: 'lambda', height: 'h' },
      r,
      { time: 'when', anchor: 'who', range: 'how_far' },
      { track: 's', ranges: 's', range: 'm' },
      about,
      null,
    );
    expect([f.fixes.length, f.ranges.length, f.refused]).toEqual([1, 1, []]);
    expect(() => flight_of(t, {}, r, {}, { track: 's', ranges: 's', range: 'm' }, about, null)).toThrow(
      /time, lat, lon, height, time, anchor, range/,
    );
  });
  it('says of every row that is none which line and why, and keeps the others', () => {
    const f = flight(
      't_s,lat,lon,alt\n0,51,3.7,55\nx,51,3.7,55\n1,,3.7,55\n',
      't_s,anchor,range_m\n0,0x6a21,7\n1,Door 4,7\n2,0x6a21,\n',
    );
    expect([f.fixes.length, f.ranges.length]).toEqual([1, 1]);
    expect(f.refused).toEqual([
      'track.csv line 3: no time or place',
      'track.csv line 4: no time or place',
      'ranges.csv line 3: anchor "Door 4" is no radio address (0x6a2f or decimal)',
      'ranges.csv line 4: no time or range',
    ]);
  });
  it('takes a pose in each range as the track, once for each moment', () => {
    const both = 't_s,x,y,z,anchor,range_m\n0,1,2,3,0x6a21,7\n0,1,2,3,0x6a22,8\n0.1,1,2,4,0x6a21,7\n',
      t = table_of('ranges.csv', both),
      f = flight_of(t, guessed_track(t), t, guessed_ranges(t), { track: 's', ranges: 's', range: 'm' }, about, null);
    expect(f.mission.frame).toBe('local');
    expect(f.fixes).toHaveLength(2);
    expect(f.ranges).toHaveLength(3);
    expect(f.fixes[1]).toMatchObject({ local_m: [1, 2, 4], fix: 'fixed' });
  });
  it('believes flight.json before what it guesses', () => {
    const d = declared_of(
      JSON.stringify({
        kit: 'blue',
        epoch_utc: '2026-01-01T00:00:00Z',
        track: { frame: 'wgs84', point: 'body', heading_column: 'yaw', heading_enu_ccw_from_east_deg: { add: 90 } },
        tags: [{ tag_id: '0x6e02', lever_arm_body_m: [1, 2, 3] }],
        lever_arm_sigma_m: 0.02,
      }),
    );
    // Yaw 0, 90 to be added: counter-clockwise from east, so north; heading 0.
    const f = flight('t_s,lat,lon,alt,yaw\n1,51,3.7,55,0\n', 't_s,anchor,range_m\n1,0x6a21,7\n', d.about, d);
    expect(f.fixes[0]).toMatchObject({ t_us: 1767225601000000, heading_deg: 0 });
    expect(f.mission).toMatchObject({
      kit: 'blue',
      track_point: 'body',
      tags: [{ tag: '0x6e02', lever_arm_body_m: [1, 2, 3] }],
      lever_arm_sigma_m: 0.02,
    });
  });
  it.each([
    ['empty', '', /header line/],
    ['only a header', 'a,b\n', /header line/],
    ['numbers alone', '1,2\n3,4\n', /first line is numbers/],
    ['a cell too many', 'a,b\n1,2,3\n', /line 2: 3 cells, the header has 2/],
  ])('refuses a table that is %s', (_, text, why) => {
    expect(() => table_of('t.csv', text)).toThrow(why);
  });
});

/// A zip archive by hand: local header, data, central directory, end. CRCs are not looked at.
function zip(files: readonly (readonly [string, Buffer, 0 | 8])[]): Uint8Array {
  const local: Buffer[] = [],
    central: Buffer[] = [];
  let at = 0;
  for (const [name, content, method] of files) {
    const data = method === 8 ? deflateRawSync(content) : content,
      head = Buffer.alloc(30);
    head.writeUInt32LE(0x04034b50, 0);
    head.writeUInt16LE(method, 8);
    head.writeUInt16LE(name.length, 26);
    const entry = Buffer.alloc(46);
    entry.writeUInt32LE(0x02014b50, 0);
    entry.writeUInt16LE(method, 10);
    entry.writeUInt32LE(data.length, 20);
    entry.writeUInt16LE(name.length, 28);
    entry.writeUInt32LE(at, 42);
    local.push(head, Buffer.from(name), data);
    central.push(entry, Buffer.from(name));
    at += 30 + name.length + data.length;
  }
  const directory = Buffer.concat(central),
    end = Buffer.alloc(22);
  end.writeUInt32LE(0x06054b50, 0);
  end.writeUInt16LE(files.length, 10);
  end.writeUInt32LE(at, 16);
  return new Uint8Array(Buffer.concat([...local, directory, end]));
}

describe('an archive', () => {
  const table = Buffer.from(`t_s,anchor,range_m\n${'1,0x6a21,7\n'.repeat(500)}`);
  it('gives its files, stored or deflated, and leaves folders out', async () => {
    const entries = entries_of(
      zip([
        ['flight/', Buffer.alloc(0), 0],
        ['flight/flight.json', Buffer.from('{}'), 0],
        ['flight/ranges.csv', table, 8],
      ]),
    );
    expect(entries.map((e) => e.name)).toEqual(['flight/flight.json', 'flight/ranges.csv']);
    expect(await entries[0]!.read()).toBe('{}');
    expect(await entries[1]!.read()).toBe(table.toString());
    expect(await inflated(new Uint8Array(gzipSync(table)), 'gzip')).toBe(table.toString());
  });
  it('is refused where it is none, or cut at any place', async () => {
    expect(() => entries_of(new Uint8Array(10))).toThrow(/not a zip/);
    const whole = zip([['a.csv', table, 8]]);
    for (let cut = 0; cut < whole.length - 22; cut += 7)
      await expect(
        (async () => {
          const tail = new Uint8Array([...whole.subarray(0, cut), ...whole.subarray(whole.length - 22)]);
          for (const e of entries_of(tail)) await e.read();
          throw new Error('read as if whole');
        })(),
      ).rejects.not.toThrow('read as if whole');
  });
});

describe('the guide', () => {
  it('has a page for every view of the rail', () => {
    const app = readFileSync(new URL('../src/ui/app.tsx', import.meta.url), 'utf8'),
      views = [...app.matchAll(/^ {2}\['(\w+)', '\w+'\],$/gm)].map((m) => m[1]!);
    expect(views).toHaveLength(7);
    for (const v of views) expect(page_for(`#/${v}/something`)).toBe(v);
    expect(page_for('')).toBe('live');
  });
  it('names every page once', () => {
    expect(new Set(PAGES.map((p) => p.id)).size).toBe(PAGES.length);
  });
});
