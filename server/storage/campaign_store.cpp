#include <cmath>
#include <map>
#include <set>

#include "server/storage/known_samples.hpp"
#include "server/storage/measurement_rows.hpp"
#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_campaign_insert =
    "INSERT INTO campaign (id, name, radio, note, truth_sigma_m, created_t_ns, version) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)";
constexpr const char* k_campaign_named = "SELECT 1 FROM campaign WHERE name = ?1 AND id <> ?2";
constexpr const char* k_campaign_update =
    "UPDATE campaign SET name = ?2, radio = ?3, note = ?4, truth_sigma_m = ?5, version = ?6 "
    "WHERE id = ?1 AND version = ?7 RETURNING campaign_key";
constexpr const char* k_campaign_columns =
    "SELECT id, name, radio, note, truth_sigma_m, created_t_ns, version FROM campaign ";
constexpr const char* k_campaign_key = "SELECT campaign_key FROM campaign WHERE id = ?1";
constexpr const char* k_campaign_remove = "DELETE FROM campaign WHERE id = ?1 RETURNING campaign_key";
constexpr const char* k_setting_columns =
    "s.name, s.environment, s.distance_m, s.los, s.heading_deg, s.height_difference_m, s.material, "
    "s.thickness_m, s.truth_sigma_m";
constexpr const char* k_insert_setting =
    "INSERT INTO campaign_setting (campaign_key, name, environment, distance_m, los, heading_deg, "
    "height_difference_m, material, thickness_m, truth_sigma_m) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, "
    "?10) RETURNING setting_key";
constexpr const char* k_insert_sample =
    "INSERT INTO campaign_sample (setting_key, t_ns, seq, range_m, rx_dbm, fp_dbm, fp_amp1, fp_amp2, "
    "fp_amp3, cir_power, preamble_count, std_noise, max_noise, fp_index) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, "
    "?8, ?9, ?10, ?11, ?12, ?13, ?14) ON CONFLICT DO NOTHING RETURNING sample_id";
constexpr const char* k_campaign_insert_cir =
    "INSERT INTO campaign_cir (sample_id, dt_ps, first_path_idx, preamble_count, re_im) VALUES (?1, ?2, ?3, "
    "?4, ?5)";
constexpr const char* k_campaign_select_cir =
    "SELECT dt_ps, first_path_idx, preamble_count, re_im FROM campaign_cir WHERE sample_id = ?1";
constexpr const char* k_sample_columns =
    "x.sample_id, x.t_ns, x.seq, x.range_m, x.rx_dbm, x.fp_dbm, x.fp_amp1, x.fp_amp2, x.fp_amp3, "
    "x.cir_power, x.preamble_count, x.std_noise, x.max_noise, x.fp_index, "
    "EXISTS (SELECT 1 FROM campaign_cir c WHERE c.sample_id = x.sample_id)";

Error no_campaign(const CampaignId& id) {
  return make_error(Errc::not_found, "no campaign " + to_string(id));
}

CampaignRecord read_campaign(Query& query) {
  CampaignRecord c;
  c.id = query.id<CampaignId>();
  c.name = query.text();
  c.radio = query.text();
  c.note = query.text();
  c.truth_sigma_m = query.maybe_real();
  c.created = query.time();
  c.version = query.as<std::uint64_t>();
  return c;
}

GroundTruth read_truth(Query& query) {
  GroundTruth t;
  t.setting = query.text();
  t.environment = query.text();
  t.distance_m = query.maybe_real();
  t.los = query.maybe([&] { return query.integer() != 0; });
  t.heading_deg = query.maybe_real();
  t.height_difference_m = query.maybe_real();
  t.material = query.text();
  t.thickness_m = query.maybe_real();
  t.truth_sigma_m = query.maybe_real();
  return t;
}

bool same_truth(const GroundTruth& a, const GroundTruth& b) {
  return a.environment == b.environment && a.distance_m == b.distance_m && a.los == b.los &&
         a.heading_deg == b.heading_deg && a.height_difference_m == b.height_difference_m &&
         a.material == b.material && a.thickness_m == b.thickness_m && a.truth_sigma_m == b.truth_sigma_m;
}

CampaignStore::StoredSample read_sample(Query& query) {
  CampaignStore::StoredSample out;
  auto& x = out.sample;
  out.id = query.integer();
  x.time = query.maybe_time();
  x.seq = query.maybe([&] { return query.as<std::uint64_t>(); });
  x.range_m = query.real();
  for (auto* field : {&x.rx_dbm, &x.fp_dbm, &x.fp_amp1, &x.fp_amp2, &x.fp_amp3, &x.cir_power,
                      &x.preamble_count, &x.std_noise, &x.max_noise, &x.fp_index})
    *field = query.maybe_real();
  out.has_cir = query.integer() != 0;
  out.truth = read_truth(query);
  return out;
}

std::optional<std::int64_t> key_of(Connection& c, const CampaignId& id) {
  Query query(c, k_campaign_key);
  query << id;
  if (!query.step()) return std::nullopt;
  return query.integer();
}

void take_cir(Connection& c, CampaignStore::StoredSample& row) {
  if (!row.has_cir) return;
  Query query(c, k_campaign_select_cir);
  query << row.id;
  if (query.step()) row.sample.cir = read_cir_columns(query);
}

class SqlCampaignStore final : public CampaignStore {
 public:
  explicit SqlCampaignStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const CampaignRecord& campaign) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto taken = name_taken(c, campaign)) return taken;
      Query query(c, k_campaign_insert);
      query << campaign.id << campaign.name << campaign.radio << campaign.note << campaign.truth_sigma_m
            << campaign.created << campaign.version;
      query.run();
      return std::nullopt;
    });
  }

  Result<void> update(const CampaignRecord& campaign, std::uint64_t expected_version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (!key_of(c, campaign.id)) return no_campaign(campaign.id);
      if (auto taken = name_taken(c, campaign)) return taken;
      Query query(c, k_campaign_update);
      query << campaign.id << campaign.name << campaign.radio << campaign.note << campaign.truth_sigma_m
            << (expected_version + 1) << expected_version;
      if (query.returned()) return std::nullopt;
      return make_error(Errc::conflict, "campaign " + campaign.name + " changed since it was read");
    });
  }

  Result<CampaignRecord> campaign(const CampaignId& id) override {
    return read_value<CampaignRecord>(gate_, [&](Connection& c) -> Result<CampaignRecord> {
      Query query(c, std::string(k_campaign_columns) + "WHERE id = ?1");
      query << id;
      if (!query.step()) return no_campaign(id);
      return read_campaign(query);
    });
  }

  Result<CampaignRecord> campaign(std::string_view name) override {
    return read_value<CampaignRecord>(gate_, [&](Connection& c) -> Result<CampaignRecord> {
      Query query(c, std::string(k_campaign_columns) + "WHERE name = ?1");
      query << name;
      if (!query.step()) return make_error(Errc::not_found, "no campaign " + std::string(name));
      return read_campaign(query);
    });
  }

  Result<std::vector<CampaignRecord>> campaigns(std::size_t limit,
                                                const std::optional<CampaignId>& after) override {
    return read_value<std::vector<CampaignRecord>>(
        gate_, [&](Connection& c) -> Result<std::vector<CampaignRecord>> {
          Query query(c, std::string(k_campaign_columns) + (after ? "WHERE id < ?1 ORDER BY id DESC LIMIT ?2"
                                                                  : "ORDER BY id DESC LIMIT ?1"));
          if (after) query << *after;
          query << row_limit(limit);
          std::vector<CampaignRecord> found;
          while (query.step()) found.push_back(read_campaign(query));
          return found;
        });
  }

  Result<void> remove(const CampaignId& id) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_campaign_remove);
      query << id;
      if (query.returned()) return std::nullopt;
      return no_campaign(id);
    });
  }

  Result<Appended> append(const CampaignId& id, const std::vector<CampaignRow>& rows,
                          Untimed untimed) override {
    return write_value<Appended>(gate_, rows.size() + 1,
                                 [&](Connection& c) { return append_to(c, id, rows, untimed); });
  }

  Result<Appended> would_append(const CampaignId& id, const std::vector<CampaignRow>& rows,
                                Untimed untimed) override {
    std::optional<Appended> would;
    auto undone = write_value<Appended>(gate_, rows.size() + 1, [&](Connection& c) -> Result<Appended> {
      BOOST_OUTCOME_TRY(const auto done, append_to(c, id, rows, untimed));
      would = done;
      return make_error(Errc::conflict, "a dry run is taken back");
    });
    if (would) return *would;
    return undone;
  }

  Result<std::vector<Setting>> settings(const CampaignId& id) override {
    return read_value<std::vector<Setting>>(gate_, [&](Connection& c) -> Result<std::vector<Setting>> {
      const auto key = key_of(c, id);
      if (!key) return no_campaign(id);
      Query query(c, std::string("SELECT ") + k_setting_columns +
                         ", count(x.sample_id), avg(x.range_m), avg(x.range_m * x.range_m) FROM "
                         "campaign_setting s LEFT JOIN campaign_sample x ON x.setting_key = s.setting_key "
                         "WHERE s.campaign_key = ?1 GROUP BY s.setting_key ORDER BY s.setting_key");
      query << *key;
      std::vector<Setting> found;
      while (query.step()) {
        Setting s;
        s.truth = read_truth(query);
        s.n_samples = query.as<std::uint64_t>();
        s.mean_range_m = query.maybe_real().value_or(0);
        const double square = query.maybe_real().value_or(0);
        const auto n = static_cast<double>(s.n_samples);
        if (s.n_samples > 1)
          s.sd_range_m = std::sqrt(std::max(0.0, square - s.mean_range_m * s.mean_range_m) * n / (n - 1));
        found.push_back(std::move(s));
      }
      return found;
    });
  }

  Result<std::vector<StoredSample>> samples(const Filter& filter) override {
    return read_value<std::vector<StoredSample>>(
        gate_, [&](Connection& c) -> Result<std::vector<StoredSample>> {
          const auto key = key_of(c, filter.campaign);
          if (!key) return no_campaign(filter.campaign);
          std::string sql = std::string("SELECT ") + k_sample_columns + ", " + k_setting_columns +
                            " FROM campaign_sample x JOIN campaign_setting s ON s.setting_key = "
                            "x.setting_key WHERE s.campaign_key = ?1 AND x.sample_id > ?2";
          int next = 3;
          if (filter.setting) sql += " AND s.name = ?" + std::to_string(next++);
          if (filter.environment) sql += " AND s.environment = ?" + std::to_string(next++);
          const auto bare = [&](const std::string& text) { sql += " AND " + text; };
          const auto term = [&](const std::string& text) { bare(text + "?" + std::to_string(next++)); };
          limit_terms(filter.limits, {"x.range_m", "x.rx_dbm", "s.los"}, term, bare);
          if (filter.every > 1) term(thinned("x.sample_id"));
          sql += " ORDER BY x.sample_id LIMIT ?" + std::to_string(next);
          Query query(c, sql);
          query << *key << filter.after;
          if (filter.setting) query << *filter.setting;
          if (filter.environment) query << *filter.environment;
          bind_limits(query, filter.limits);
          if (filter.every > 1) query << static_cast<std::int64_t>(filter.every);
          query << row_limit(filter.limit);
          std::vector<StoredSample> found;
          while (query.step()) {
            found.push_back(read_sample(query));
            if (filter.with_cir) take_cir(c, found.back());
          }
          return found;
        });
  }

  Result<StoredSample> sample(const CampaignId& campaign, std::int64_t id) override {
    return read_value<StoredSample>(gate_, [&](Connection& c) -> Result<StoredSample> {
      const auto key = key_of(c, campaign);
      if (!key) return no_campaign(campaign);
      Query query(c, std::string("SELECT ") + k_sample_columns + ", " + k_setting_columns +
                         " FROM campaign_sample x JOIN campaign_setting s ON s.setting_key = x.setting_key "
                         "WHERE s.campaign_key = ?1 AND x.sample_id = ?2");
      query << *key << id;
      if (!query.step()) return make_error(Errc::not_found, "no sample " + std::to_string(id));
      auto found = read_sample(query);
      take_cir(c, found);
      return found;
    });
  }

 private:
  static Result<Appended> append_to(Connection& c, const CampaignId& id, const std::vector<CampaignRow>& rows,
                                    Untimed untimed) {
    const auto key = key_of(c, id);
    if (!key) return no_campaign(id);
    std::map<std::string, std::pair<std::int64_t, GroundTruth>, std::less<>> known;
    Query settings(c, std::string("SELECT s.setting_key, ") + k_setting_columns +
                          " FROM campaign_setting s WHERE s.campaign_key = ?1");
    settings << *key;
    while (settings.step()) {
      const auto setting = settings.integer();
      auto truth = read_truth(settings);
      known.try_emplace(truth.setting, setting, truth);
    }
    std::map<std::string_view, std::vector<const CampaignSample*>> of_setting;
    for (const auto& row : rows)
      if (row.sample.time || untimed == Untimed::known) of_setting[row.truth.setting].push_back(&row.sample);
    std::map<std::int64_t, KnownSamples> samples;
    std::set<std::string_view> of_file;
    Appended done;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto& truth = rows[i].truth;
      const bool is_new = !known.contains(truth.setting);
      auto at = known.find(truth.setting);
      if (at == known.end()) {
        at = known.try_emplace(truth.setting, insert_setting(c, *key, truth), truth).first;
        of_file.insert(truth.setting);
      } else if (!same_truth(at->second.second, truth)) {
        return make_error(Errc::conflict, "data row " + std::to_string(i + 1) + ": setting " + truth.setting +
                                              " has other true values than " +
                                              (of_file.contains(truth.setting) ? "in an earlier row"
                                                                               : "those of the campaign"));
      }
      const auto setting = at->second.first;
      auto here = samples.find(setting);
      if (here == samples.end())
        here = samples
                   .try_emplace(setting, c, setting,
                                is_new ? std::vector<const CampaignSample*>{} : of_setting[truth.setting])
                   .first;
      CampaignSample sample = rows[i].sample;
      if ((sample.time || untimed == Untimed::known) && here->second.take(sample)) {
        ++done.duplicates;
        continue;
      }
      // Again where another server has just taken the number.
      do sample.seq = here->second.free_seq(sample);
      while (!insert_sample(c, setting, sample));
      ++done.accepted;
    }
    return done;
  }

  static std::optional<Error> name_taken(Connection& c, const CampaignRecord& campaign) {
    Query query(c, k_campaign_named);
    query << campaign.name << campaign.id;
    if (!query.step()) return std::nullopt;
    return make_error(Errc::conflict, "there is a campaign named " + campaign.name);
  }
  static std::int64_t insert_setting(Connection& c, std::int64_t campaign_key, const GroundTruth& t) {
    Query query(c, k_insert_setting);
    query << campaign_key << t.setting << t.environment << t.distance_m << t.los << t.heading_deg
          << t.height_difference_m << t.material << t.thickness_m << t.truth_sigma_m;
    return query.returned().value();
  }
  static bool insert_sample(Connection& c, std::int64_t setting_key, const CampaignSample& x) {
    Query query(c, k_insert_sample);
    query << setting_key << x.time << x.seq << x.range_m << x.rx_dbm << x.fp_dbm << x.fp_amp1 << x.fp_amp2
          << x.fp_amp3 << x.cir_power << x.preamble_count << x.std_noise << x.max_noise << x.fp_index;
    const auto id = query.returned();
    if (!id) return false;
    if (x.cir) {
      Query cir(c, k_campaign_insert_cir);
      cir << *id << stored_dt_ps(*x.cir) << x.cir->first_path_idx << x.cir->preamble_count
          << std::as_bytes(std::span{x.cir->re_im});
      cir.run();
    }
    return true;
  }

  Gate& gate_;
};

}  // namespace

std::unique_ptr<CampaignStore> make_campaign_store(Gate& gate) {
  return std::make_unique<SqlCampaignStore>(gate);
}

}  // namespace anchord::sql
