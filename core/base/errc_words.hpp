#pragma once

#include "core/base/enum_table.hpp"

namespace anchord {

/// Between processes: a number would mean another error in the next version.
inline constexpr auto k_errc_words = enum_table<Errc>({{"bad_frame", Errc::bad_frame},
                                                       {"checksum_mismatch", Errc::checksum_mismatch},
                                                       {"too_few_observations", Errc::too_few_observations},
                                                       {"weak_geometry", Errc::weak_geometry},
                                                       {"no_convergence", Errc::no_convergence},
                                                       {"not_found", Errc::not_found},
                                                       {"conflict", Errc::conflict},
                                                       {"invalid_argument", Errc::invalid_argument},
                                                       {"unsupported", Errc::unsupported},
                                                       {"queue_full", Errc::queue_full},
                                                       {"link_lost", Errc::link_lost},
                                                       {"storage_full", Errc::storage_full},
                                                       {"storage_unavailable", Errc::storage_unavailable},
                                                       {"canceled", Errc::canceled},
                                                       {"internal", Errc::internal}});

}  // namespace anchord
