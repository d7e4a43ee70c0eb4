#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/locked.hpp"

namespace anchord {
class RevisionStore;
}

namespace anchord::api {

class ContradictionWatch;

/// Whose answers are kept.
inline constexpr std::string_view k_anchor_pattern = "/api/v1/anchors/{id}";

/// Encoded answers about published anchors, for as long as nothing that they show has changed: the anchor,
/// its position, its site, the site's frame, what contradicts it. All of these are in the store, whose number
/// of changes says so, or told by the watch. Thread-safe; never waits for the disk.
class AnchorAnswers {
 public:
  AnchorAnswers(const RevisionStore& revisions, const ContradictionWatch& contradictions)
      : revisions_(revisions), contradictions_(contradictions) {}

  /// Of what was read; taken before anything is read. None: nothing may be kept.
  struct State {
    std::uint64_t stored{}, contradicted{};
    bool operator==(const State&) const = default;
  };
  std::optional<State> state() const;

  struct Answer {
    std::string body, etag;
  };
  void keep(const std::string& id, const std::optional<State>& of, Answer answer);
  /// The answer to GET /api/v1/anchors/{id}, without a body where the client has it already; none: ask the
  /// store.
  std::optional<Response> find(const Request& request) const;

 private:
  struct Kept {
    State of;
    std::map<std::string, std::shared_ptr<const Answer>, std::less<>> by_id;
  };
  const RevisionStore& revisions_;
  const ContradictionWatch& contradictions_;
  Locked<Kept> kept_;
};

}  // namespace anchord::api
