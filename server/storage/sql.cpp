#include "server/storage/sql.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/base/check.hpp"
#include "core/ports/request_mark.hpp"

namespace anchord::sql {

Error to_error(const SqlError& error) {
  switch (error.failure()) {
    case Failure::full:
      return make_error(Errc::storage_full, error.what());
    case Failure::unavailable:
    case Failure::contended:
    case Failure::damaged:
      return make_error(Errc::storage_unavailable, error.what());
    case Failure::constraint:
      return make_error(Errc::conflict, error.what());
    case Failure::internal:
      return make_error(Errc::internal, error.what());
  }
  return make_error(Errc::internal, error.what());
}

std::string insert_text(const BulkTable& table, std::size_t n_rows) {
  std::string text =
      "INSERT INTO " + std::string(table.name) + " (" + std::string(table.columns) + ") VALUES ";
  const auto n_columns = static_cast<std::size_t>(std::ranges::count(table.columns, ',')) + 1;
  for (std::size_t i = 0; i < n_rows * n_columns; ++i) {
    if (i % n_columns == 0) text += i == 0 ? "(" : "), (";
    text += (i % n_columns == 0 ? "?" : ", ?") + std::to_string(i + 1);
  }
  return text + ')';
}

Connection::Keys Connection::insert_rows(const BulkTable& table, std::size_t n, const BindRow& bind) {
  Query query(*this, insert_text(table, 1) + (table.key.empty() ? "" : " ON CONFLICT DO NOTHING"));
  Keys keys;
  if (!table.key.empty()) keys.reserve(n);
  for (std::size_t row = 0; row < n; ++row) {
    query.again();
    bind(query, row);
    if (table.key.empty())
      query.run();
    else
      keys.push_back(query.inserted(table.key));
  }
  return keys;
}

double Query::real() {
  if (null()) {
    skip();
    return std::numeric_limits<double>::quiet_NaN();
  }
  return statement_.real(column_++);
}

Uuid Query::uuid() {
  const auto bytes = blob();
  Uuid id;
  ANCHORD_CHECK(bytes.size() == id.bytes.size(), "an id of " << bytes.size() << " bytes");
  std::memcpy(id.bytes.data(), bytes.data(), bytes.size());
  return id;
}

Work marked(Work work) {
  const StoredAnswer* begun = RequestMark::current();
  if (begun == nullptr) return work;
  return [work = std::move(work), begun](Connection& c) -> std::optional<Error> {
    if (auto error = work(c)) return error;
    (void)put_answer(c, *begun, begun->created_ran_ns);
    return std::nullopt;
  };
}

Result<void> write_void(Gate& gate, const Work& work, std::size_t rows) {
  auto error = gate.write(rows, marked(work));
  gate.changed();
  if (error) return *std::move(error);
  return boost::outcome_v2::success();
}

}  // namespace anchord::sql
