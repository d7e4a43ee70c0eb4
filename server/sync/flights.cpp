// Finished flights, as bundles.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "api/formats/bundle.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"
#include "server/sync/peer.hpp"
#include "server/sync/sync.hpp"

namespace anchord::sync {
namespace {

using Json = nlohmann::json;

constexpr std::uint64_t k_manifest_bytes = 1u << 20;
constexpr const char* k_bundle_type = "application/vnd.anchord.bundle+zip";

/// Which bundle of each flight a server has taken whole: its digest, by URL and mission.
class Taken {
 public:
  Taken(std::filesystem::path file, std::string url) : file_(std::move(file)), url_(std::move(url)) {
    std::ifstream in(file_);
    all_ = Json::parse(std::string(std::istreambuf_iterator<char>(in), {}), nullptr, false);
    if (!all_.is_object() || text_of(all_, "schema") != "anchord.sync/1")
      all_ = Json{{"schema", "anchord.sync/1"}};
  }
  bool has(const std::string& mission, const std::string& digest) const {
    const auto there = all_.find(url_);
    return there != all_.end() && there->is_object() && text_of(*there, mission.c_str()) == digest;
  }
  /// A sync that ends in the middle goes on after the last flight that is noted here.
  Result<void> note(const std::string& mission, const std::string& digest) {
    all_[url_][mission] = digest;
    return server::write_private(file_, to_wire(all_, 1) + "\n");
  }

 private:
  std::filesystem::path file_;
  std::string url_;
  Json all_;
};

struct Bundle {
  std::string digest, bytes;
};

Result<Bundle> digest_of(std::string bytes, const std::filesystem::path& scratch) {
  const auto file = scratch / "bundle.anchord";
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
  BOOST_OUTCOME_TRY(const auto zip, api::ZipReader::open(file));
  BOOST_OUTCOME_TRY(const auto text, zip.text(api::k_bundle_manifest, k_manifest_bytes));
  BOOST_OUTCOME_TRY(const auto manifest, api::read_bundle_manifest(text));
  return Bundle{api::bundle_digest(manifest), std::move(bytes)};
}

std::string megabytes(std::size_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}

class Flights {
 public:
  Flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome)
      : field_(field),
        centre_(centre),
        options_(options),
        out_(outcome),
        taken_(options.state_file, centre.url()) {}

  Result<void> run() {
    BOOST_OUTCOME_TRY(auto missions, field_.list("/api/v1/missions?fields=id,name,state"));
    std::ranges::reverse(missions);  // oldest first: revisions rest on those before them
    std::vector<Json> waiting;
    for (auto& mission : missions) {
      if (text_of(mission, "state") == "finished")
        waiting.push_back(std::move(mission));
      else
        later(mission);
    }
    // A calibration of several flights comes with the last of them, and then with the others again.
    for (std::size_t before = waiting.size() + 1; !waiting.empty() && waiting.size() < before;) {
      before = waiting.size();
      std::vector<Json> again;
      for (const auto& mission : waiting) {
        BOOST_OUTCOME_TRY(const bool whole, send(mission));
        if (!whole) again.push_back(mission);
      }
      waiting = std::move(again);
      first_round_ = false;
    }
    return boost::outcome_v2::success();
  }

 private:
  void later(const Json& mission) {
    ++out_.flights_recording;
    options_.tell("flight \"" + text_of(mission, "name") + "\" is not finished: left for the next time");
  }

  /// False where a part stayed behind that may come once other flights are there.
  Result<bool> send(const Json& mission) {
    const auto id = text_of(mission, "id"), name = "flight \"" + text_of(mission, "name") + '"';
    BOOST_OUTCOME_TRY(auto got, field_.call("GET", "/api/v1/missions/" + id + "/bundle"));
    if (got.status != 200) return failed(name, told(got));
    BOOST_OUTCOME_TRY(const auto bundle, digest_of(std::move(got.body), options_.scratch));
    if (taken_.has(id, bundle.digest)) {
      BOOST_OUTCOME_TRY(const auto there, centre_.call("GET", "/api/v1/missions/" + id));
      if (there.status == 200) {
        ++out_.flights_there;
        return true;
      }
    }
    if (options_.dry_run) {
      options_.tell(name + ": would send " + megabytes(bundle.bytes.size()));
      return true;
    }
    options_.tell(name + ": " + megabytes(bundle.bytes.size()));
    BOOST_OUTCOME_TRY(const auto answer,
                      centre_.call("POST", "/api/v1/bundles", bundle.bytes, k_bundle_type));
    if (answer.status != 200 && answer.status != 201) return failed(name, told(answer));
    return arrived(id, name, bundle.digest, answer.body);
  }

  Result<bool> arrived(const std::string& id, const std::string& name, const std::string& digest,
                       const std::string& body) {
    const auto json = Json::parse(body, nullptr, false);
    if (!json.is_object() || !json.contains("added"))
      return failed(name, "not the answer of an anchord: is this the address of one?");
    bool whole = true;
    for (const auto& left : json.value("left_out", Json::array())) {
      const auto what = text_of(left, "what");
      if (what.starts_with("revision")) continue;  // positions are looked at one by one, after the flights
      whole = false;
      options_.tell(name + ": " + what + " stayed behind: " + text_of(left, "why"));
    }
    std::uint64_t rows = 0;
    for (const auto& [table, n] : json["added"].items())
      rows += n.is_number_unsigned() ? n.get<std::uint64_t>() : 0;
    if (first_round_) ++(rows > 0 ? out_.flights_sent : out_.flights_there);
    options_.tell(name + ": " +
                  (rows > 0 ? std::to_string(rows) + " rows arrived" : std::string("was there")));
    if (!whole) return false;
    BOOST_OUTCOME_TRYV(taken_.note(id, digest));
    return true;
  }

  bool failed(const std::string& name, const std::string& why) {
    out_.failed.push_back(name + ": " + why);
    options_.tell(out_.failed.back());
    return true;
  }

  Peer& field_;
  Peer& centre_;
  const SyncOptions& options_;
  Outcome& out_;
  Taken taken_;
  bool first_round_{true};
};

}  // namespace

Result<void> send_flights(Peer& field, Peer& centre, const SyncOptions& options, Outcome& outcome) {
  return Flights(field, centre, options, outcome).run();
}

}  // namespace anchord::sync
