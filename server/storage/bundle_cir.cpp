#include "server/storage/bundle_cir.hpp"

#include <algorithm>
#include <cstring>

#include "server/storage/measurement_rows.hpp"

namespace anchord::sql {
namespace {

std::optional<double> real_of(const BundleCell& cell) {
  const auto* real = std::get_if<double>(&cell);
  return real != nullptr ? std::optional(*real) : std::nullopt;
}

}  // namespace

std::optional<Cir> cir_of(const BundleRow& row) {
  const auto* bytes = std::get_if<std::string>(&row.back());
  const BundleCell* const cells = row.data() + row.size() - k_cir_cells;
  const auto dt_ps = real_of(cells[0]);
  if (bytes == nullptr || !dt_ps || bytes->size() % 2 != 0) return std::nullopt;
  Cir cir{std::vector<std::int16_t>(bytes->size() / 2), dt_ps_of_stored(*dt_ps), real_of(cells[1]),
          real_of(cells[2])};
  if (!bytes->empty()) std::memcpy(cir.re_im.data(), bytes->data(), bytes->size());
  return cir;
}

void put_cir(BundleRow& row, const Cir& cir) {
  BundleCell* const cells = row.data() + row.size() - k_cir_cells;
  const auto cell = [](const std::optional<double>& value) -> BundleCell {
    return value ? BundleCell(*value) : BundleCell();
  };
  cells[0] = stored_dt_ps(cir);
  cells[1] = cell(cir.first_path_idx);
  cells[2] = cell(cir.preamble_count);
  cells[3] = std::string(reinterpret_cast<const char*>(cir.re_im.data()), cir.re_im.size() * 2);
}

Range identity_of(const BundleSpec& spec, const BundleRow& row, const MissionId& mission) {
  const auto whole = [&](const char* name) {
    const auto at = std::ranges::find(spec.columns, name, &BundleColumnSql::bundle);
    const auto* value = std::get_if<std::int64_t>(&row[static_cast<std::size_t>(at - spec.columns.begin())]);
    return value != nullptr ? std::optional(*value) : std::nullopt;
  };
  Range range;
  range.mission = mission;
  range.time = UtcTime{whole("t_ns").value_or(0)};
  range.tag = NetworkId{static_cast<std::uint32_t>(whole("tag").value_or(0))};
  range.anchor = NetworkId{static_cast<std::uint32_t>(whole("anchor").value_or(0))};
  range.antenna = static_cast<std::uint8_t>(whole("antenna").value_or(0));
  if (const auto seq = whole("seq")) range.seq = static_cast<std::uint64_t>(*seq);
  return range;
}

}  // namespace anchord::sql
