// GNSS streams of one format (ANCHORD_FUZZ_FORMAT) or of any (-1): what comes out is believable, and the same
// however the bytes are cut.
#include <cmath>
#include <cstdint>
#include <string_view>

#include "drivers/gnss/decoder.hpp"
#include "tests/fuzz/check.hpp"

namespace {

using namespace anchord::gnss;

Epochs decode(std::string_view bytes, std::size_t piece) {
  DecoderOptions options;
  constexpr int k_format = ANCHORD_FUZZ_FORMAT;
  if (k_format >= 0) options.only = static_cast<Protocol>(k_format);
  Decoder decoder(options);
  Epochs out;
  for (std::size_t at = 0; at < bytes.size(); at += piece) decoder.feed(bytes.substr(at, piece), out);
  decoder.finish(out);
  anchord::fuzz::require(decoder.skips().entries().size() < 40, "reasons are a fixed set");
  return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto whole = decode(bytes, size + 1), pieces = decode(bytes, 3);
  anchord::fuzz::require(whole.size() == pieces.size(), "cutting the stream changes nothing");
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const auto& e = whole[i];
    anchord::fuzz::require(e.time == pieces[i].time && e.lat_deg == pieces[i].lat_deg,
                           "cutting the stream changes nothing");
    for (const auto& value : {e.lat_deg, e.lon_deg, e.height_ellipsoid_m, e.height_msl_m, e.age_s,
                              e.sigma_e_m, e.sigma_n_m, e.sigma_u_m, e.hdop}) {
      anchord::fuzz::require(!value || std::isfinite(*value), "numbers are finite");
    }
    anchord::fuzz::require(
        !e.lat_deg || (std::abs(*e.lat_deg) <= 90 && e.lon_deg && std::abs(*e.lon_deg) <= 180),
        "positions are on the globe");
    anchord::fuzz::require(e.lat_deg || e.fix == anchord::FixClass::none || e.protocol == Protocol::erb,
                           "a fix has a position");
  }
  return 0;
}
