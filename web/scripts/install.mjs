// Installs the locked packages when, and only when, they are not those of package-lock.json.
// usage: node install.mjs <npm executable>
import { createHash } from 'node:crypto';
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { spawnSync } from 'node:child_process';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const web = join(dirname(fileURLToPath(import.meta.url)), '..');
const stamp = join(web, 'node_modules', '.anchord-lock');
const hash = createHash('sha256')
  .update(readFileSync(join(web, 'package-lock.json')))
  .update(process.version)
  .digest('hex');
if (existsSync(stamp) && readFileSync(stamp, 'utf8') === hash) process.exit(0);
const run = spawnSync(process.argv[2] ?? 'npm', ['ci', '--no-audit', '--no-fund', '--loglevel=error'], {
  cwd: web,
  stdio: 'inherit',
});
if (run.status !== 0) {
  console.error(
    'anchord: npm could not install the packages of web/package-lock.json; the first build needs a package registry (or configure with -DANCHORD_WEB=OFF)',
  );
  process.exit(1);
}
writeFileSync(stamp, hash);
