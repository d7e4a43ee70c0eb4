#include "api/measurements/ingest.hpp"

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "api/measurements/row_source.hpp"
#include "api/missions/mission_service.hpp"
#include "api/wire/row_parser.hpp"
#include "api/wire/row_report.hpp"
#include "api/wire/rows_json.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_batch_rows = 1000, k_max_errors = 100;

std::optional<bool> flag(const Request& request, const char* name) {
  const auto value = request.query_value(name);
  if (!value) return false;
  if (*value == "true" || *value == "1") return true;
  if (*value == "false" || *value == "0") return false;
  return std::nullopt;
}

/// A live row needs no impulse response, and it is 4 kB.
Range without_cir(Range& range) {
  auto cir = std::exchange(range.cir, std::nullopt);
  Range copy = range;
  range.cir = std::move(cir);
  return copy;
}

Result<std::vector<RowOutcome>> append(MeasurementStore& store, std::vector<Range> rows, bool atomic) {
  return store.append_ranges(std::move(rows), atomic);
}
Result<std::vector<RowOutcome>> append(MeasurementStore& store, std::vector<Fix> rows, bool atomic) {
  return store.append_fixes(std::move(rows), atomic);
}

/// Body of a request that was read whole (tests, small requests): the same path as a streamed one.
class StringReader final : public BodyReader {
 public:
  explicit StringReader(std::string_view text) : text_(text) {}
  std::size_t read(std::span<char> buffer) override {
    const std::size_t n = std::min(buffer.size(), text_.size());
    text_.copy(buffer.data(), n);
    text_.remove_prefix(n);
    return n;
  }

 private:
  std::string_view text_;
};

}  // namespace

/// One request.
template <class Row>
class IngestRun {
 public:
  IngestRun(IngestService& service, const Request& request) : service_(service), request_(request) {}

  Response run() {
    read_query();
    const std::string type = media_type(request_);
    const auto encoding = request_.header("content-encoding");
    if (!encoding.empty() && encoding != "identity")
      throw_problem(415, "media-type", "compressed bodies are not accepted");
    StringReader whole(request_.body);
    LineReader lines(
        request_.body_stream != nullptr ? *request_.body_stream : static_cast<BodyReader&>(whole),
        IngestService::k_max_body_bytes);
    if (type == "application/x-ndjson" || type == "application/ndjson" || type == "application/jsonl")
      ndjson(lines);
    else if (type == "text/csv")
      csv(lines);
    else if (type == "application/json")
      json(lines);
    else
      throw_problem(415, "media-type",
                    "send Content-Type application/json, application/x-ndjson or text/csv");
    flush();
    return answer();
  }

 private:
  void read_query() {
    std::vector<FieldError> errors;
    const auto atomic = flag(request_, "atomic"), dry_run = flag(request_, "dry_run");
    if (!atomic) errors.push_back({"/atomic", "wrong_type", "must be true or false"});
    if (!dry_run) errors.push_back({"/dry_run", "wrong_type", "must be true or false"});
    for (const auto& [key, value] : request_.query) {
      if (key != "atomic" && key != "dry_run" && key != "mission")
        errors.push_back({"/" + to_utf8(key, 60), "unknown_field", "no such query parameter"});
    }
    if (const auto text = request_.query_value("mission")) {
      const auto id = parse_uuid(*text);
      if (id)
        mission_ = MissionId{id.value()};
      else
        errors.push_back({"/mission", "bad_id", id.error().message});
    }
    refuse_if_any(errors);
    atomic_ = *atomic;
    dry_run_ = *dry_run;
    if (mission_ && !known(*mission_))
      throw_problem(404, "not-found", "there is no mission " + to_string(*mission_));
  }

  void ndjson(LineReader& lines) {
    std::string line;
    for (std::uint64_t n = 1; lines.next(line); ++n) {
      if (lines.too_long())
        reject(n, {{"", "too_long", "the line is longer than 1 MiB"}});
      else if (line.find_first_not_of(" \t") != std::string::npos)
        take_text(n, line);
    }
  }

  void csv(LineReader& lines) {
    std::string line;
    if (!lines.next(line)) throw_problem(400, "malformed", "the CSV body has no header line");
    std::vector<FieldError> errors;
    const CsvRows rows(std::is_same_v<Row, Range> ? RowKind::range : RowKind::fix, line, errors);
    refuse_if_any(errors);
    for (std::uint64_t n = 2; lines.next(line); ++n) {
      if (line.empty()) continue;
      Json value;
      std::vector<FieldError> wrong;
      if (lines.too_long())
        wrong.push_back({"", "too_long", "the line is longer than 1 MiB"});
      else
        rows.row(line, value, wrong);
      if (wrong.empty())
        take(n, value);
      else
        reject(n, wrong);
    }
  }

  void json(LineReader& lines) {
    std::string body, line;
    while (lines.next(line)) {
      if (lines.too_long()) throw_problem(413, "too-large", "one line of the document is longer than 1 MiB");
      body += line;
      body += '\n';
    }
    const auto first = body.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) throw_problem(400, "malformed", "the body is empty");
    if (body[first] != '[') {
      single_ = true;
      take_text(1, body);
      return;
    }
    const auto elements = split_json_array(body);
    if (!elements) throw_problem(400, "malformed", "the body is not a JSON array");
    // Judged whole before the first row is stored: a document with a syntax error applies nothing.
    for (std::size_t i = 0; i < elements->size(); ++i) {
      if (parsed((*elements)[i])) continue;
      Json value;
      const auto error = parse_json((*elements)[i], value);
      if (error && error->code == "malformed")
        throw_problem(400, "malformed", "element " + std::to_string(i + 1) + " is not JSON", {*error});
    }
    for (std::size_t i = 0; i < elements->size(); ++i) take_text(i + 1, (*elements)[i]);
  }

  /// The row, where nothing is wrong with it.
  auto parsed(std::string_view text) {
    if constexpr (std::is_same_v<Row, Range>)
      return parser_.range(text, mission_);
    else
      return parser_.fix(text, mission_);
  }

  void take_text(std::uint64_t line, std::string_view text) {
    if (auto row = parsed(text)) {
      std::vector<FieldError> errors;
      keep(line, std::move(*row), errors);
      return;
    }
    Json value;
    if (const auto error = parse_json(text, value)) {
      if (single_ && (error->code == "malformed" || error->code == "bad_utf8"))
        throw_problem(400, "malformed", error->detail, {*error});
      reject(line, {*error});
      return;
    }
    take(line, value);
  }

  void take(std::uint64_t line, const Json& value) {
    std::vector<FieldError> errors;
    if constexpr (std::is_same_v<Row, Range>)
      keep(line, read_range(value, mission_, errors), errors);
    else
      keep(line, read_fix(value, mission_, errors), errors);
  }

  void keep(std::uint64_t line, RangeRow row, std::vector<FieldError>& errors) {
    check_mission(row.range.mission, row.pose ? &*row.pose : nullptr, errors);
    if (!errors.empty()) return reject(line, errors);
    rows_.push_back(std::move(row.range));
    if (row.pose) poses_.push_back(std::move(*row.pose));
    count(line);
  }
  void keep(std::uint64_t line, Fix fix, std::vector<FieldError>& errors) {
    check_mission(fix.mission, &fix, errors);
    if (!errors.empty()) return reject(line, errors);
    rows_.push_back(std::move(fix));
    count(line);
  }
  void count(std::uint64_t line) {
    lines_.push_back(line);
    if (rows_.size() >= k_batch_rows && !atomic_) flush();
  }

  const Mission* known(const MissionId& id) {
    // Rows of one mission come together.
    if (last_known_ != nullptr && last_known_->id == id) return last_known_;
    return last_known_ = looked_up(id);
  }

  const Mission* looked_up(const MissionId& id) {
    const auto it = seen_.find(id);
    if (it != seen_.end()) return it->second ? &*it->second : nullptr;
    auto mission = service_.missions_.mission(id);
    if (!mission && mission.error().code != Errc::not_found)
      throw ProblemException{problem_of(mission.error())};
    std::optional<Mission> found;
    if (mission) found = std::move(mission).value();
    const auto& kept = seen_.emplace(id, std::move(found)).first->second;
    return kept ? &*kept : nullptr;
  }

  void check_mission(const MissionId& id, const Fix* fix, std::vector<FieldError>& errors) {
    if (id == MissionId{}) return;  // already reported
    const Mission* mission = known(id);
    if (mission == nullptr) {
      errors.push_back({"/mission", "unknown_mission", "there is no mission " + to_string(id)});
    } else if (fix != nullptr && fix->frame != mission->frame) {
      errors.push_back({mission->frame == TrackFrame::wgs84 ? "/local_m" : "/lon", "wrong_frame",
                        mission->frame == TrackFrame::wgs84 ? "the mission is in WGS84: send lon, lat, h_m"
                                                            : "the mission has a local frame: send local_m"});
    }
  }

  void reject(std::uint64_t line, const std::vector<FieldError>& errors) {
    ++rejected_;
    ++service_.counters_.rejected;
    for (const auto& error : errors) {
      if (errors_.size() >= k_max_errors) {
        truncated_ = true;
        return;
      }
      errors_.emplace_back(line, error);
    }
  }

  void flush() {
    if (rows_.empty() || (atomic_ && rejected_ > 0)) return;
    if (dry_run_) {
      accepted_ += rows_.size();
      rows_.clear();
      poses_.clear();
      lines_.clear();
      return;
    }
    const MissionId* last = nullptr;
    for (const auto& row : rows_) {
      if (last != nullptr && *last == row.mission) continue;
      last = &row.mission;
      if (prepared_.insert(row.mission).second) service_.missions_.prepare(row.mission);
    }
    if (!poses_.empty()) store_poses();
    const bool with_cir = service_.missions_.wants_cir();
    std::vector<Row> live;
    live.reserve(rows_.size());
    for (auto& row : rows_) {
      if constexpr (std::is_same_v<Row, Range>)
        live.push_back(with_cir ? row : without_cir(row));
      else
        live.push_back(row);
    }
    // All or nothing is known only afterwards.
    if (!atomic_) service_.missions_.arrived(live);
    auto stored = append(service_.store_, std::move(rows_), atomic_);
    rows_.clear();
    if (!stored) {
      std::string before = accepted_ + duplicates_ == 0
                               ? ""
                               : "; " + std::to_string(accepted_ + duplicates_) +
                                     " rows before it are stored; send all rows again";
      throw ProblemException{problem_of(make_error(stored.error().code, stored.error().message + before))};
    }
    settle(stored.value(), live);
    lines_.clear();
  }

  void settle(const std::vector<RowOutcome>& outcomes, std::span<const Row> live) {
    bool sunk = false;
    for (const auto outcome : outcomes)
      sunk = sunk || outcome == RowOutcome::conflict || outcome == RowOutcome::unknown_mission;
    sunk = sunk && atomic_;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      switch (outcomes[i]) {
        case RowOutcome::accepted:
          if (sunk) break;
          ++accepted_;
          ++service_.counters_.accepted;
          break;
        case RowOutcome::duplicate:
          ++duplicates_;
          ++service_.counters_.duplicates;
          break;
        case RowOutcome::conflict:
          conflict_ = true;
          reject(
              lines_[i],
              {{"", "conflict",
                "a row with the same identity and other content is already stored; the stored row stays"}});
          break;
        case RowOutcome::unknown_mission:
          reject(lines_[i], {{"/mission", "unknown_mission", "the mission was removed"}});
          break;
      }
    }
    if (!sunk) service_.missions_.accepted(live, outcomes);
  }

  void store_poses() {
    const auto live = poses_;
    service_.missions_.arrived(live);
    auto stored = service_.store_.append_fixes(std::move(poses_), false);
    poses_.clear();
    if (!stored) throw ProblemException{problem_of(stored.error())};
    service_.missions_.accepted(live, stored.value());
  }

  Response answer() {
    if ((single_ || atomic_) && rejected_ > 0) {
      std::vector<FieldError> errors;
      for (auto& [line, error] : errors_) {
        if (!single_) error.detail = "line " + std::to_string(line) + ": " + error.detail;
        errors.push_back(error);
      }
      const bool only_conflict = conflict_ && errors_.front().second.code == "conflict";
      return problem(only_conflict ? 409 : 422, only_conflict ? "conflict" : "validation",
                     single_ ? std::to_string(errors.size()) +
                                   (errors.size() == 1 ? " field is wrong" : " fields are wrong")
                             : std::to_string(rejected_) + " rows are wrong; nothing was stored",
                     errors);
    }
    Ordered body{{"accepted", accepted_}, {"duplicates", duplicates_}, {"rejected", rejected_}};
    Ordered list = Ordered::array();
    for (const auto& [line, error] : errors_) {
      list.push_back(
          {{"line", line}, {"code", error.code}, {"pointer", error.pointer}, {"detail", error.detail}});
    }
    body["errors"] = std::move(list);
    body["errors_truncated"] = truncated_;
    if (dry_run_) body["dry_run"] = true;
    return row_report(body, rejected_ > 0 && accepted_ + duplicates_ == 0,
                      rejected_ == 1
                          ? "the only row is wrong; nothing was stored"
                          : "all " + std::to_string(rejected_) + " rows are wrong; nothing was stored");
  }

  IngestService& service_;
  const Request& request_;
  RowParser parser_;
  std::optional<MissionId> mission_;
  bool atomic_{false}, dry_run_{false}, single_{false}, truncated_{false}, conflict_{false};
  std::map<MissionId, std::optional<Mission>> seen_;
  const Mission* last_known_{nullptr};  ///< in seen_
  std::set<MissionId> prepared_;
  std::vector<Row> rows_;
  std::vector<Fix> poses_;
  std::vector<std::uint64_t> lines_;
  std::vector<std::pair<std::uint64_t, FieldError>> errors_;
  std::uint64_t accepted_{0}, duplicates_{0}, rejected_{0};
};

Response IngestService::ranges(const Request& request) { return IngestRun<Range>(*this, request).run(); }
Response IngestService::fixes(const Request& request) { return IngestRun<Fix>(*this, request).run(); }

}  // namespace anchord::api
