#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "api/formats/flight_folder.hpp"
#include "api/kit/record_limits.hpp"
#include "api/measurements/flight_requests.hpp"
#include "api/wire/exclusion_json.hpp"
#include "api/wire/row_parser.hpp"
#include "core/base/line_text.hpp"
#include "core/base/text.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"
#include "server/cli/flight_source.hpp"
#include "server/cli/flight_upload.hpp"
#include "server/cli/progress.hpp"
#include "server/storage/postgres_database.hpp"

namespace anchord::cli {
namespace {

struct ImportOptions {
  std::string folder, url, data_dir, database, token_file, name;
  ForeignSource foreign;
};

std::string name_of(const ImportOptions& options, const FlightData& flight) {
  if (!options.name.empty()) return options.name;
  if (!flight.mission.name.empty()) return flight.mission.name;
  return std::filesystem::weakly_canonical(options.folder).filename().string();
}

Result<std::string> import_by_rest(const ImportOptions& options, FlightData flight) {
  BOOST_OUTCOME_TRY(const auto token, read_token_file(options.token_file));
  BOOST_OUTCOME_TRY(const auto client, RestClient::make(options.url, token, interrupted));
  const std::string name = name_of(options, flight);
  const auto exclusions = flight.exclusions;
  FlightUpload upload(*client, std::move(flight));
  BOOST_OUTCOME_TRY(upload.create_mission(name));
  {
    Progress progress("import");
    while (!upload.done()) {
      BOOST_OUTCOME_TRY(upload.send_next_batch());
      progress.show(upload.fraction());
    }
  }
  const std::string record = "/api/v1/missions/" + upload.mission_id() + "/exclusions";
  for (const auto& one : exclusions) {
    BOOST_OUTCOME_TRY(const auto made,
                      client->post(record, "application/json", api::exclusion_request_json(one),
                                   to_string(make_uuid_v7(SystemClock{}.now()))));
    if (!one.included) continue;
    BOOST_OUTCOME_TRY(const auto id, api::parse_created_id(made));
    BOOST_OUTCOME_TRYV(client->post(record + '/' + id + "/include", "application/json", "{}",
                                    to_string(make_uuid_v7(SystemClock{}.now()))));
  }
  BOOST_OUTCOME_TRY(upload.finish_mission());
  std::fprintf(stderr, "%s: %s\n", printable(name).c_str(), printable(upload.summary()).c_str());
  return upload.mission_id();
}

template <class Row, class Append>
Result<void> append_all(std::vector<Row>& rows, const MissionId& mission, std::size_t& refused,
                        Append append) {
  for (std::size_t at = 0; at < rows.size();) {
    std::vector<Row> batch;
    for (; at < rows.size() && batch.size() < FlightUpload::k_batch_rows; ++at) {
      rows[at].mission = mission;
      batch.push_back(std::move(rows[at]));
    }
    BOOST_OUTCOME_TRY(const auto outcomes, append(std::move(batch)));
    for (const RowOutcome outcome : outcomes) refused += outcome == RowOutcome::accepted ? 0 : 1;
  }
  return boost::outcome_v2::success();
}

/// Whether the server would refuse the row, were it sent: what is stored here leaves by bundles as well.
bool refused(api::RowParser& parser, const Range& range) {
  std::string text;
  api::append_range(text, range, std::nullopt, true, {});
  if (parser.range(text, range.mission)) return false;
  std::vector<api::FieldError> errors;
  (void)api::read_range(api::range_json(range, std::nullopt), range.mission, errors);
  return !errors.empty();
}
bool refused(api::RowParser& parser, const Fix& fix) {
  std::string text;
  api::append_fix(text, fix, std::nullopt);
  if (parser.fix(text, fix.mission)) return false;
  std::vector<api::FieldError> errors;
  (void)api::read_fix(api::fix_json(fix, std::nullopt), fix.mission, errors);
  return !errors.empty();
}

Result<void> check(const Mission& mission) {
  if (const auto fault = line_fault(mission.name, api::record_limits::k_name); fault != LineFault::none)
    return make_error(Errc::invalid_argument,
                      "the name of the flight " + in_words(fault, api::record_limits::k_name));
  for (const auto& tag : mission.tags) {
    constexpr auto bounds = api::record_limits::k_lever_arm_m;
    if (tag.lever_arm_body_m.minCoeff() < bounds.min || tag.lever_arm_body_m.maxCoeff() > bounds.max)
      return make_error(Errc::invalid_argument, "the lever arm of tag " + to_string(tag.tag) +
                                                    " is longer than 100 m: lever arms are in metres");
  }
  return boost::outcome_v2::success();
}

Result<std::string> import_into_folder(const ImportOptions& options, FlightData flight) {
  StorageOptions storage;
  storage.data_dir = options.data_dir;
  BOOST_OUTCOME_TRY(const auto db, open_store(options.database, storage));
  Mission mission = flight.mission;
  const UtcTime now = SystemClock{}.now();
  mission.id = MissionId{make_uuid_v7(now)};
  mission.name = name_of(options, flight);
  mission.state = MissionState::finished;
  mission.created = now;
  mission.finished = now;
  BOOST_OUTCOME_TRYV(check(mission));
  BOOST_OUTCOME_TRY(db->stores().missions.insert(mission));
  // Not from a wire: left out and counted, as the server would answer.
  api::RowParser parser;
  std::size_t n_refused =
      std::erase_if(flight.ranges, [&](const Range& row) { return refused(parser, row); });
  n_refused += std::erase_if(flight.fixes, [&](const Fix& row) { return refused(parser, row); });
  const std::size_t n = flight.fixes.size() + flight.ranges.size();
  auto& store = db->stores().measurements;
  BOOST_OUTCOME_TRY(append_all(flight.fixes, mission.id, n_refused, [&](std::vector<Fix> rows) {
    return store.append_fixes(std::move(rows), false);
  }));
  BOOST_OUTCOME_TRY(append_all(flight.ranges, mission.id, n_refused, [&](std::vector<Range> rows) {
    return store.append_ranges(std::move(rows), false);
  }));
  for (Exclusion one : flight.exclusions) {
    one.id = ExclusionId{make_uuid_v7(now)};
    one.mission = mission.id;
    const auto word = std::exchange(one.included, std::nullopt);
    BOOST_OUTCOME_TRYV(db->stores().exclusions.insert(one, {}));
    if (!word) continue;
    BOOST_OUTCOME_TRYV(db->stores().exclusions.include(mission.id, one.id, *word));
  }
  std::fprintf(stderr, "%s: %zu rows stored, %zu rejected\n", printable(mission.name).c_str(), n, n_refused);
  return to_string(mission.id);
}

Result<FlightData> read_flight(const ImportOptions& options) {
  if (options.folder.empty() == !options.foreign.given())
    return make_error(Errc::invalid_argument, "give either a flight folder, or --track and --ranges");
  if (!options.foreign.given()) return read_flight_folder(options.folder);
  BOOST_OUTCOME_TRY(auto flight, read_foreign_source(options.foreign));
  return flight;
}

int import_flight(const ImportOptions& options) {
  auto flight = read_flight(options);
  if (!flight) {
    std::fprintf(stderr, "anchord import: %s\n", printable(flight.error().message).c_str());
    return 2;
  }
  for (const auto& note : flight.value().notes) std::fprintf(stderr, "note: %s\n", printable(note).c_str());
  prepare_rows(flight.value());
  const auto id = options.data_dir.empty() ? import_by_rest(options, std::move(flight).value())
                                           : import_into_folder(options, std::move(flight).value());
  if (!id) {
    std::fprintf(stderr, "anchord import: %s\n", printable(id.error().message).c_str());
    return 1;
  }
  std::printf("%s\n", id.value().c_str());
  return 0;
}

}  // namespace

void add_import_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("import", "Import measurements from files");
  command->require_subcommand(1);
  auto* flight = command->add_subcommand(
      "flight", "Import a flight folder as a finished mission; prints the id of the mission");
  auto options = std::make_shared<ImportOptions>();
  options->url = "http://127.0.0.1:8420";
  flight->add_option("folder", options->folder,
                     "Flight folder: flight.json, track.csv[.gz], ranges.csv[.gz]; or --track and --ranges");
  auto* url = flight->add_option("--url", options->url, "Running server")->capture_default_str();
  flight
      ->add_option("--data-dir", options->data_dir,
                   "Write directly into the data folder of a server that is not running")
      ->excludes(url);
  add_database_option(*flight, options->database);
  flight->add_option("--token-file", options->token_file, "File with an access token (gateway and operator)");
  flight->add_option("--name", options->name, "Name of the mission [name of the folder]");
  add_foreign_source(*flight, options->foreign);
  flight->callback([options, &exit_code] { exit_code = import_flight(*options); });
}

}  // namespace anchord::cli
