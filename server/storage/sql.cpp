#include "server/storage/sql.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/base/check.hpp"

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

Result<void> write_void(Gate& gate, const Work& work, std::size_t rows) {
  if (auto error = gate.write(rows, work)) return *std::move(error);
  return boost::outcome_v2::success();
}

}  // namespace anchord::sql
