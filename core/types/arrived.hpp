#pragma once

namespace anchord {

/// A row as it came in, and whether the live flight has taken it before it was stored.
template <class Row>
struct Arrived {
  Row row{};
  bool live{false};
};

}  // namespace anchord
