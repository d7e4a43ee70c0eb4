#include "drivers/sim/dwm1001.hpp"

#include <cstdio>
#include <utility>

namespace anchord::sim {
namespace {

constexpr std::int64_t k_s = 1'000'000'000;

void append(std::string& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> 8 * i & 0xff);
}
std::string position(std::int32_t x_mm, std::int32_t y_mm, std::int32_t z_mm, std::uint8_t quality) {
  std::string out;
  for (const auto mm : {x_mm, y_mm, z_mm}) append(out, static_cast<std::uint32_t>(mm), 4);
  append(out, quality, 1);
  return out;
}
std::string text(const char* format, auto... values) {
  char out[160];
  std::snprintf(out, sizeof out, format, values...);
  return out;
}

}  // namespace

std::string Dwm1001::take(std::string_view bytes, std::int64_t now_ns) {
  std::string out;
  for (const char c : bytes) {
    if (now_ns < boots_until_ns_) continue;  // lost
    if (shell_) {
      out += c;  // it echoes
      if (c == '\r')
        out += command(now_ns);
      else
        held_ += c;
      continue;
    }
    if (c == '\r') {
      if (entered_ns_ && now_ns - *entered_ns_ < k_s) {
        shell_ = true;
        entered_ns_.reset();
        held_.clear();
        out +=
            "\r\n\r\n DWM1001 TWR Real Time Location System\r\n\r\n Copyright :  2016-2019 LEAPS and "
            "Decawave\r\n";
        out +=
            " License  :  Please visit https://decawave.com/dwm1001_license\r\n Help     :  ? or "
            "help\r\n\r\ndwm> ";
      } else {
        entered_ns_ = now_ns;
      }
      continue;
    }
    entered_ns_.reset();
    held_ += c;
    if (held_.size() >= 2 && held_.size() >= 2u + static_cast<unsigned char>(held_[1])) out += binary();
  }
  return out;
}

std::string Dwm1001::command(std::int64_t now_ns) {
  const std::string word = std::exchange(held_, {});
  std::string out = "\n";
  if (word == "si") {
    out += "[000003.780 INF] sys: fw2 fw_ver=x01030001 cfg_ver=x00010700\r\n";
    if (options_.says_id)
      out += text("[000003.780 INF] uwb0: panid=xABCD addr=x%016llX\r\n",
                  static_cast<unsigned long long>(options_.node_id));
    out += "[000003.790 INF] mode: tn (act,twr,np,le)\r\n";
  } else if (word == "les") {
    les_ = !les_;
  } else if (word == "lep") {
    lep_ = !lep_;
  } else if (word == "lec") {
    lec_ = !lec_;
  } else if (word == "reset") {
    shell_ = les_ = lep_ = lec_ = false;
    boots_until_ns_ = now_ns + k_s;
    return out;
  } else if (word == "quit") {
    shell_ = false;
    return out;
  } else if (!word.empty()) {
    out += "unknown command!\r\n";
  }
  return out + "dwm> ";
}

std::string Dwm1001::binary() {
  const std::string request = std::exchange(held_, {});
  if (request[0] != '\x0c' || request[1] != '\0') return {'\x40', '\x01', '\x01'};  // an unknown command
  std::string out{'\x40', '\x01', '\x00', '\x41', '\x0d'};
  out += position(6970, 5170, -1770, 53);
  const auto n = static_cast<std::uint8_t>(distances_.size());
  if (options_.is_anchor) return out + '\x48' + '\x01' + '\x00';
  out += '\x49';
  append(out, 1u + 20u * n, 1);
  append(out, n, 1);
  for (const auto& one : distances_) {
    append(out, one.anchor, 2);
    append(out, one.mm, 4);
    append(out, one.quality, 1);
    out += position(one.x_mm, one.y_mm, one.z_mm, 100);
  }
  return out;
}

std::string Dwm1001::les() const {
  std::string out;
  for (const auto& one : distances_)
    out += text("%04X[%.2f,%.2f,%.2f]=%.2f ", one.anchor, one.x_mm * 1e-3, one.y_mm * 1e-3, one.z_mm * 1e-3,
                one.mm * 1e-3);
  return out + "le_us=3082 est[6.97,5.17,-1.77,53]\r\n";
}

std::string Dwm1001::lec() const {
  std::string out = text("DIST,%zu", distances_.size());
  int i = 0;
  for (const auto& one : distances_)
    out += text(",AN%d,%04X,%.2f,%.2f,%.2f,%.2f", i++, one.anchor, one.x_mm * 1e-3, one.y_mm * 1e-3,
                one.z_mm * 1e-3, one.mm * 1e-3);
  return out + ",POS,6.97,5.17,-1.77,53\r\n";
}

std::string Dwm1001::tick(std::int64_t now_ns) {
  if (!shell_ || now_ns < next_ns_) return {};
  next_ns_ = now_ns + static_cast<std::int64_t>(1e9 / options_.rate_hz);
  std::string out;
  if (les_ && !distances_.empty()) out += les();
  if (lep_) out += "POS,6.97,5.17,-1.77,53\r\n";
  if (lec_) out += lec();
  return out;
}

}  // namespace anchord::sim
