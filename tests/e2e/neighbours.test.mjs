// What other people's programs read of a running server, each by the program itself (docs/integration.md has the table).
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import * as ifc from 'web-ifc';
import { ndjson, simulatedFlight } from './flight.mjs';
import { apart, gdal, layer } from './gdal.mjs';
import { startServer } from './server.mjs';

const folder = mkdtempSync(join(tmpdir(), 'anchord neighbours '));
let server, mission, published;
const get = async (path) => (await server.fetch(path)).json();
const post = async (path, json, headers) => {
  const answer = await server.fetch(path, { json, headers });
  assert.ok(answer.ok, `${path}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
};

before(async () => {
  server = await startServer({ auth: 'on' });
  const flight = await simulatedFlight({ duration: 120 });
  const rows = (list) => ({ method: 'POST', headers: { 'content-type': 'application/x-ndjson' }, body: ndjson(list) });
  mission = (await post('/api/v1/missions', flight.mission)).id;
  for (const what of ['fixes', 'ranges'])
    assert.equal((await server.fetch(`/api/v1/${what}?mission=${mission}`, rows(flight[what]))).status, 200);
  await post(`/api/v1/missions/${mission}/actions`, { action: 'finish' });
  const solved = await post('/api/v1/calibrations', { missions: [mission] }, { prefer: 'wait=120' });
  await post(`/api/v1/calibrations/${solved.id}/publish`, {});
  const site = (await post('/api/v1/sites', { name: 'Hall A', projected_epsg: 25831, crs: { frame: 'ETRS89' } })).id;
  const { features } = await get('/api/v1/anchors');
  for (const [i, { properties }] of features.entries()) {
    const path = `/api/v1/anchors/${properties.network_id}`,
      etag = (await server.fetch(path)).headers.get('etag');
    const headers = { 'content-type': 'application/merge-patch+json', 'if-match': etag };
    const patched = await server.fetch(path, { method: 'PATCH', headers, json: { site, floor: String(i % 2) } });
    assert.equal(patched.status, 200, await patched.text());
  }
  // Numbers of the flight's own frame are a local frame as good as any.
  const frame = await post('/api/v1/frames', { name: 'hall', site });
  const pairs = features.map(({ properties }) => ({ anchor: properties.network_id, local_m: properties.enu_m }));
  await post(`/api/v1/frames/${frame.id}/fit`, { pairs, parameters: 4 });
  published = (await get('/api/v1/exports/anchors.geojson')).features;
  assert.ok(published.length >= 3, `${published.length} anchors`);
});
after(async () => {
  await server?.dispose();
  rmSync(folder, { recursive: true, force: true });
});

/** The file of this name under /exports, kept for a program to read. */
async function exported(name) {
  const answer = await server.fetch(`/api/v1/exports/${name}`);
  assert.equal(answer.status, 200, `${name}: ${await answer.clone().text()}`);
  const path = join(folder, name);
  writeFileSync(path, Buffer.from(await answer.arrayBuffer()));
  return path;
}
const by_id = (features, anchor, key = 'network_id') =>
  features.find((one) => String(one.properties[key]) === anchor.properties.network_id);
/** Easting and northing by PROJ's own program, from the published coordinates. */
async function projected({ geometry: { coordinates: at } }) {
  const child = execFileSync('gdaltransform', ['-s_srs', 'EPSG:4937', '-t_srs', 'EPSG:25831', '-output_xy'], {
    input: at.join(' '),
  });
  return String(child).trim().split(' ').map(Number);
}

/** Options of GDAL's OAPIF driver; the token is the password, as a GIS client sends it. */
const oapif = (...more) => ['-oo', `USERPWD=qgis:${server.token}`, ...more.flatMap((one) => ['-oo', one])];

test('GDAL reads the anchors by OGC API Features: all, in pages of two, 3-D', async () => {
  const read = await layer(`OAPIF:${server.url}/ogc`, 'anchors', ...oapif('PAGE_SIZE=2'));
  assert.equal(read.count, published.length);
  assert.equal(read.geometry, '3D Point');
  assert.equal(read.features.length, published.length);
  for (const anchor of published) {
    const same = read.features.find((one) => one.properties.network_id === anchor.properties.network_id);
    assert.ok(apart(same, anchor) <= 1e-9, `${anchor.properties.network_id}: ${apart(same, anchor)}`);
    assert.equal(same.properties.h95_m, anchor.properties.accuracy.relative.h95_m);
  }
});

test('GDAL asks for a box and gets what is in it', async () => {
  const [lon, lat] = published[0].geometry.coordinates,
    d = 1e-7;
  const listed = await gdal(
    'ogrinfo',
    '-ro',
    '-al',
    ...oapif(),
    '-spat',
    ...[lon - d, lat - d, lon + d, lat + d].map(String),
    `OAPIF:${server.url}/ogc`,
    'anchors',
  );
  assert.deepEqual(
    [...listed.matchAll(/network_id \(String\) = (\S+)/g)].map((m) => m[1]),
    [published[0].properties.network_id],
  );
});

test('GDAL reads positions by revision and the flight as a 3-D line', async () => {
  const revisions = await layer(`OAPIF:${server.url}/ogc`, 'revisions', ...oapif());
  assert.equal(revisions.count, published.length);
  const tracks = await layer(`OAPIF:${server.url}/ogc`, 'tracks', ...oapif('PAGE_SIZE=1'));
  assert.equal(tracks.geometry, '3D Line String');
  assert.equal(tracks.count, 1);
  const track = await get(`/api/v1/missions/${mission}/track?limit=10000`);
  const line = tracks.features[0].geometry.coordinates,
    all = track.geometry.coordinates.map((at) => at.map((v) => v.toFixed(9)).join());
  assert.ok(line.length > 100, `${line.length} vertices`);
  for (const at of line) assert.ok(all.includes(at.map((v) => v.toFixed(9)).join()), `${at} was flown`);
});

test('without a token GDAL is refused, and a gateway is too', async () => {
  await assert.rejects(gdal('ogrinfo', '-ro', `OAPIF:${server.url}/ogc`), /401|failed/i);
  const { token } = await post('/api/v1/tokens', { name: 'bridge', roles: ['gateway'] });
  assert.equal((await server.fetch('/ogc/collections/anchors/items', { token })).status, 403);
});

test('GDAL reads the GeoPackage: anchors with covariance, ellipses as polygons, tracks as 3-D lines, styles', async () => {
  const file = await exported('anchors.gpkg');
  const anchors = await layer(file, 'anchors');
  assert.equal(anchors.count, published.length);
  assert.equal(anchors.geometry, '3D Point');
  assert.match(anchors.summary, /ID\["EPSG",4979\]/);
  for (const anchor of published) {
    const read = by_id(anchors.features, anchor);
    // GeoJSON has nine decimals of a degree and a tenth of a millimetre of height.
    assert.ok(apart(read, anchor) <= 5.1e-5, `${apart(read, anchor)}`);
    const [ee, en, eu, nn, nu, uu] = anchor.properties.accuracy.relative.cov_enu_m2,
      p = read.properties;
    assert.deepEqual(
      [p.cov_ee_m2, p.cov_en_m2, p.cov_eu_m2, p.cov_nn_m2, p.cov_nu_m2, p.cov_uu_m2],
      [ee, en, eu, nn, nu, uu],
    );
  }
  const ellipses = await layer(file, 'ellipses95');
  assert.equal(ellipses.geometry, '3D Polygon');
  assert.equal(ellipses.count, published.length);
  for (const anchor of published) {
    const [ring] = by_id(ellipses.features, anchor).geometry.coordinates,
      { major_m, minor_m } = anchor.properties.accuracy.relative.ellipse95;
    // Degrees to metres at 51 N: radii of curvature of WGS 84 there, 6 374 200 m along and 6 391 000 m across the meridian.
    const [lon, lat] = anchor.geometry.coordinates,
      rad = Math.PI / 180;
    const far = ring.map(([x, y]) =>
      Math.hypot((x - lon) * rad * 6391000 * Math.cos(lat * rad), (y - lat) * rad * 6374200),
    );
    assert.ok(Math.abs(Math.max(...far) / major_m - 1) < 0.005, `${Math.max(...far)} of ${major_m}`);
    assert.ok(Math.abs(Math.min(...far) / minor_m - 1) < 0.005, `${Math.min(...far)} of ${minor_m}`);
  }
  const tracks = await layer(file, 'tracks');
  assert.equal(tracks.geometry, '3D Line String');
  assert.equal(tracks.count, 1);
  const styles = await gdal(
    'ogrinfo',
    '-ro',
    '-q',
    file,
    '-sql',
    'SELECT f_table_name, useAsDefault FROM layer_styles',
  );
  assert.deepEqual([...styles.matchAll(/f_table_name \(String\) = (\S+)/g)].map((m) => m[1]).sort(), [
    'anchors',
    'ellipses95',
    'tracks',
  ]);
});

test('GDAL reads the GeoPackage of all ranges: as many as there are, each where the receiver was', async () => {
  const file = join(folder, 'ranges.gpkg');
  const answer = await server.fetch(`/api/v1/missions/${mission}/ranges.gpkg`);
  assert.equal(answer.status, 200, await answer.clone().text());
  writeFileSync(file, Buffer.from(await answer.arrayBuffer()));
  const read = await layer(file, 'ranges');
  assert.equal(read.geometry, '3D Point');
  assert.match(read.summary, /ID\["EPSG",4979\]/);
  const stored = (await (await server.fetch(`/api/v1/ranges?mission=${mission}&format=ndjson`)).text())
    .trim()
    .split('\n')
    .map((line) => JSON.parse(line));
  assert.equal(read.count, stored.length);
  const fixes = (await (await server.fetch(`/api/v1/fixes?mission=${mission}&format=ndjson`)).text())
    .trim()
    .split('\n')
    .map((line) => JSON.parse(line));
  let placed = 0;
  for (const [i, row] of stored.entries()) {
    const { geometry, properties: p } = read.features[i];
    assert.deepEqual(
      [p.id, p.t_us, p.tag, p.anchor, p.distance_m],
      [row.id, row.t_us, row.tag, row.anchor, row.distance_m],
    );
    const after = fixes.findIndex((fix) => fix.t_us >= row.t_us);
    if (after < 1) continue;
    const [a, b] = [fixes[after - 1], fixes[after]];
    if (b.t_us - a.t_us > 2e6) continue;
    const share = (row.t_us - a.t_us) / (b.t_us - a.t_us);
    const place = ['lon', 'lat', 'h_m'].map((key) => a[key] + share * (b[key] - a[key]));
    const off = geometry.coordinates.map((value, k) => Math.abs(value - place[k]));
    assert.ok(off[0] < 1e-8 && off[1] < 1e-8 && off[2] < 1e-3, `${i}: ${off}`);
    placed++;
  }
  assert.ok(placed > 0.9 * stored.length, `${placed} of ${stored.length} have a place`);
});

test('GDAL reads the DXF: a layer for each floor, 3-D points in the map system', async () => {
  const { features } = await layer(await exported('anchors.dxf'), 'entities');
  const points = features.filter((one) => one.properties.SubClasses !== 'AcDbText' && !one.properties.Text);
  assert.equal(points.length, published.length);
  assert.deepEqual([...new Set(points.map((one) => one.properties.Layer))].sort(), ['FLOOR_0', 'FLOOR_1']);
  for (const anchor of published) {
    const [e, n] = await projected(anchor);
    const found = points.find(({ geometry: { coordinates: at } }) => Math.hypot(at[0] - e, at[1] - n) < 0.001);
    assert.ok(found, `${anchor.properties.network_id} at ${e} ${n}`);
    assert.equal(found.properties.Layer, `FLOOR_${anchor.properties.floor}`);
    assert.ok(Math.abs(found.geometry.coordinates[2] - anchor.geometry.coordinates[2]) < 0.001);
  }
});

test('web-ifc reads the IFC: antennas on their floors, metres of the map system, accuracy', async () => {
  const reader = new ifc.IfcAPI();
  await reader.Init();
  const model = reader.OpenModel(readFileSync(await exported('anchors.ifc')));
  assert.equal(reader.GetModelSchema(model), 'IFC4');
  const all = (type) => {
    const ids = reader.GetLineIDsWithType(model, type);
    return Array.from({ length: ids.size() }, (_, i) => reader.GetLine(model, ids.get(i), true));
  };
  const [map] = all(ifc.IFCMAPCONVERSION);
  assert.equal(map.TargetCRS.Name.value, 'EPSG:25831');
  const floors = new Map(
    all(ifc.IFCRELCONTAINEDINSPATIALSTRUCTURE).flatMap(({ RelatingStructure: floor, RelatedElements: parts }) =>
      parts.map((one) => [one.GlobalId.value, floor.Name.value]),
    ),
  );
  const properties = new Map(
    all(ifc.IFCRELDEFINESBYPROPERTIES).map(({ RelatedObjects: [one], RelatingPropertyDefinition: set }) => [
      one.GlobalId.value,
      Object.fromEntries(set.HasProperties.map((each) => [each.Name.value, each.NominalValue.value])),
    ]),
  );
  const shapes = [];
  reader.StreamAllMeshes(model, (mesh) => shapes.push(mesh.expressID));
  const antennas = all(ifc.IFCCOMMUNICATIONSAPPLIANCE);
  assert.equal(antennas.length, published.length);
  assert.equal(shapes.length, published.length, 'each is seen');
  for (const anchor of published) {
    const [e, n] = await projected(anchor),
      found = antennas.find((one) => one.Tag.value === anchor.properties.network_id),
      [x, y, z] = found.ObjectPlacement.RelativePlacement.Location.Coordinates.map((one) => one.value);
    assert.equal(found.PredefinedType.value, 'ANTENNA');
    assert.ok(Math.hypot(map.Eastings.value + x - e, map.Northings.value + y - n) < 0.001, `${x} ${y}`);
    assert.ok(Math.abs(map.OrthogonalHeight.value + z - anchor.geometry.coordinates[2]) < 0.001);
    const guid = found.GlobalId.value;
    assert.equal(floors.get(guid), anchor.properties.floor);
    assert.equal(properties.get(guid).NetworkId, anchor.properties.network_id);
  }
  reader.CloseModel(model);
});

test("GDAL reads the surveyors' table and the KML, and Pozyx has millimetres of the local frame", async () => {
  const columns = ['X=field_3', 'Y=field_2', 'Z=field_4'].map((one) => one.replace('=', '_POSSIBLE_NAMES='));
  const open = ['HEADERS=NO', 'AUTODETECT_TYPE=YES', ...columns].flatMap((one) => ['-oo', one]);
  const { features } = await layer(await exported('anchors-pnezd.csv'), 'anchors-pnezd', ...open);
  assert.equal(features.length, published.length);
  for (const anchor of published) {
    const [e, n] = await projected(anchor),
      read = features.find((one) => one.properties.field_1 === Number(anchor.properties.network_id));
    assert.ok(Math.hypot(read.properties.field_3 - e, read.properties.field_2 - n) < 0.001);
    assert.ok(Math.abs(read.geometry.coordinates[2] - anchor.geometry.coordinates[2]) < 0.001);
  }
  const kml = await gdal('ogrinfo', '-ro', '-al', '-so', await exported('anchors.kml'));
  assert.match(kml, new RegExp(`Feature Count: ${published.length}\\b`));
  const pozyx = await get('/api/v1/exports/pozyx.json');
  for (const anchor of published) {
    const one = pozyx.find((p) => p.network_id === anchor.properties.network_id);
    const apart_mm = ['x_mm', 'y_mm', 'z_mm'].map((key, i) => Math.abs(one[key] - anchor.properties.local_m[i] * 1000));
    assert.ok(Math.max(...apart_mm) <= 0.56, apart_mm.join()); // half a millimetre, and the tenth that GeoJSON rounds to
  }
});

test('a DXF that GDAL wrote is a floor plan, at the place of its coordinates', async () => {
  // Both faces of 30 cm walls round 14 m x 9 m, in metres of the map.
  const corner = [550000, 5652600];
  const ring = (inset) =>
    [
      [inset, inset],
      [14 - inset, inset],
      [14 - inset, 9 - inset],
      [inset, 9 - inset],
      [inset, inset],
    ].map(([e, n]) => [corner[0] + e, corner[1] + n]);
  const geojson = join(folder, 'hall.geojson'),
    dxf = join(folder, 'hall.dxf');
  const feature = (coordinates) => ({ type: 'Feature', properties: {}, geometry: { type: 'LineString', coordinates } });
  writeFileSync(geojson, JSON.stringify({ type: 'FeatureCollection', features: [ring(0), ring(0.3)].map(feature) }));
  await gdal('ogr2ogr', '-f', 'DXF', dxf, geojson);
  const [lon, lat] = String(
    execFileSync('gdaltransform', ['-s_srs', 'EPSG:25831', '-t_srs', 'EPSG:4937', '-output_xy'], {
      input: corner.join(' '),
    }),
  )
    .trim()
    .split(' ')
    .map(Number);
  const site = await post('/api/v1/sites', {
    name: 'Hall C',
    projected_epsg: 25831,
    crs: { frame: 'ETRS89' },
    origin: { lon, lat, h_m: 50 },
  });
  const building = await post('/api/v1/buildings', { name: 'C', site: site.id, height_m: 8 });
  const floor = await post('/api/v1/floors', { name: '0', level: 0, building: building.id });
  const path = `/api/v1/floors/${floor.id}`;
  const sent = await server.fetch(`${path}/plan`, {
    method: 'PUT',
    headers: {
      'content-type': 'application/octet-stream',
      'if-match': (await server.fetch(path)).headers.get('etag'),
    },
    body: readFileSync(dxf),
  });
  const answer = await sent.json();
  assert.equal(sent.status, 201, JSON.stringify(answer));
  assert.equal(answer.georeference.source, 'drawing');
  const traced = await post(`${path}/plan/trace`, {}, { prefer: 'wait=60' });
  for (const [lon, lat] of traced.outline.coordinates[0]) {
    const at = await projected({ geometry: { coordinates: [lon, lat] } });
    const apart = Math.min(...ring(0).map(([e, n]) => Math.hypot(at[0] - e, at[1] - n)));
    assert.ok(apart < 0.08, `${at} is ${apart} m from any corner`);
  }
  assert.equal(traced.outline.coordinates[0].length, 5);
  const etag = (await server.fetch(path)).headers.get('etag');
  const accepted = await server.fetch(`${path}/walls`, {
    method: 'PUT',
    headers: { 'if-match': etag },
    json: { from_trace: true, material: 'brick' },
  });
  assert.equal(accepted.status, 200, await accepted.text());
  const zones = await layer(`OAPIF:${server.url}/ogc`, 'zones', ...oapif());
  assert.equal(zones.count, 1);
  assert.equal(zones.geometry, 'Polygon');
  assert.equal(zones.features[0].properties.building, 'C');
  assert.ok(apart(zones.features[0], { geometry: traced.outline }) < 1e-9);
});
