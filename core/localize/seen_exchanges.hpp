#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_set>
#include <vector>

#include "core/types/range.hpp"

namespace anchord {

/// The newest exchanges, against repeats of them: when it is full, what came first is forgotten first.
class SeenExchanges {
 public:
  explicit SeenExchanges(std::size_t most) : most_(most) {}

  /// False: it is one of them.
  bool insert(const Range& range) {
    const Identity identity{range.time.ns, range.tag, range.anchor, range.antenna};
    if (!known_.insert(identity).second) return false;
    if (order_.size() < most_) {
      order_.push_back(identity);
      return true;
    }
    known_.erase(order_[oldest_]);
    order_[oldest_] = identity;
    oldest_ = (oldest_ + 1) % most_;
    return true;
  }
  std::size_t size() const { return known_.size(); }

 private:
  struct Identity {
    std::int64_t ns;
    NetworkId tag, anchor;
    std::uint8_t antenna;
    bool operator==(const Identity&) const = default;
  };
  struct Hash {
    /// Steele, Lea and Flood 2014 (splitmix64): times of one clock differ in few bits.
    std::size_t operator()(const Identity& of) const {
      std::uint64_t x = static_cast<std::uint64_t>(of.ns) + 0x9e3779b97f4a7c15ULL * of.anchor.value +
                        0xd1b54a32d192ed03ULL * of.tag.value + of.antenna;
      x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
      x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
      return x ^ (x >> 31);
    }
  };
  std::size_t most_, oldest_{0};
  std::unordered_set<Identity, Hash> known_;
  std::vector<Identity> order_;  ///< a ring once it is full
};

}  // namespace anchord
