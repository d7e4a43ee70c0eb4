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

/** East, north, up of the track in metres, from its first position; near enough to flat for one flight. */
const local_places = () => {
  const [first] = track,
    per_degree = 111_320;
  return track.map((r) => [
    (r.lon_deg - first.lon_deg) * per_degree * Math.cos((first.lat_deg * Math.PI) / 180),
    (r.lat_deg - first.lat_deg) * per_degree,
    r.alt_m - first.alt_m + 0.1,
  ]);
};
const since_boot_us = (t_s) => Math.round(61_234_000 + Number(t_s) * 1e6);
/** The same anchors of a local frame, to 2 mm. */
function same_local(anchors, wanted_local) {
  assert.deepEqual([...anchors.keys()].sort(), [...wanted_local.keys()].sort());
  for (const [id, a] of wanted_local) {
    const b = anchors.get(id);
    assert.equal(b.verdict, a.verdict, id);
    if (a.enu_m)
      assert.ok(Math.hypot(...a.enu_m.map((v, i) => v - b.enu_m[i])) < 0.002, `${id}: ${a.enu_m} ${b.enu_m}`);
  }
}

test('tracks that count north, east, down, and times since boot, give the anchors of east, north, up', async () => {
  const places = local_places(),
    tag = ['--tag', '0x6e01', '--lever-arm', '0,0,-0.3'],
    fixed = (v) => v.map((x) => Number(x).toFixed(4)),
    enu = write('enu.csv', ['t_s,east,north,up,fix', ...track.map((r, i) => [r.t_s, ...fixed(places[i]), r.fix])]),
    ned = ([e, n, u]) => fixed([n, e, -u]),
    px4 = write('vehicle_local_position_0.csv', [
      'timestamp,timestamp_sample,ref_timestamp,ref_lat,ref_lon,x,y,z,vx,vy,vz,xy_valid,z_valid,fix',
      ...track.map((r, i) => [
        since_boot_us(r.t_s),
        since_boot_us(r.t_s) - 300,
        6e7,
        51,
        3.7,
        ...ned(places[i]),
        ...[0, 0, 0, 1, 1],
        r.fix,
      ]),
    ]),
    bare = write('bare.csv', [
      'timestamp,x,y,z,fix',
      ...track.map((r, i) => [since_boot_us(r.t_s), ...ned(places[i]), r.fix]),
    ]),
    seconds = write('uwb_s.csv', ['t_s,anchor,range_m', ...ranges.map((r) => [r.t_s, r.anchor_id, r.range_m])]),
    micros = write('uwb_us.csv', [
      'timestamp,anchor,range_m',
      ...ranges.map((r) => [since_boot_us(r.t_s), r.anchor_id, r.range_m]),
    ]),
    up = (await solved('--track', enu, '--ranges', seconds, ...tag)).anchors,
    of_px4 = await solved('--track', px4, '--ranges', micros, ...tag);
  assert.ok([...up.values()].some((a) => a.enu_m));
  same_local(of_px4.anchors, up);
  assert.match(of_px4.stderr, /'z' counts downwards, x is north and y east/);
  const asked = await run(['solve', '--track', bare, '--ranges', micros, ...tag]);
  assert.equal(asked.code, 2);
  assert.match(asked.stderr, /--track-axes ned/);
  same_local((await solved('--track', bare, '--ranges', micros, ...tag, '--track-axes', 'ned')).anchors, up);
});

test('a log in milliseconds since boot is read in one unit, whichever option gives it', async () => {
  const places = local_places(),
    names = [...new Set(ranges.map((r) => r.anchor_id))],
    log = write('cfclient.csv', [
      ['Timestamp', ...names, 'stateEstimate.x', 'stateEstimate.y', 'stateEstimate.z'].join(','),
      ...ranges
        .slice(0, 400)
        .map((r, i) => [
          Math.round(12_300 + Number(r.t_s) * 1e3),
          ...names.map((n) => (n === r.anchor_id ? r.range_m : '')),
          ...places[Math.min(i, places.length - 1)].map((v) => v.toFixed(4)),
        ]),
    ]),
    of = async (...more) =>
      (await solved('--ranges', log, '--tag', '0x6e01', '--column-for-each-anchor', ...more)).anchors,
    plain = await of();
  assert.deepEqual(await of('--range-time', 'ms'), plain);
  assert.deepEqual(await of('--track-time', 'ms'), plain);
  const torn = await run([
    ...['solve', '--ranges', log, '--tag', '0x6e01', '--column-for-each-anchor'],
    ...['--track-time', 'ms', '--range-time', 'us'],
  ]);
  assert.equal(torn.code, 2);
  assert.match(torn.stderr, /--track-time and --range-time the same/);
});

test('tracks and ranges that are apart name the options of their times', async () => {
  const late = write('late.csv', [
      'timestamp_us,anchor,range_m',
      ...ranges.map((r) => [utc_us(r.t_s) + 864e8, r.anchor_id, r.range_m]),
    ]),
    table = write('gnss_apart.csv', [
      'time_us,lat,lon,h_ell,fix',
      ...track.map((r) => [utc_us(r.t_s), r.lat_deg, r.lon_deg, r.alt_m, r.fix]),
    ]),
    { code, stderr } = await run(['solve', '--track', table, '--ranges', late, '--tag', '0x6e01']);
  assert.equal(code, 2);
  assert.match(stderr, /none of \d+ ranges could be placed.*--track-time and --range-time.*t_us/);
});

test('several tags with one lever arm are a warning in words and JSON; each may have its own', async () => {
  const table = write('gnss_tags.csv', [
      'time_us,lat,lon,h_ell,fix,heading_deg',
      ...track.map((r) => [utc_us(r.t_s), r.lat_deg, r.lon_deg, r.alt_m, r.fix, 90]),
    ]),
    two = write('two_tags.csv', [
      'time_us,tag,anchor,range_m',
      ...ranges.map((r, i) => [utc_us(r.t_s), i % 2 ? '0x6e01' : '0x6e02', r.anchor_id, r.range_m]),
    ]),
    solve = (...arms) =>
      run(['solve', '--track', table, '--ranges', two, ...arms.flatMap((a) => ['--lever-arm', a]), '--format', 'json']),
    notes = ({ stdout }) => JSON.parse(stdout).flights[0].notes.join('\n'),
    one = await solve('0.3,0,-0.2');
  assert.equal(one.code, 0, one.stderr);
  assert.match(one.stderr, /warning: .*2 tags \(.*\) have one lever arm.*--lever-arm TAG=/);
  assert.match(notes(one), /2 tags \(.*\) have one lever arm/);
  const each = await solve('0x6e01=0.3,0,-0.2', '0x6e02=-0.3,0,-0.2');
  assert.equal(each.code, 0, each.stderr);
  assert.doesNotMatch(notes(each), /have one lever arm/);
  const mapping = write('arms.json', ['{"lever-arm": {"0x6e01": "0.3,0,-0.2", "0x6e02": "-0.3,0,-0.2"}}']),
    mapped = await run(['solve', '--track', table, '--ranges', two, '--mapping', mapping, '--format', 'json']);
  assert.equal(mapped.stdout, each.stdout);
  const unknown = await solve('0x6e03=0,0,0');
  assert.equal(unknown.code, 2);
  assert.match(unknown.stderr, /no range is of that tag/);
});

test('what anchord decode writes is a track, and files that are no tables name what reads them', async () => {
  const gpx = write('flight.gpx', ['<?xml version="1.0"?><gpx version="1.1"><trk><trkseg></trkseg></trk></gpx>']),
    llh = write(
      'emlid.LLH',
      track.map((r) => `${date(utc_us(r.t_s), '/')} ${r.lat_deg} ${r.lon_deg} ${r.alt_m}${quality(r)}`),
    ),
    refused = async (file) => (await run(['solve', '--track', file, '--ranges', pozyx()])).stderr;
  assert.match(await refused(gpx), /GPX is no table: write its points as CSV/);
  assert.match(await refused(llh), /anchord decode FILE > track\.csv/);
  const decoded = await run(['decode', llh]);
  assert.equal(decoded.code, 0, decoded.stderr);
  same(
    (await solved('--track', write('decoded.csv', [decoded.stdout.trim()]), '--ranges', pozyx())).anchors,
    wanted_of_rtklib,
  );
});

test('the page asks which way z counts, and gives each of several tags its lever arm', async () => {
  const server = await startServer({ auth: 'off' }),
    browser = await openBrowser();
  try {
    const places = local_places(),
      table = write('mocap.csv', [
        'time_us,x,y,z',
        ...track.map((r, i) => [utc_us(r.t_s), places[i][1], places[i][0], -places[i][2]].join(',')),
      ]),
      two = write('tags.csv', [
        'time_us,tag,anchor,range_m',
        ...ranges.map((r, i) => [utc_us(r.t_s), i % 2 ? '0x6e01' : '0x6e02', r.anchor_id, r.range_m]),
      ]),
      { page, seen, id } = await openPage(browser, server, { hash: '#/import' });
    await id('dropzone').waitFor();
    await page.getByLabel('Flight files').setInputFiles([table, two]);
    await id('mapping').waitFor();
    await id('import-tags').waitFor();
    assert.equal(await id('import-send').isEnabled(), false, 'nobody says which way z counts');
    await id('import-axes').selectOption('ned');
    await page.getByLabel('Up, m, tag 0x6e02').fill('-0.25');
    await id('import-name').fill('Two tags');
    await id('import-send').click();
    const get = async (path) => (await server.fetch(path)).json();
    const mission = await eventually(
      'it is in',
      async () =>
        (await get('/api/v1/missions')).items.find((m) => m.name === 'Two tags' && m.state === 'finished') ?? false,
      60_000,
    );
    assert.deepEqual(Object.fromEntries(mission.tags.map((t) => [Number(t.tag), t.lever_arm_body_m])), {
      0x6e01: [0, 0, 0],
      0x6e02: [0, 0, -0.25],
    });
    const { items } = await get(`/api/v1/fixes?mission=${mission.id}&limit=1000&sort=t_us`);
    items.forEach((fix, i) => {
      fix.local_m.forEach((v, axis) => assert.ok(Math.abs(v - places[i][axis]) < 1e-6, `${fix.local_m} ${places[i]}`));
    });
    assert.deepEqual(seen.errors, []);
    await page.close();
  } finally {
    await browser.close();
    await server.dispose();
  }
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
