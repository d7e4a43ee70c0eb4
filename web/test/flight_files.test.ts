import { readdirSync, readFileSync } from 'node:fs';
import { deflateRawSync, gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { guessed_ranges, guessed_track, missing_ranges, missing_track } from '../src/views/start/fields';
import {
  declared_of,
  flight_of,
  guessed_reading,
  overlap_of,
  type About,
  type Reading,
} from '../src/views/start/flight_files';
import { anchor_columns, decoded, table_of, with_a_row_for_each_range } from '../src/views/start/table_file';
import { address_of, fix_numbers, fix_of, time_us } from '../src/views/start/values';
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
  given: Partial<Reading> = {},
) => {
  const [t, r] = [table_of('track.csv', track), table_of('ranges.csv', ranges)],
    [tc, rc] = [guessed_track(t), guessed_ranges(r)];
  return flight_of(
    t,
    tc,
    r,
    rc,
    { ...guessed_reading(t, tc, r, rc, declared), heights: 'ellipsoidal', ...given },
    { ...about, ...more },
    declared,
  );
};
const in_seconds: Reading = {
  track_time: { unit: 's', scale: 'utc' },
  range_time: { unit: 's', scale: 'utc' },
  range: 'm',
  fix: 'words',
  crs: '',
  heights: 'ellipsoidal',
  height: 'm',
  heading: 'deg',
  addresses: 'names',
  wrong_unit: '',
};

describe('a flight from files', () => {
  it('takes the columns of a flight folder by their names', () => {
    const f = flight(
      't_s,lat_deg,lon_deg,alt_m,fix,sd_h_m,sd_v_m,qx,qy,qz,qw\n0.1,51.0231,3.7131,57.2,2,0.01,0.02,0,0,0.6,0.8\n',
      't_s,anchor_id,range_m,rx_dbm,seq\n0.15,0x6A21,7.412,-81.5,3\n',
      {},
      null,
      { fix: 'solution' },
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
    const t = table_of('a.csv', 'when,phi,lambda,ell\n1,51,3.7,55\n'),
      r = table_of('b.csv', 'when,who,how_far\n1,0x6a21,7.4\n');
    expect(missing_track(guessed_track(t))).toEqual(['time', 'lat', 'lon', 'height']);
    expect(missing_ranges(guessed_ranges(r))).toEqual(['time', 'anchor', 'range']);
    const f = flight_of(
      t,
      { time: 'when', lat: 'phi', lon: 'lambda', height: 'ell' },
      r,
      { time: 'when', anchor: 'who', range: 'how_far' },
      in_seconds,
      about,
      null,
    );
    expect([f.fixes.length, f.ranges.length, f.refused]).toEqual([1, 1, []]);
    expect(() => flight_of(t, {}, r, {}, in_seconds, about, null)).toThrow(
      /time, lat, lon, height, time, anchor, range/,
    );
  });
  it('says of every row that is none which row and why, and keeps the others', () => {
    const f = flight(
      't_s,lat,lon,alt\n0,51,3.7,55\nx,51,3.7,55\n1,,3.7,55\n',
      't_s,anchor,range_m\n0,0x6a21,7\n1,,7\n2,0x6a21,\n',
    );
    expect([f.fixes.length, f.ranges.length]).toEqual([1, 1]);
    expect(f.refused).toEqual([
      'track.csv row 3: "x" is not a time that can be read (like 2026-05-04 10:00:01.5)',
      'track.csv row 4: no position',
      'ranges.csv row 3: no anchor',
      'ranges.csv row 4: no range',
    ]);
  });
  it('takes a pose in each range as the track, once for each moment', () => {
    const both = 't_s,x,y,z,anchor,range_m\n0,1,2,3,0x6a21,7\n0,1,2,3,0x6a22,8\n0.1,1,2,4,0x6a21,7\n',
      t = table_of('ranges.csv', both),
      f = flight_of(t, guessed_track(t), t, guessed_ranges(t), in_seconds, about, null);
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
    ['numbers alone', '1,2\n3,4\n', /first line has numbers/],
    ['a cell too many', 'a,b\n1,2,3\n', /row 2: 3 cells, the header has 2/],
    ['two columns of one name', 'a,a\n1,2\n', /two columns have the name "a"/],
    ['a quote without its end', 'a,b\n"1,2\n', /a quote is opened and not closed/],
  ])('refuses a table that is %s', (_, text, why) => {
    expect(() => table_of('t.csv', text)).toThrow(why);
  });
});

/// Files as programs that nobody here made write them.
describe('a flight of somebody else', () => {
  const T = 1777888801500000; // 2026-05-04 10:00:01.5 UTC
  it('reads a German spreadsheet: byte order mark, semicolons, decimal commas, its own words', () => {
    const bom = '\ufeff';
    const f = flight(
      decoded(
        new TextEncoder().encode(`${bom}Zeit;Breite;Länge;Höhe\r\n2026-05-04 10:00:01,5;51,0231;3,7131;57,2\r\n`),
      ),
      `Zeit;Anker;Abstand\r\n2026-05-04 10:00:01,5;0x6a21;7,412\r\n`,
    );
    expect(f.fixes[0]).toMatchObject({ t_us: T, lat: 51.0231, lon: 3.7131, h_m: 57.2 });
    expect(f.ranges[0]).toMatchObject({ t_us: T, anchor: '0x6a21', distance_m: 7.412 });
  });
  it('reads quotes, tabs, UTF-16 and the Western European of Windows', () => {
    const quoted = table_of(
      'a.csv',
      '"time","anchor name","range [m]"\n"2026-05-04T10:00:01.5Z","Door 4, left","7.4"\n',
    );
    expect(quoted.rows[0]).toEqual(['2026-05-04T10:00:01.5Z', 'Door 4, left', '7.4']);
    const utf16 = new Uint8Array([0xff, 0xfe, ...[...'t\tx'].flatMap((c) => [c.charCodeAt(0), 0])]);
    expect(decoded(utf16)).toBe('t\tx');
    expect(decoded(new Uint8Array([0x53, 0xe4, 0x75, 0x6c, 0x65]))).toBe('Säule');
  });
  it.each([
    ['2026-05-04T10:00:01.5Z', T],
    ['2026-05-04T12:00:01.5+02:00', T],
    ['2026/05/04 10:00:01.500', T], // no zone: UTC, wherever the browser stands
    ['2026-05-04 10:00:19.5 GPST', T],
    ['1777888801.5', T],
  ])('knows the moment %s', (text, us) => {
    const t = table_of('t.csv', `time,x\n${text},1\n`);
    expect(time_us(text, guessed_reading(t, { time: 'time' }, t, { time: 'time' }, null).track_time, '.', 0)).toBe(us);
  });
  it('takes GPS time off: 18 s since 2017, 17 s in 2016, numbers from 6 January 1980', () => {
    const gps = (cell: string) => time_us(cell, { unit: 'date', scale: 'gps' }, '.', 0);
    expect(gps('2026-05-04 10:00:19.5')).toBe(T);
    expect(gps('2016-05-04 10:00:17')).toBe(Date.UTC(2016, 4, 4, 10) * 1000);
    expect(time_us('1461924019.5', { unit: 's', scale: 'gps' }, '.', 0)).toBe(T);
  });
  it.each(['2026-02-30 10:00:00', '04/05/2026 10:00', '10:00:01'])('takes %s for no moment', (text) => {
    expect(time_us(text, { unit: 'date', scale: 'utc' }, '.', 0)).toBeNaN();
  });
  it('does not guess what the numbers of a fix class mean where they mean different things', () => {
    const numbers = (name: string, values: string) =>
      fix_numbers(table_of('t.csv', `${name},x\n${values.split(' ').join(',1\n')},1\n`), name, false);
    expect(numbers('fix', '1 2')).toBeNull();
    expect(numbers('quality', '4 5 1')).toBeNull();
    expect(numbers('Q', '1 2 5')).toBe('rtklib');
    expect(numbers('carrSoln', '0 1 2')).toBe('solution');
    expect(numbers('fix_quality', '4 5')).toBe('nmea');
    expect(numbers('fix', 'fixed float')).toBe('words');
    const track = 't_s,lat,lon,alt,fix\n0,51,3.7,55,1\n',
      ranges = 't_s,anchor,range_m\n0,0x6a21,7\n';
    expect(() => flight(track, ranges)).toThrow(/meaning of the numbers of the fix class/);
    expect(flight(track, ranges, {}, null, { fix: 'nmea' }).fixes[0]).toMatchObject({ fix: 'single' });
    expect(flight(track, ranges, {}, null, { fix: 'rtklib' }).fixes[0]).toMatchObject({ fix: 'fixed' });
  });
  it('believes no position whose fix class it does not know', () => {
    expect([fix_of('RTK Fixed', 'words'), fix_of('3D', 'words'), fix_of('5', 'nmea')]).toEqual([
      'fixed',
      'single',
      'float',
    ]);
    const f = flight(
      't_s,lat,lon,alt,fix\n0,51,3.7,55,superb\n1,51,3.7,55,fixed\n',
      't_s,anchor,range_m\n0,0x6a21,7\n',
    );
    expect(f.fixes).toMatchObject([{ fix: 'none' }, { fix: 'fixed' }]);
    expect([...f.unknown_fix]).toEqual([['superb', 1]]);
  });
  it('gives an anchor that has a name alone an address, the same every time, and keeps the name', () => {
    expect(address_of('foobar')).toBe('0xbf9cf968'); // FNV-1a, test vectors of its authors
    expect([address_of('0x6A21'), address_of('27169'), address_of('27169.0')]).toEqual(['0x6a21', '27169', '27169']);
    const f = flight('t_s,lat,lon,alt\n0,51,3.7,55\n', 't_s,anchor,range_m\n0,foobar,7\n');
    expect(f.ranges[0]).toMatchObject({ anchor: '0xbf9cf968' });
    expect([...f.names]).toEqual([['0xbf9cf968', 'foobar']]);
  });
  it('reads one column for each anchor', () => {
    const t = table_of('ranges.csv', 'time,A1,A2,note\n1,7.1,,x\n2,,8.2,y\n3,7.3,8.3,z\n'),
      anchors = anchor_columns(t, ['time']);
    expect(anchors).toEqual(['A1', 'A2']);
    expect(with_a_row_for_each_range(t, anchors)).toMatchObject({
      columns: ['time', 'note', 'anchor', 'range'],
      rows: [
        ['1', 'x', 'A1', '7.1'],
        ['2', 'y', 'A2', '8.2'],
        ['3', 'z', 'A1', '7.3'],
        ['3', 'z', 'A2', '8.3'],
      ],
    });
  });
  it('reads positions of RTKLIB', () => {
    const t = table_of(
        'rover.pos',
        '% program   : RTKPOST\n% inp file  : a.obs\n%\n' +
          '% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)\n' +
          '%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   ' +
          'sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n' +
          '2026/05/04 10:00:19.500   51.023100000    3.713100000    57.2000   1  14   0.0100   0.0110   0.0200   0.0000   0.0000   0.0000   0.50   99.9\n',
      ),
      r = table_of('ranges.csv', 'time,anchor,range_m\n2026-05-04T10:00:01.5Z,0x6a21,7\n'),
      [tc, rc] = [guessed_track(t), guessed_ranges(r)],
      f = flight_of(t, tc, r, rc, guessed_reading(t, tc, r, rc, null), about, null);
    expect(f.fixes).toEqual([
      {
        t_us: T,
        seq: 0,
        lon: 3.7131,
        lat: 51.0231,
        h_m: 57.2,
        fix: 'fixed',
        sigma_m: [0.011, 0.01, 0.02],
        correction_age_s: 0.5,
        satellites: 14,
      },
    ]);
  });
  it('says how many ranges lie within the time of the track', () => {
    const t = table_of('t.csv', 'time,lat,lon,alt\n1777888801,51,3.7,55\n1777888901,51,3.7,55\n'),
      r = table_of('r.csv', 'time,anchor,range\n1777888783,0x6a21,7\n1777888811,0x6a21,7\n'),
      [tc, rc] = [guessed_track(t), guessed_ranges(r)];
    expect(overlap_of(t, tc, r, rc, guessed_reading(t, tc, r, rc, null), 0)).toEqual({
      share: 0.5,
      track_us: [1777888801e6, 1777888901e6],
      ranges_us: [1777888783e6, 1777888811e6],
    });
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
  it('has a page for every dialog, and for every part of a view that names one', () => {
    const src = new URL('../src/', import.meta.url),
      text = readdirSync(src, { recursive: true, encoding: 'utf8' })
        .filter((f) => f.endsWith('.tsx'))
        .map((f) => readFileSync(new URL(f, src), 'utf8'))
        .join(''),
      named = [
        ...text.matchAll(/useDialog<\w+>\([^;]*?'([\w-]+)'(?:, [^;]*?)?\)[,;]/g),
        ...text.matchAll(/data-help(?:-part)?="([\w-]+)"/g),
      ].map((m) => m[1]!);
    expect(named.length).toBeGreaterThan(18);
    for (const page of named.filter((n) => n !== 'help')) expect(page_for(page), page).toBe(page);
  });
  it('has the page of a part at its address, and itself', () => {
    expect(page_for('#/system/connect')).toBe('connect');
    expect(page_for('#/system')).toBe('system');
    expect(page_for('#/guide/base')).toBe('base');
    expect(page_for('#/replay/0197a3b0?t=12')).toBe('replay');
  });
  it('names every page once', () => {
    expect(new Set(PAGES.map((p) => p.id)).size).toBe(PAGES.length);
  });
});
