#pragma once

#include <utility>

#include "api/kit/support.hpp"

namespace anchord::api {

/// A list whose cursor is the id of a page's last row: `read(limit, after)` gives rows or an error, one more
/// than wanted says whether there is another page, `item` makes the JSON of a row.
template <class I, class Read, class Item, class Json = nlohmann::ordered_json>
Response id_page(const Request& request, const Read& read, const Item& item) {
  const auto page = page_query(request);
  auto rows = value_or_problem(read(page.limit + 1, cursor_id<I>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Json items = Json::array();
  for (const auto& row : rows) items.push_back(item(row));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

}  // namespace anchord::api
