#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "core/base/steady.hpp"

namespace anchord::server {

/// What of the states of one device is news for the log. A device that is not there is lost and found again
/// every few seconds, with the same words: the first of them is logged, and then at most one line in ten
/// minutes with how often its words came. A device that worked for a minute begins anew. Not thread-safe.
class DeviceNews {
 public:
  static constexpr double k_pause_s = 600, k_worked_s = 60;

  /// The line to log for what is said now; nothing where it says nothing new.
  std::optional<std::string> line(const std::string& text, bool works, SteadyTime now) {
    if (text == newest_) return std::nullopt;
    if (works_since_ && seconds_between(*works_since_, now) >= k_worked_s) {
      told_.clear();
      again_.reset();
    }
    newest_ = text;
    works_since_ = works ? std::optional(now) : std::nullopt;
    if (told_.size() >= k_most) told_.clear();
    const auto [at, is_new] = told_.try_emplace(text, Told{now, 0});
    if (is_new) return text;
    Told& told = at->second;
    ++told.n;
    if (seconds_between(again_ ? *again_ : told.when, now) < k_pause_s) return std::nullopt;
    again_ = now;
    const auto n = std::exchange(told, Told{now, 0}).n;
    return text + " (" + std::to_string(n) + (n == 1 ? " time" : " times") + " since this was last logged)";
  }

 private:
  static constexpr std::size_t k_most = 100;  ///< texts; one has but a few
  struct Told {
    SteadyTime when{};
    std::uint64_t n{};  ///< said since, the one that is logged now included
  };
  std::string newest_;
  std::optional<SteadyTime> works_since_, again_;  ///< again_: when words were last logged once more
  std::map<std::string, Told> told_;
};

}  // namespace anchord::server
