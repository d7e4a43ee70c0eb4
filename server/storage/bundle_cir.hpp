#pragma once

#include <optional>

#include "core/types/range.hpp"
#include "server/storage/bundle_tables.hpp"

/// The impulse response in a row of a bundle's table uwb_range.
namespace anchord::sql {

/// It is the last four cells: dt_ps, first_path_idx, preamble_count, re_im.
inline constexpr std::size_t k_cir_cells = 4;

/// Nothing where the range has none.
std::optional<Cir> cir_of(const BundleRow& row);
void put_cir(BundleRow& row, const Cir& cir);
/// What it is found by in a file.
Range identity_of(const BundleSpec& spec, const BundleRow& row, const MissionId& mission);

}  // namespace anchord::sql
