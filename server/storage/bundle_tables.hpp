#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/types/bundle.hpp"

namespace anchord::sql {

/// Whose rows a table of a bundle has, and so what may happen to them where the bundle is taken.
enum class BundlePart : std::uint8_t {
  site,         ///< one site a query
  plan,         ///< one plan a query
  model,        ///< one model a query
  shared,       ///< of other flights too
  mission,      ///< the flight itself
  declared,     ///< typed for the flight as a whole: all of it is as it is here
  measured,     ///< never changes; more may come after the flight
  counted,      ///< of what was measured; grows by what is added
  own,          ///< of the flight, never changes; more may come later
  noted,        ///< of the flight; more may come later, and each server may have its own word
  calibration,  ///< with a calibration, which may be left out
  revision,     ///< with a revision, which may be left out
};

/// Parts that every server has its own word of: what is here stays.
constexpr bool is_edited(BundlePart part) {
  return part == BundlePart::site || part == BundlePart::plan || part == BundlePart::shared ||
         part == BundlePart::mission || part == BundlePart::declared || part == BundlePart::noted;
}
/// Parts that cannot be here where the flight is not.
constexpr bool is_of_flight(BundlePart part) {
  return part == BundlePart::declared || part == BundlePart::measured || part == BundlePart::counted ||
         part == BundlePart::own || part == BundlePart::noted;
}

/// One column of a bundle in SQL.
struct BundleColumnSql {
  std::string bundle;  ///< its name in the bundle
  std::string column;  ///< in the table; empty: of the impulse response beside a range
  std::string select;  ///< what reads it
  std::string parent;  ///< the table that the id of the bundle is of; empty: it is no reference
};

/// A table with the SQL that reads, finds and adds its rows.
struct BundleSpec {
  BundlePart part{};
  BundleTable table;
  std::vector<BundleColumnSql> columns;
  bool with_cir{};                    ///< select and find give a last column: the digest of one in a file
  bool of_mission{};                  ///< has mission_key, which is always that of the flight
  std::vector<std::size_t> keys;      ///< columns that tell one row from another
  std::vector<std::string> nullable;  ///< of them, those that may be NULL
  std::string select;                 ///< ?1: mission_key, or the id of the site, plan or model
  std::string find;                   ///< parameters: mission_key where it has one, then the keys
  std::string insert;                 ///< parameters: mission_key where it has one, then the columns
  std::string count;                  ///< of the flight; ?1: mission_key
};

/// In the order in which rows are written and taken: what is named stands before what names it.
const std::vector<BundleSpec>& bundle_specs();
/// The same of a site, without its flights.
const std::vector<BundleSpec>& site_bundle_specs();

}  // namespace anchord::sql
