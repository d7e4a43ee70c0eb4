#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/bundle.hpp"

namespace anchord {

/// Takes the tables of a flight, one after the other. An error ends the writing.
class BundleSink {
 public:
  virtual ~BundleSink() = default;
  virtual Result<void> begin(const BundleTable& table) = 0;
  virtual Result<void> row(const BundleRow& row) = 0;
};

/// Gives them back.
class BundleSource {
 public:
  virtual ~BundleSource() = default;
  /// Stands before the first row of this table, whatever was read before.
  virtual Result<void> open(const BundleTable& table) = 0;
  /// False at its end.
  virtual Result<bool> next(BundleRow& row) = 0;
};

/// What became of a bundle.
struct BundleOutcome {
  struct Table {
    std::string name;
    std::uint64_t n_rows{}, n_added{};
  };
  struct LeftOut {
    std::string what, why;
  };
  std::vector<Table> tables;
  std::vector<LeftOut> left_out;  ///< calibrations and revisions that cannot stand here, each with its reason
  bool added() const {
    for (const auto& table : tables)
      if (table.n_added > 0) return true;
    return false;
  }
};

/// A flight as rows that another server can take: everything that is stored of it, by the names and ids that
/// hold anywhere. Keys that only this database knows (row numbers) do not leave it. Callable from any thread;
/// errors as in measurement_store.hpp.
class BundleStore {
 public:
  virtual ~BundleStore() = default;
  /// Every kind of row there is, in the order in which they are written and taken.
  virtual const std::vector<BundleTable>& tables() const = 0;
  /// All of one flight as it is at one moment. errors: not_found (no such mission, or in the bin), conflict
  /// (it records), those of the sink.
  virtual Result<void> write_out(const MissionId& mission, BundleSink& sink) = 0;
  /// All or nothing, in one transaction. What is here already with the same content stays. errors: conflict,
  /// naming what is here with other content; invalid_argument where the rows are none of a bundle; those of
  /// the source, which may be read more than once.
  virtual Result<BundleOutcome> take_in(const MissionId& mission, BundleSource& source) = 0;

  /// Kinds of rows of a site beside those of its flights: itself, frames, plans, anchors.
  virtual const std::vector<BundleTable>& site_tables() const = 0;
  /// errors: not_found, those of the sink
  virtual Result<void> write_site(const SiteId& site, BundleSink& sink) = 0;
  /// As take_in; every server edits these for itself, and what is here stays.
  virtual Result<BundleOutcome> take_site(const SiteId& site, BundleSource& source) = 0;
};

}  // namespace anchord
