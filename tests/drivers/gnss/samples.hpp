#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "drivers/gnss/decoder.hpp"

namespace anchord::gnss::test {

/// Bytes written as hex with blanks.
inline std::string from_hex(std::string_view hex) {
  std::string out;
  int high = -1;
  for (const char c : hex) {
    const int v = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
    if (v < 0) continue;
    if (high < 0)
      high = v;
    else
      out += static_cast<char>(high * 16 + v), high = -1;
  }
  return out;
}

/// "$...*hh\r\n" round a sentence.
inline std::string sentence(std::string_view text) {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  char tail[8];
  std::snprintf(tail, sizeof tail, "*%02X\r\n", sum);
  return "$" + std::string(text) + tail;
}

/// A UBX (first two bytes given) or ERB frame with its Fletcher pair.
inline std::string with_fletcher(std::string frame) {
  unsigned a = 0, b = 0;
  for (std::size_t i = 2; i < frame.size(); ++i) {
    a = (a + static_cast<unsigned char>(frame[i])) & 0xffU;
    b = (b + a) & 0xffU;
  }
  frame += static_cast<char>(a);
  frame += static_cast<char>(b);
  return frame;
}

inline Epochs decode(std::string_view bytes, DecoderOptions options = {}, Skips* skips = nullptr) {
  Decoder decoder(options);
  Epochs out;
  decoder.feed(bytes, out);
  decoder.finish(out);
  if (skips) *skips = decoder.skips();
  return out;
}

// The computed frames of the formats' descriptions (one epoch: 2024-06-13 09:00, Ghent).
inline const std::string k_pvt = from_hex(
    "b5 62 01 07 5c 00 08 18 88 16 e8 07 06 0d 09 00 00 37 19 00 00 00 00 3e 14 f4 03 83 ea 0e b7 2b 36 02 "
    "9b 76 69 1e "
    "b8 07 01 00 e4 57 00 00 0e 00 00 00 15 00 00 00 88 ff ff ff 54 01 00 00 0f 00 00 00 68 01 00 00 78 ea "
    "a6 00 32 00 "
    "00 00 20 bf 02 00 aa 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 28 dd");
inline const std::string k_hp = from_hex(
    "b5 62 01 14 24 00 00 00 00 00 08 18 88 16 b7 2b 36 02 9b 76 69 1e b8 07 01 00 e4 57 00 00 de 0c 03 fe "
    "8e 00 00 00 "
    "d5 00 00 00 f2 c7");
inline const std::string k_erb_ver = from_hex("45 52 01 07 00 08 18 88 16 00 01 00 c7 13");
inline const std::string k_erb_pos = from_hex(
    "45 52 02 2c 00 08 18 88 16 ec ca 1d ec 03 af 0d 40 28 39 71 83 eb 82 49 40 54 e3 a5 9b c4 e0 50 40 00 "
    "00 00 00 00 "
    "80 36 40 0e 00 00 00 15 00 00 00 b9 91");
inline const std::string k_erb_stat = from_hex("45 52 03 09 00 08 18 88 16 0e 09 03 01 0e f3 4e");
inline const std::string k_erb_dops = from_hex("45 52 04 0c 00 08 18 88 16 d2 00 aa 00 8c 00 5a 00 30 d2");
inline const std::string k_erb_vel = from_hex(
    "45 52 05 1c 00 08 18 88 16 f4 ff ff ff 22 00 00 00 02 00 00 00 24 00 00 00 00 fe a6 00 00 00 00 00 bc "
    "2d");
inline const std::string k_erb_rtk =
    from_hex("45 52 07 17 00 0e 50 00 7f 7f 01 00 ea 3f 01 00 ec e8 ff ff 7d 00 0e 09 a1 c4 05 00 75 19");
inline const std::string k_gga =
    "$GNGGA,090000.20,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000*65\r\n";
inline const std::string k_rmc =
    "$GNRMC,090000.20,A,5101.3687380,N,00342.6274020,E,0.70,109.44,130624,,,D*47\r\n";
inline const std::string k_gst = "$GNGST,090000.20,0.231,0.021,0.012,35.2,0.014,0.009,0.021*79\r\n";

// Recorded with gpsd 3.22; the TPV is the format's description's.
inline const std::string k_tpv =
    R"({"class":"TPV","device":"udp://127.0.0.1:29471","status":4,"mode":3,"time":"2024-06-15T23:59:54.000Z","ept":0.005,"lat":51.022879722,"lon":3.710443322,"altHAE":63.5760,"altMSL":18.6140,"alt":18.6140,"track":277.8400,"speed":3.925,"climb":0.210,"geoidSep":44.962,"eph":4.275})"
    "\r\n";

inline std::string erb_epoch() {
  return k_erb_ver + k_erb_pos + k_erb_stat + k_erb_dops + k_erb_vel + k_erb_rtk;
}

}  // namespace anchord::gnss::test
