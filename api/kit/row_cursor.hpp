#pragma once

#include "api/kit/problem.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {

/// 422 with its pointer for a cursor that the store cannot read: asked before anything is sent, for a list
/// that is streamed has no status left to say it with.
inline void check_row_cursor(MeasurementStore& store, const MeasurementStore::Filter& filter) {
  if (filter.after.empty()) return;
  MeasurementStore::Filter probe;
  probe.mission = filter.mission;
  probe.after = filter.after;
  probe.limit = 1;
  if (const auto read = store.fixes(probe); !read && read.error().code == Errc::invalid_argument)
    throw_problem(422, "validation", "cursor is not one of ours",
                  {{"/cursor", "bad_cursor", "is not one of ours"}});
}

}  // namespace anchord::api
