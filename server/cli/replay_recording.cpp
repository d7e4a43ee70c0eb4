#include "server/cli/replay_recording.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>

#include "api/json/wire_rows.hpp"
#include "drivers/device/replay.hpp"
#include "server/cli/rest_client.hpp"

namespace anchord::cli {
namespace {

constexpr int k_batch = 1000;

int fail(const Error& error, int code) {
  std::fprintf(stderr, "anchord replay: %s\n", error.message.c_str());
  return code;
}

/// Rows of one kind on their way to the server.
class Upload {
 public:
  Upload(RestClient& client, std::string path) : client_(client), path_(std::move(path)) {}
  Result<void> add(const std::string& line) {
    batch_ += line;
    return ++n_ < k_batch ? boost::outcome_v2::success() : send();
  }
  Result<void> send() {
    if (n_ == 0) return boost::outcome_v2::success();
    BOOST_OUTCOME_TRY(const auto body, client_.post(path_, "application/x-ndjson", batch_));
    const auto answer = nlohmann::json::parse(body, nullptr, false);
    if (answer.is_object()) {
      accepted += answer.value("accepted", std::uint64_t{0});
      known += answer.value("duplicates", std::uint64_t{0});
      refused += answer.value("rejected", std::uint64_t{0});
    }
    batch_.clear();
    n_ = 0;
    return boost::outcome_v2::success();
  }
  std::uint64_t accepted{}, known{}, refused{};

 private:
  RestClient& client_;
  std::string path_, batch_;
  int n_{0};
};

void report(const device::ReplaySummary& s) {
  std::fprintf(stderr, "replay: %llu events, %llu fixes, %llu ranges\n",
               static_cast<unsigned long long>(s.events), static_cast<unsigned long long>(s.fixes),
               static_cast<unsigned long long>(s.ranges));
  if (s.unreadable_bytes > 0)
    std::fprintf(stderr, "replay: the last %llu bytes are torn\n",
                 static_cast<unsigned long long>(s.unreadable_bytes));
  for (const auto& [reason, n] : s.dropped)
    std::fprintf(stderr, "not used: %s: %llu\n", reason.c_str(), static_cast<unsigned long long>(n));
}

/// Rows that no mission recorded were not stored when they came, and are not now.
bool kept(const MissionId& mission) { return mission != MissionId{}; }

std::string line_of(const Fix& fix) { return api::fix_json(fix, std::nullopt).dump() + '\n'; }
std::string line_of(const Range& range) { return api::range_json(range, std::nullopt).dump() + '\n'; }

template <class Take>
int run(const std::string& file, Take fix, Take range) {
  const device::ReplayRows rows{
      [&](const Fix& row) { return kept(row.mission) ? fix(line_of(row)) : boost::outcome_v2::success(); },
      [&](const Range& row) {
        return kept(row.mission) ? range(line_of(row)) : boost::outcome_v2::success();
      }};
  const auto done = device::replay(file, rows);
  if (!done) return fail(done.error(), done.error().code == Errc::bad_frame ? 2 : 1);
  report(done.value());
  return 0;
}

using Line = std::function<Result<void>(const std::string&)>;

int to_streams(const std::string& file, std::ostream& fixes, std::ostream& ranges) {
  const auto into = [](std::ostream& out) -> Line {
    return [&out](const std::string& line) -> Result<void> {
      if (!(out << line)) return make_error(Errc::storage_full, "cannot write rows");
      return boost::outcome_v2::success();
    };
  };
  return run<Line>(file, into(fixes), into(ranges));
}

int to_server(const std::string& file, RestClient& client) {
  Upload fixes(client, "/api/v1/fixes"), ranges(client, "/api/v1/ranges");
  int code = run<Line>(
      file, [&](const std::string& line) { return fixes.add(line); },
      [&](const std::string& line) { return ranges.add(line); });
  for (Upload* upload : {&fixes, &ranges}) {
    if (const auto sent = upload->send(); code == 0 && !sent) code = fail(sent.error(), 1);
  }
  std::fprintf(stderr, "replay: %llu rows accepted, %llu known already, %llu refused\n",
               static_cast<unsigned long long>(fixes.accepted + ranges.accepted),
               static_cast<unsigned long long>(fixes.known + ranges.known),
               static_cast<unsigned long long>(fixes.refused + ranges.refused));
  return code == 0 && fixes.refused + ranges.refused > 0 ? 1 : code;
}

}  // namespace

int replay_recording(const std::string& file, const std::string& folder, RestClient* client) {
  if (client != nullptr) return to_server(file, *client);
  if (folder == "-") return to_streams(file, std::cout, std::cout);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::ofstream fixes(folder + "/fixes.ndjson"), ranges(folder + "/ranges.ndjson");
  if (!fixes || !ranges) return fail(make_error(Errc::storage_unavailable, "cannot write into " + folder), 1);
  const int code = to_streams(file, fixes, ranges);
  fixes.close();
  ranges.close();
  return fixes && ranges ? code : 1;
}

}  // namespace anchord::cli
