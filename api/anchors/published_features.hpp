#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/anchors/anchor_json.hpp"

namespace anchord::api {

struct AnchorApi;

/// Sites, calibrations and frames that the features of one answer refer to, each read once.
class FeatureLookup {
 public:
  explicit FeatureLookup(AnchorApi& services);
  ~FeatureLookup();
  FeatureLookup(const FeatureLookup&) = delete;
  FeatureLookup& operator=(const FeatureLookup&) = delete;

  std::optional<Site> site(const std::optional<SiteId>& id);
  /// Of a published place that a fitted frame gave.
  std::optional<GlobeAccuracy> globe(const PublishedPosition& position);
  /// A published position as a feature; `revision` is the one that the reader asked for. With its site as it
  /// is now, or, of what is history, with the base and the datum it was calibrated with.
  AnchorFeature feature(Anchor anchor, const PublishedPosition& position, std::uint64_t revision,
                        bool history = false);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// As it is stored; one whose row follows the flight by a moment, or waits for the disk, has no id yet.
/// Reading stores nothing.
Anchor anchor_as_stored(AnchorApi& services, NetworkId id);

/// 0: nothing was ever published.
std::uint64_t newest_revision(AnchorApi& services);

/// All features of the published revision (newest when absent), in order of network id; `number` is the
/// revision that was read.
std::vector<AnchorFeature> published_features(AnchorApi& services, std::optional<std::uint64_t> revision,
                                              std::uint64_t& number);

/// Cursor of a page of published anchors: after which of them, and in which revision, so that pages read
/// while another one is published are of one. `text` without a revision is of the newest.
struct RevisionCursor {
  std::string after;
  std::optional<std::uint64_t> revision{};
};
RevisionCursor revision_cursor(const std::string& text);
std::string revision_cursor_text(const std::string& after, std::uint64_t revision);

/// That of one anchor in the newest revision, without reading the others; none: it has no place there.
std::optional<AnchorFeature> published_feature(AnchorApi& services, const Anchor& anchor);

}  // namespace anchord::api
