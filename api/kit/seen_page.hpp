#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

#include "api/kit/current_sites.hpp"
#include "core/base/result.hpp"

namespace anchord::api {

/// Rows that `sees` says yes to, from those of `read(limit, after)`, page by page until there are enough.
template <class Row, class I, class Read, class Sees, class Key>
Result<std::vector<Row>> seen_page(std::size_t limit, std::optional<I> after, Read read, Sees sees, Key key) {
  if (current_sites().all()) return read(limit, after);
  std::vector<Row> out;
  const std::size_t at_once = std::max<std::size_t>(limit, 200);
  for (;;) {
    BOOST_OUTCOME_TRY(auto page, read(at_once, after));
    const bool last = page.size() < at_once;
    if (!page.empty()) after = key(page.back());
    for (auto& row : page) {
      BOOST_OUTCOME_TRY(const bool seen, sees(row));
      if (!seen) continue;
      out.push_back(std::move(row));
      if (out.size() == limit) return out;
    }
    if (last) return out;
  }
}

/// Whether the row exists and is of the sites: not_found of any other kind is an error.
template <class T>
Result<bool> is_there(const Result<T>& found) {
  if (found) return true;
  if (found.error().code == Errc::not_found) return false;
  return found.error();
}

}  // namespace anchord::api
