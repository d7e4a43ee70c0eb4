#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace anchord::sim {

/// One distance as the module measures it, with the position that its anchor was given.
struct DwmDistance {
  std::uint16_t anchor{};
  std::uint32_t mm{};
  std::int32_t x_mm{}, y_mm{}, z_mm{};
  std::uint8_t quality{100};
};

/// A DWM1001 with PANS firmware as the other end of the wire: the generic (binary) mode after power-up, the
/// shell after Enter twice within a second. Knows si, les, lep, lec, reset, quit and an unknown command; les,
/// lep and lec switch themselves off again. Pure: bytes in, bytes out, time as an argument.
class Dwm1001 {
 public:
  struct Options {
    std::uint64_t node_id{0xDECA1F2E3D4C6E01};
    bool says_id{true};    ///< whether `si` has it
    bool in_shell{false};  ///< as a host before left it, with `les` on
    bool is_anchor{false};
    double rate_hz{10};
  };
  explicit Dwm1001(const Options& options)
      : options_(options), shell_(options.in_shell), les_(options.in_shell) {}

  /// What the tag measures from now on.
  void measure(std::vector<DwmDistance> distances) { distances_ = std::move(distances); }
  bool streams() const { return les_; }

  /// Bytes of the host; the answer.
  std::string take(std::string_view bytes, std::int64_t now_ns);
  /// What the module says by itself up to now.
  std::string tick(std::int64_t now_ns);

 private:
  std::string command(std::int64_t now_ns);
  std::string binary();
  std::string les() const;
  std::string lec() const;

  Options options_;
  bool shell_{false}, les_{false}, lep_{false}, lec_{false};
  std::string held_;
  std::optional<std::int64_t> entered_ns_{};  ///< the Enter that may be the first of two
  std::int64_t next_ns_{0}, boots_until_ns_{0};
  std::vector<DwmDistance> distances_;
};

}  // namespace anchord::sim
