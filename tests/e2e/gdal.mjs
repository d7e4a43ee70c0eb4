// GDAL as other people's programs have it: ogrinfo and ogr2ogr of Debian's gdal-bin (.ci/packages, group @test).
import { execFile } from 'node:child_process';
import { promisify } from 'node:util';

const execute = promisify(execFile);
// No look beside the file, no network of its own, and no schema guessed from a cache of the last run.
const env = { ...process.env, GDAL_DISABLE_READDIR_ON_OPEN: 'TRUE', CPL_CURL_ENABLE_VSIMEM: 'NO' };

export async function gdal(program, ...args) {
  return (await execute(program, args, { env, maxBuffer: 64 << 20 })).stdout;
}

/** What a reader finds in `layer`: {features, crs (EPSG code or name), is3d, bounds, count}. `open` are options before the address. */
export async function layer(address, name, ...open) {
  const summary = await gdal('ogrinfo', '-ro', '-so', ...open, address, name);
  const collection = JSON.parse(
    await gdal('ogr2ogr', '-f', 'GeoJSON', '/vsistdout/', ...open, address, name, '-lco', 'COORDINATE_PRECISION=12'),
  );
  return {
    summary,
    features: collection.features,
    count: Number(/Feature Count: (\d+)/.exec(summary)?.[1]),
    geometry: /Geometry: (.*)/.exec(summary)?.[1],
    epsg: Number(/ID\["EPSG",(\d+)\]\]\n(?!.*ID\["EPSG")/.exec(summary)?.[1]),
  };
}

/** Largest difference of any coordinate of two features' geometries. */
export function apart(a, b) {
  const flat = (one) => one.geometry.coordinates.flat(Infinity);
  const [p, q] = [flat(a), flat(b)];
  return p.length === q.length ? Math.max(...p.map((value, i) => Math.abs(value - q[i]))) : Infinity;
}
