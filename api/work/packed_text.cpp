#include "api/work/packed_text.hpp"

#include <zlib.h>

#include <algorithm>

#include "core/base/base64.hpp"
#include "core/base/check.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_step = std::size_t{1} << 20;

/// zlib takes what it only reads as if it wrote it.
Bytef* bytes_of(std::string_view text) { return reinterpret_cast<Bytef*>(const_cast<char*>(text.data())); }

struct Inflation {
  z_stream stream{};
  bool ready{inflateInit(&stream) == Z_OK};
  Inflation() = default;
  ~Inflation() {
    if (ready) inflateEnd(&stream);
  }
  Inflation(const Inflation&) = delete;
  Inflation& operator=(const Inflation&) = delete;
};

}  // namespace

std::string packed_text(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  const int done =
      compress2(bytes_of(packed), &size, bytes_of(bytes), static_cast<uLong>(bytes.size()), Z_BEST_SPEED);
  ANCHORD_CHECK(done == Z_OK, "compress2 ended with " << done);
  packed.resize(size);
  return base64(packed);
}

Result<std::string> from_packed_text(std::string_view text, std::size_t most) {
  const std::size_t longest = most + most / 1000 + 1000;  // compressed, however badly
  if (text.size() / 4 * 3 > longest)
    return make_error(Errc::bad_frame, "the message is of more than " + std::to_string(most) + " bytes");
  const auto packed = from_base64(text);
  if (!packed) return make_error(Errc::bad_frame, "the message is not base64");
  Inflation inflation;
  if (!inflation.ready) return make_error(Errc::internal, "zlib did not start");
  auto& stream = inflation.stream;
  stream.next_in = bytes_of(*packed);
  stream.avail_in = static_cast<uInt>(packed->size());
  std::string out;
  while (true) {
    const std::size_t before = out.size();
    out.resize(std::min(before + k_step, most + 1));
    stream.next_out = bytes_of(out) + before;
    stream.avail_out = static_cast<uInt>(out.size() - before);
    const int done = inflate(&stream, Z_NO_FLUSH);
    out.resize(out.size() - stream.avail_out);
    if (out.size() > most)
      return make_error(Errc::bad_frame, "the message is of more than " + std::to_string(most) + " bytes");
    if (done == Z_STREAM_END) break;
    if (done != Z_OK || out.size() == before)
      return make_error(Errc::bad_frame, "the message is cut off or damaged");
  }
  if (stream.avail_in > 0) return make_error(Errc::bad_frame, "the message has bytes behind its end");
  return out;
}

}  // namespace anchord::api
