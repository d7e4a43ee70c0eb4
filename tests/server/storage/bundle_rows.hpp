#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/ports/bundle_store.hpp"

namespace anchord {

/// Rows in memory, in and out.
struct BundleRows final : BundleSink, BundleSource {
  std::map<std::string, std::vector<BundleRow>> tables;
  std::string name;
  std::size_t at{0};
  Result<void> begin(const BundleTable& table) override {
    tables[name = table.name];
    return boost::outcome_v2::success();
  }
  Result<void> row(const BundleRow& row) override {
    tables[name].push_back(row);
    return boost::outcome_v2::success();
  }
  Result<void> open(const BundleTable& table) override {
    name = table.name;
    at = 0;
    return boost::outcome_v2::success();
  }
  Result<bool> next(BundleRow& row) override {
    if (at >= tables[name].size()) return false;
    row = tables[name][at++];
    return true;
  }
};

}  // namespace anchord
