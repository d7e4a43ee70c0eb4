// Packs the built dashboard for embedding: one blob with every file plain, gzip and brotli, and a C++ table of where each lies.
// usage: node pack.mjs <dist folder> <output folder>
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync, writeFileSync, mkdirSync } from 'node:fs';
import { extname, join, resolve, sep } from 'node:path';
import { brotliCompressSync, constants, gzipSync } from 'node:zlib';

const [dist, out] = [resolve(process.argv[2] ?? 'dist'), resolve(process.argv[3] ?? 'packed')];
const types = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml',
  '.json': 'application/json',
  '.txt': 'text/plain; charset=utf-8',
};

const blob = [];
let size = 0;
const put = (bytes) => {
  blob.push(bytes);
  size += bytes.length;
  return `at(${size - bytes.length}, ${bytes.length})`;
};
const row = (path) => {
  const bytes = readFileSync(join(dist, path));
  const gzip = gzipSync(bytes, { level: 9 });
  const br = brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } });
  const none = 'at(0, 0)';
  const type = types[extname(path)];
  if (!type) throw new Error(`no content type for ${path}`);
  const etag = createHash('sha256').update(bytes).digest('hex').slice(0, 20);
  const encodings = [
    put(bytes),
    gzip.length < bytes.length ? put(gzip) : none,
    br.length < bytes.length ? put(br) : none,
  ];
  return `    {"/${path}", "${type}", "\\"${etag}\\"", ${encodings.join(', ')}, ${path.startsWith('assets/')}},`;
};

const paths = readdirSync(dist, { recursive: true, withFileTypes: true })
  .filter((e) => e.isFile())
  .map((e) =>
    join(e.parentPath, e.name)
      .slice(dist.length + 1)
      .split(sep)
      .join('/'),
  )
  .sort();
const rows = paths.map(row);
mkdirSync(out, { recursive: true });
const file = join(out, 'web_assets.bin');
const escaped = file.replaceAll('\\', '\\\\').replaceAll('"', '\\"');
writeFileSync(file, Buffer.concat(blob));
writeFileSync(
  join(out, 'web_assets.cpp'),
  `// Made by web/scripts/pack.mjs; do not edit.
#include "web/assets.hpp"

#include <array>
#include <cstddef>

asm(R"(
  .section .rodata
  .balign 16
  .hidden anchord_web_blob
  .globl anchord_web_blob
anchord_web_blob:
  .incbin "${escaped}"
  .byte 0
  .previous
)");
extern "C" const unsigned char anchord_web_blob[];

namespace anchord::web {
namespace {
std::span<const unsigned char> at(std::size_t offset, std::size_t bytes) { return {anchord_web_blob + offset, bytes}; }
}  // namespace

std::span<const WebAsset> web_assets() {
  static const std::array<WebAsset, ${rows.length}> assets{{
${rows.join('\n')}
  }};
  return assets;
}

}  // namespace anchord::web
`,
);
console.log(`packed ${paths.length} files, ${size} bytes`);
