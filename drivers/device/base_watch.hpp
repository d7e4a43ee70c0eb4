#pragma once

#include <optional>
#include <string>

#include "core/types/base_station.hpp"

namespace anchord::device {

/// Whether the base behind a caster's corrections stays where it was when the flight began. RTK positions are
/// relative to it: a base that surveys itself in anew moves the rest of the flight, and no sigma tells of it.
class BaseWatch {
 public:
  void note(const BaseStation& told);
  /// A flight begins, or ends: the newest that was told of is now the one to compare with.
  void flight(bool begins);
  /// What is wrong and what to do, as first seen in this flight; empty: nothing.
  const std::string& trouble() const { return trouble_; }

 private:
  std::optional<BaseStation> at_start_{}, newest_{};
  bool in_flight_{false};
  std::string trouble_;
};

}  // namespace anchord::device
