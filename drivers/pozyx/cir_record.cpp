#include "drivers/pozyx/cir_record.hpp"

#include <utility>

#include "core/base/check.hpp"
#include "drivers/pozyx/diagnostics.hpp"

namespace anchord::pozyx {

CirRecord window_of(std::span<const std::int16_t> whole) {
  ANCHORD_CHECK(whole.size() >= 2 * (k_window_from + k_window_taps), "a record of " << whole.size() / 2);
  const auto cut = [&](std::size_t from, std::size_t taps) {
    const auto piece = whole.subspan(2 * from, 2 * taps);
    return std::vector<std::int16_t>(piece.begin(), piece.end());
  };
  return {cut(k_window_from, k_window_taps), cut(k_noise_from, k_noise_taps), k_window_from};
}

void take_record(Range& range, CirRecord record, double prf_constant_db) {
  const auto d = diagnose({record.taps, record.noise, record.from}, range.rss_dbm, prf_constant_db);
  Cir cir;
  if (d) {
    range.fp_dbm = d->fp_dbm;
    range.rx_dbm = d->rx_dbm;
    range.std_noise = d->noise_sd;
    cir.first_path_idx = d->first_path_idx - static_cast<double>(record.from);  // of the taps given
    cir.preamble_count = d->preamble_count;
  }
  cir.re_im = std::move(record.taps);
  range.cir = std::move(cir);
}

}  // namespace anchord::pozyx
