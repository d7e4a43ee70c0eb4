#include "server/storage/known_samples.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "server/storage/measurement_rows.hpp"

namespace anchord::sql {
namespace {

const std::string k_known_samples_columns =
    "SELECT sample_id, t_ns, seq, range_m, rx_dbm, fp_dbm, fp_amp1, fp_amp2, fp_amp3, cir_power, "
    "preamble_count, std_noise, max_noise, fp_index, EXISTS (SELECT 1 FROM campaign_cir c WHERE c.sample_id "
    "= "
    "campaign_sample.sample_id) FROM campaign_sample WHERE setting_key = ?1 AND t_ns ";
const std::string k_timed = k_known_samples_columns + ">= ?2 AND t_ns <= ?3",
                  k_untimed = k_known_samples_columns + "IS NULL";
constexpr const char* k_cir =
    "SELECT dt_ps, first_path_idx, preamble_count, re_im FROM campaign_cir WHERE "
    "sample_id = ?1";
constexpr std::int64_t k_microsecond_ns = 1000;

using Field = std::optional<double> CampaignSample::*;
constexpr std::array<Field, 10> k_told{&CampaignSample::rx_dbm,    &CampaignSample::fp_dbm,
                                       &CampaignSample::fp_amp1,   &CampaignSample::fp_amp2,
                                       &CampaignSample::fp_amp3,   &CampaignSample::cir_power,
                                       &CampaignSample::std_noise, &CampaignSample::preamble_count,
                                       &CampaignSample::max_noise, &CampaignSample::fp_index};

std::uint64_t key_of(const CampaignSample& x) {
  return x.time ? static_cast<std::uint64_t>(x.time->ns / k_microsecond_ns)
                : std::bit_cast<std::uint64_t>(x.range_m);
}

}  // namespace

KnownSamples::KnownSamples(Connection& connection, std::int64_t setting_key,
                           const std::vector<const CampaignSample*>& rows)
    : connection_(connection) {
  std::int64_t first = std::numeric_limits<std::int64_t>::max(), last = 0;
  bool untimed = false;
  for (const auto* row : rows) {
    untimed = untimed || !row->time;
    if (!row->time) continue;
    first = std::min(first, row->time->ns);
    last = std::max(last, row->time->ns);
  }
  if (first <= last) read(k_timed, setting_key, {first - k_microsecond_ns, last + k_microsecond_ns});
  if (untimed) read(k_untimed, setting_key, {});
}

void KnownSamples::read(const std::string& text, std::int64_t setting_key,
                        const std::vector<std::int64_t>& bounds) {
  Query query(connection_, text);
  query << setting_key;
  for (const auto bound : bounds) query << bound;
  while (query.step()) {
    Stored one;
    one.id = query.integer();
    one.sample.time = query.maybe_time();
    one.sample.seq = query.maybe([&] { return query.as<std::uint64_t>(); });
    one.sample.range_m = query.real();
    auto& x = one.sample;
    for (auto* field : {&x.rx_dbm, &x.fp_dbm, &x.fp_amp1, &x.fp_amp2, &x.fp_amp3, &x.cir_power,
                        &x.preamble_count, &x.std_noise, &x.max_noise, &x.fp_index})
      *field = query.maybe_real();
    one.has_cir = query.integer() != 0;
    if (x.time) seqs_[x.time->ns].insert(x.seq ? static_cast<std::int64_t>(*x.seq) : -1);
    stored_[key_of(x)].push_back(std::move(one));
  }
}

bool KnownSamples::agrees(const Stored& stored, const CampaignSample& row) {
  if (stored.sample.range_m != row.range_m) return false;
  if (row.time && std::abs(stored.sample.time->ns - row.time->ns) > k_microsecond_ns) return false;
  for (const auto field : k_told)
    if (row.*field && stored.sample.*field != row.*field) return false;
  if (!row.cir) return true;
  if (!stored.has_cir) return false;
  Query query(connection_, k_cir);
  query << stored.id;
  return query.step() && read_cir_columns(query).re_im == row.cir->re_im;
}

bool KnownSamples::take(const CampaignSample& row) {
  const auto key = key_of(row);
  const auto among = [&](std::uint64_t bucket) {
    const auto found = stored_.find(bucket);
    if (found == stored_.end()) return false;
    auto& all = found->second;
    const auto at = std::ranges::find_if(all, [&](const Stored& one) {
      return one.sample.time.has_value() == row.time.has_value() && agrees(one, row);
    });
    if (at == all.end()) return false;
    *at = std::move(all.back());
    all.pop_back();
    return true;
  };
  return among(key) || (row.time && (among(key - 1) || among(key + 1)));
}

std::optional<std::uint64_t> KnownSamples::free_seq(const CampaignSample& row) {
  if (!row.time) return row.seq;
  auto& used = seqs_[row.time->ns];
  std::int64_t seq = row.seq ? static_cast<std::int64_t>(*row.seq) : -1;
  while (!used.insert(seq).second) ++seq;
  return seq < 0 ? std::nullopt : std::optional(static_cast<std::uint64_t>(seq));
}

}  // namespace anchord::sql
