// MAVLink streams: cutting them changes nothing, and what was read packs to a frame that reads the same.
#include <cstdint>
#include <span>

#include "drivers/mavlink/frame.hpp"
#include "tests/fuzz/check.hpp"

namespace {

using namespace anchord::mavlink;

std::vector<Received> read(std::span<const std::uint8_t> bytes, std::size_t piece) {
  Framer framer;
  std::vector<Received> out;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    framer.feed(bytes.subspan(at, std::min(piece, bytes.size() - at)), out);
  }
  return out;
}

bool same(const Message& a, const Message& b) {
  return a.id() == b.id() && std::equal(a.payload().begin(), a.payload().end(), b.payload().begin());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  const auto whole = read(bytes, size + 1), pieces = read(bytes, 7);
  anchord::fuzz::require(whole.size() == pieces.size(), "cutting the stream changes nothing");
  for (std::size_t i = 0; i < whole.size(); ++i) {
    anchord::fuzz::require(same(whole[i].message, pieces[i].message), "cutting the stream changes nothing");
    const auto again = read(Packer(whole[i].from).pack(whole[i].message), 300);
    anchord::fuzz::require(again.size() == 1 && same(again[0].message, whole[i].message),
                           "packed again it reads the same");
  }
  return 0;
}
