#pragma once

#include <cstdint>
#include <optional>
#include <utility>

namespace anchord::device {

/// One of several that give the same thing, of which only one can be used: receivers for a track, whose
/// antennas are apart, or bases. Mixed, every anchor would be wrong by what lies between them, and no row
/// says whose it is. The first one stays, but gives way to one that is good while it was never; while nothing
/// is recorded, also when it has been silent for 5 s.
template <class Key>
class OneSource {
 public:
  /// Whether what comes from there now is the one that is used.
  /// good  of receivers: RTK
  bool takes(const Key& key, bool good, std::int64_t steady_ns, bool recording) {
    const bool other = used_ && *used_ != key;
    const bool gives_way = (good && !good_) || (!recording && steady_ns - newest_ns_ > k_silent_ns);
    if (other && !gives_way) return false;
    if (!used_ || other) {
      used_ = key;
      good_ = false;
    }
    good_ = good_ || good;
    newest_ns_ = steady_ns;
    return true;
  }
  /// A recording begins: what has been silent since before it is not waited for.
  void recording_begins(std::int64_t steady_ns) {
    if (steady_ns - newest_ns_ > k_silent_ns) used_.reset();
  }
  void gone(const Key& key) {
    if (used_ == key) used_.reset();
  }
  bool may_be(const Key& key) const { return !used_ || *used_ == key; }
  const std::optional<Key>& used() const { return used_; }

 private:
  static constexpr std::int64_t k_silent_ns = 5'000'000'000;
  std::optional<Key> used_{};
  bool good_{false};
  std::int64_t newest_ns_{0};
};

}  // namespace anchord::device
