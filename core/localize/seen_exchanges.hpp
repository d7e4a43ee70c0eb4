#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/types/range.hpp"

namespace anchord {

/// The newest exchanges, against repeats of them: when it is full, what came first is forgotten first.
///
/// A table of places in the ring of exchanges, open addresses with linear probing: of a bulk upload every row
/// asks, and nodes of their own, each elsewhere in memory, were a tenth of its cost.
class SeenExchanges {
 public:
  /// most  at least 1, below 2^32
  explicit SeenExchanges(std::size_t most) : most_(most) {}

  /// False: it is one of them.
  bool insert(const Range& range) {
    const Identity identity{range.time.ns, range.tag, range.anchor, range.antenna};
    const std::uint32_t hash = hash_of(identity);
    if (2 * (ring_.size() + 1) > table_.size()) grow();
    for (std::size_t i = hash & mask(); table_[i].used(); i = next(i))
      if (table_[i].hash == hash && ring_[table_[i].at] == identity) return false;
    auto at = static_cast<std::uint32_t>(ring_.size());
    if (ring_.size() < most_) {
      ring_.push_back(identity);
    } else {
      at = oldest_;
      forget(at);
      ring_[at] = identity;
      oldest_ = static_cast<std::uint32_t>((at + 1) % most_);
    }
    put({hash, at});
    return true;
  }
  std::size_t size() const { return ring_.size(); }

 private:
  struct Identity {
    std::int64_t ns;
    NetworkId tag, anchor;
    std::uint8_t antenna;
    bool operator==(const Identity&) const = default;
  };
  struct Slot {
    std::uint32_t hash{}, at{std::numeric_limits<std::uint32_t>::max()};  ///< at: in the ring
    bool used() const { return at != std::numeric_limits<std::uint32_t>::max(); }
  };

  /// Steele, Lea and Flood 2014 (splitmix64): times of one clock differ in few bits.
  static std::uint32_t hash_of(const Identity& of) {
    std::uint64_t x = static_cast<std::uint64_t>(of.ns) + 0x9e3779b97f4a7c15ULL * of.anchor.value +
                      0xd1b54a32d192ed03ULL * of.tag.value + of.antenna;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<std::uint32_t>(x ^ (x >> 31));
  }
  std::size_t mask() const { return table_.size() - 1; }
  std::size_t next(std::size_t i) const { return (i + 1) & mask(); }

  void put(Slot slot) {
    std::size_t i = slot.hash & mask();
    while (table_[i].used()) i = next(i);
    table_[i] = slot;
  }
  void grow() {
    std::vector<Slot> before(std::max<std::size_t>(64, 2 * table_.size()));
    before.swap(table_);
    for (const Slot& slot : before)
      if (slot.used()) put(slot);
  }
  /// What lies behind it moves up, as far as it may: a gap would end the search for it too early.
  void forget(std::uint32_t at) {
    std::size_t gap = hash_of(ring_[at]) & mask();
    while (table_[gap].at != at) gap = next(gap);
    for (std::size_t i = next(gap); table_[i].used(); i = next(i)) {
      const std::size_t home = table_[i].hash & mask();
      if (((i - home) & mask()) < ((i - gap) & mask())) continue;
      table_[gap] = table_[i];
      gap = i;
    }
    table_[gap] = {};
  }

  std::size_t most_;
  std::uint32_t oldest_{0};
  std::vector<Slot> table_;  ///< a power of two, at most half of it used
  std::vector<Identity> ring_;
};

}  // namespace anchord
