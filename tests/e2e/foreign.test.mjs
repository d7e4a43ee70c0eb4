// Flights in the tables of other programs, by the command line and by the page: the anchors of the flight folder they were written from.
// Forms are those of RTKLIB (2.4.3), of PX4's and ArduPilot's logs as CSV, of Pozyx and of tables with a column for each anchor; map
// coordinates, ECEF and heights above sea level by gdaltransform.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { openBrowser, openPage } from './browser.mjs';
import { eventually, run, startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord foreign '));
const flight = join(folder, 'flight');
let track, ranges, epoch_ms, wanted, wanted_of_rtklib;

const rows_of = (name) => {
  const [head, ...rows] = readFileSync(join(flight, name), 'utf8').trim().split('\n');
  return rows.map((row) => Object.fromEntries(row.split(',').map((cell, i) => [head.split(',')[i], cell])));
};
const write = (name, lines) => {
  writeFileSync(join(folder, name), `${lines.join('\n')}\n`);
  return join(folder, name);
};
const transformed = (from, to, places) =>
  execFileSync('gdaltransform', ['-s_srs', from, '-t_srs', to], {
    input: `${places.map((p) => p.join(' ')).join('\n')}\n`,
  })
    .toString()
    .trim()
    .split('\n')
    .map((line) => line.split(' ').map(Number));
const places = () => track.map((r) => [r.lon_deg, r.lat_deg, r.alt_m]);
const utc_us = (t_s) => Math.round(epoch_ms * 1000 + Number(t_s) * 1e6);
const date = (us, mark = '-') =>
  new Date(Math.floor(us / 1000)).toISOString().slice(0, 23).replaceAll('-', mark).replace('T', ' ');
/** What `solve` finds, by network id: ECEF-free, in degrees and metres. */
async function solved(...args) {
  const { code, stdout, stderr } = await run(['solve', ...args, '--format', 'json']);
  assert.equal(code, 0, stderr);
  const { flights } = JSON.parse(stdout);
  return { anchors: new Map(flights[0].anchors.map((a) => [a.network_id, a])), stderr };
}
/** The same anchors, to 2 mm. */
function same(anchors, folder_has = wanted) {
  assert.deepEqual([...anchors.keys()].sort(), [...folder_has.keys()].sort());
  for (const [id, a] of folder_has) {
    const b = anchors.get(id);
    assert.equal(b.verdict, a.verdict, id);
    if (a.lat === null) continue;
    const north_m = (b.lat - a.lat) * 111_200,
      east_m = (b.lon - a.lon) * 111_200 * Math.cos((a.lat * Math.PI) / 180);
    assert.ok(Math.hypot(north_m, east_m, b.h_m - a.h_m) < 0.002, `${id}: ${north_m} ${east_m} ${b.h_m - a.h_m}`);
  }
}

before(async () => {
  const made = await run(['simulate', 'flight', '--seed', '5', '--duration', '40', '--out', flight]);
  assert.equal(made.code, 0, made.stderr);
  // What every form has: places and fix classes. No attitude, and so no lever arm.
  const declared = JSON.parse(readFileSync(join(flight, 'flight.json'), 'utf8'));
  delete declared.track.attitude;
  declared.tags = [{ tag_id: '0x6e01', lever_arm_body_m: [0, 0, 0] }];
  writeFileSync(join(flight, 'flight.json'), JSON.stringify(declared));
  epoch_ms = Date.parse(declared.epoch_utc);
  // To the digits of RTKLIB.
  track = rows_of('track.csv').map((r) => ({
    t_s: r.t_s,
    lat_deg: Number(r.lat_deg).toFixed(9),
    lon_deg: Number(r.lon_deg).toFixed(9),
    alt_m: Number(r.alt_m).toFixed(4),
    fix: r.fix,
  }));
  ranges = rows_of('ranges.csv');
  const table = (heads, more) =>
    `${[heads, ...track.map((r) => [r.t_s, r.lat_deg, r.lon_deg, r.alt_m, r.fix, ...more])].join('\n')}\n`;
  writeFileSync(join(flight, 'track.csv'), table('t_s,lat_deg,lon_deg,alt_m,fix,sd_h_m,sd_v_m', [0.01, 0.02]));
  wanted_of_rtklib = (await solved(flight)).anchors;
  writeFileSync(join(flight, 'track.csv'), table('t_s,lat_deg,lon_deg,alt_m,fix', []));
  wanted = (await solved(flight)).anchors;
  assert.ok(wanted.size >= 4);
});
after(() => rmSync(folder, { recursive: true, force: true }));

const pozyx = () =>
  write('pozyx.csv', [
    'timestamp_us,tag_id,remote_id,distance_mm,RSS',
    ...ranges.map((r) => [utc_us(r.t_s), '0x6e01', r.anchor_id, Math.round(r.range_m * 1e3 * 1e3) / 1e3, '-80']),
  ]);
const position_file = (name, heads, cells) =>
  write(name, [
    '% program   : rnx2rtkp ver.2.4.3',
    '% inp file  : rover.obs',
    '% ref pos   : 51.023000000    3.713000000    55.0000',
    '%',
    ...heads,
    ...cells,
  ]);
const CLASSES = {
  fixed: { rtklib: 1, nmea: 4, mavlink: 6 },
  float: { rtklib: 2, nmea: 5, mavlink: 5 },
  single: { rtklib: 5, nmea: 1, mavlink: 3 },
};
const quality = ({ fix }) =>
  `   ${CLASSES[fix].rtklib}  14   0.0100   0.0100   0.0200   0.0000   0.0000   0.0000   0.50   99.9`;

test('positions of RTKLIB give the anchors of the flight folder: dates, weeks and seconds, ECEF', async () => {
  const gps = (r) => utc_us(r.t_s) + 18e6,
    week = (us) => {
      const s = us / 1e6 - 315_964_800;
      return `${Math.floor(s / 604_800)} ${(s % 604_800).toFixed(3)}`;
    },
    llh = '% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)',
    names =
      'latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio',
    degrees = (r) => `${Number(r.lat_deg).toFixed(9)} ${Number(r.lon_deg).toFixed(9)} ${Number(r.alt_m).toFixed(4)}`,
    table = pozyx(),
    centred = transformed('EPSG:4979', 'EPSG:4978', places());
  for (const file of [
    position_file(
      'dates.pos',
      [llh, `%  GPST                  ${names}`],
      track.map((r) => `${date(gps(r), '/')}   ${degrees(r)}${quality(r)}`),
    ),
    position_file(
      'weeks.pos',
      [llh, `%  GPST          ${names}`],
      track.map((r) => `${week(gps(r))}   ${degrees(r)}${quality(r)}`),
    ),
    position_file(
      'ecef.pos',
      [
        '% (x/y/z-ecef=WGS84,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)',
        '%  UTC                      x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns   sdx(m)   sdy(m)   sdz(m)  sdxy(m)  sdyz(m)  sdzx(m) age(s)  ratio',
      ],
      track.map((r, i) => `${date(utc_us(r.t_s), '/')} ${centred[i].map((v) => v.toFixed(4)).join(' ')}${quality(r)}`),
    ),
  ])
    same((await solved('--track', file, '--ranges', table)).anchors, wanted_of_rtklib);
});

test('map coordinates give the anchors of the flight folder, and nothing without their system', async () => {
  const map = transformed('EPSG:4979', 'EPSG:25831', places()),
    table = write('utm.csv', [
      'time_us;E;N;h_ell;fix',
      ...track.map((r, i) => [utc_us(r.t_s), ...map[i].map((v) => v.toFixed(5).replace('.', ',')), r.fix].join(';')),
    ]);
  const asked = await run(['solve', '--track', table, '--ranges', pozyx()]);
  assert.equal(asked.code, 2);
  assert.match(asked.stderr, /--crs EPSG:25832, UTM 32N or ECEF/);
  const beside = await run(['solve', '--track', table, '--ranges', pozyx(), '--crs', 'EPSG:2056']);
  assert.equal(beside.code, 2);
  const { anchors, stderr } = await solved('--track', table, '--ranges', pozyx(), '--crs', 'EPSG:25831');
  same(anchors);
  assert.match(stderr, /from ETRS89 \/ UTM zone 31N to ETRS89; heights above the ellipsoid/);
});

test('logs of autopilots give the anchors of the flight folder once their fix numbers and heights are said', async () => {
  const above_sea = transformed('EPSG:4979', 'EPSG:4326+5773', places()),
    px4 = write('px4.csv', [
      'timestamp,time_utc_usec,latitude_deg,longitude_deg,altitude_msl_m,altitude_ellipsoid_m,fix_type,satellites_used',
      ...track.map((r, i) => [
        utc_us(r.t_s) - epoch_ms * 1000,
        utc_us(r.t_s),
        r.lat_deg,
        r.lon_deg,
        above_sea[i][2],
        r.alt_m,
        CLASSES[r.fix].mavlink,
        19,
      ]),
    ]),
    ardupilot = write('gps.csv', [
      'timestamp,TimeUS,I,Status,NSats,HDop,Lat,Lng,Alt',
      ...track.map((r, i) => [
        (utc_us(r.t_s) / 1e6).toFixed(6),
        5e8,
        0,
        CLASSES[r.fix].mavlink,
        19,
        0.6,
        r.lat_deg,
        r.lon_deg,
        above_sea[i][2],
      ]),
    ]);
  same((await solved('--track', px4, '--ranges', pozyx(), '--fix-numbers', 'mavlink')).anchors);
  const asked = await run(['solve', '--track', ardupilot, '--ranges', pozyx()]);
  assert.equal(asked.code, 2);
  assert.match(asked.stderr, /--fix-numbers/);
  assert.match(asked.stderr, /--heights ellipsoidal, EPSG:5773/);
  const mapping = write('mapping.json', ['{"fix-numbers": "mavlink", "heights": "EPSG:5773"}']);
  same((await solved('--track', ardupilot, '--ranges', pozyx(), '--mapping', mapping)).anchors);
});

test('a receiver log of NMEA and a column for each anchor give the anchors of the flight folder', async () => {
  const sentence = (body) => {
      const sum = [...body].reduce((x, c) => x ^ c.charCodeAt(0), 0);
      return `$${body}*${sum.toString(16).toUpperCase().padStart(2, '0')}`;
    },
    angle = (v, width) => {
      const degrees = Math.floor(Math.abs(v));
      return `${String(degrees).padStart(width, '0')}${((Math.abs(v) - degrees) * 60).toFixed(7).padStart(10, '0')}`;
    },
    nmea = write(
      'rover.nmea',
      track.flatMap((r) => {
        const t = new Date(Math.round(utc_us(r.t_s) / 1000)).toISOString(),
          clock = t.slice(11, 22).replaceAll(':', ''),
          [lat, lon] = [angle(Number(r.lat_deg), 2), angle(Number(r.lon_deg), 3)];
        return [
          sentence(`GNRMC,${clock},A,${lat},N,${lon},E,0.0,,${t.slice(8, 10)}${t.slice(5, 7)}${t.slice(2, 4)},,,R`),
          sentence(
            `GNGGA,${clock},${lat},N,${lon},E,${CLASSES[r.fix].nmea},14,0.6,${(Number(r.alt_m) - 45.3).toFixed(4)},M,45.3000,M,0.5,0001`,
          ),
        ];
      }),
    ),
    names = [...new Set(ranges.map((r) => r.anchor_id))],
    wide = write('wide.csv', [
      ['time_us', ...names].join(','),
      ...ranges.map((r) => [utc_us(r.t_s), ...names.map((n) => (n === r.anchor_id ? r.range_m : ''))].join(',')),
    ]);
  same((await solved('--track', nmea, '--ranges', wide, '--tag', '0x6e01', '--column-for-each-anchor')).anchors);
});

test('the page asks for the system of map coordinates, and stores the places of the flight folder', async () => {
  const server = await startServer({ auth: 'off' }),
    browser = await openBrowser();
  try {
    const map = transformed('EPSG:4979', 'EPSG:25831', places()),
      table = write('gnss.csv', [
        'time_us,easting,northing,height,fix',
        ...track.map((r, i) => [utc_us(r.t_s), ...map[i].map((v) => v.toFixed(5)), r.fix]),
      ]),
      { page, seen, id } = await openPage(browser, server, { hash: '#/import' });
    await id('dropzone').waitFor();
    await page.getByLabel('Flight files').setInputFiles([table, pozyx()]);
    await id('mapping').waitFor();
    await id('import-map').waitFor();
    assert.equal(await id('import-send').isEnabled(), false, 'no system, and nobody says what the heights are above');
    await id('import-crs').fill('EPSG:25831');
    await id('import-heights-above').selectOption('ellipsoidal');
    await id('import-name').fill('Of a map');
    await id('import-send').click();
    const get = async (path) => (await server.fetch(path)).json();
    await eventually(
      'it is in',
      async () => (await get('/api/v1/missions')).items.some((m) => m.name === 'Of a map' && m.state === 'finished'),
      60_000,
    );
    const mission = (await get('/api/v1/missions')).items.find((m) => m.name === 'Of a map');
    // A range of 0 is a failed measurement, and rejected.
    const stored = ranges.filter((r) => r.range_m >= 0.05 && r.range_m <= 150).length;
    assert.deepEqual([mission.frame, mission.n_fixes, mission.n_ranges], ['wgs84', track.length, stored]);
    const { items } = await get(`/api/v1/fixes?mission=${mission.id}&limit=1000&sort=t_us`);
    items.forEach((fix, i) => {
      assert.ok(Math.abs(fix.lat - track[i].lat_deg) < 2e-9, `${fix.lat} ${track[i].lat_deg}`);
      assert.ok(Math.abs(fix.lon - track[i].lon_deg) < 2e-9, `${fix.lon} ${track[i].lon_deg}`);
      assert.ok(Math.abs(fix.h_m - track[i].alt_m) < 1e-4, `${fix.h_m} ${track[i].alt_m}`);
    });
    // The command line brings the same flight in.
    const brought = await run([
      ...['import', 'flight', '--track', table, '--ranges', pozyx(), '--crs', 'EPSG:25831', '--heights', 'ellipsoidal'],
      ...['--url', server.url, '--name', 'By hand'],
    ]);
    assert.equal(brought.code, 0, brought.stderr);
    const other = await get(`/api/v1/missions/${brought.stdout.trim()}`);
    assert.deepEqual([other.name, other.n_fixes, other.tags], ['By hand', mission.n_fixes, mission.tags]);
    assert.deepEqual(seen.errors, []);
    await page.close();
  } finally {
    await browser.close();
    await server.dispose();
  }
});
