#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/kit/row_cursor.hpp"
#include "api/kit/support.hpp"
#include "api/learning/learning_json.hpp"
#include "api/learning/measurement_query.hpp"
#include "api/learning/model_registry.hpp"
#include "api/learning/range_features.hpp"
#include "api/measurements/demonstration.hpp"
#include "api/measurements/ingest.hpp"
#include "api/measurements/routes.hpp"
#include "api/wire/rows_json.hpp"
#include "core/ports/measurement_store.hpp"

#include <charconv>
#include <cmath>
#include <concepts>
#include <functional>
#include <utility>

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

MeasurementStore::Filter filter_of(const Request& request, MeasurementStore& store) {
  MeasurementStore::Filter filter;
  const auto page = page_query(request, 10'000);
  filter.limit = page.limit;
  filter.after = page.cursor;
  filter.mission = query_mission(request);
  filter.anchor = query_network_id(request, "anchor");
  filter.tag = query_network_id(request, "tag");
  filter.since = query_time(request, "since");
  filter.until = query_time(request, "until");
  const auto sort = request.query_value("sort").value_or("t_us");
  if (sort != "t_us" && sort != "-t_us")
    throw_problem(422, "validation", "sort is t_us or -t_us",
                  {{"/sort", "unknown_value", "must be t_us or -t_us"}});
  filter.descending = sort == "-t_us";
  check_row_cursor(store, filter);
  return filter;
}

/// A line of comma-separated cells, its numbers as in JSON.
class CsvLine {
 public:
  explicit CsvLine(std::string& out) : out_(out) {}
  CsvLine& word(std::string_view text) {
    if (!std::exchange(first_, false)) out_ += ',';
    out_ += text;
    return *this;
  }
  CsvLine& number(double value) {
    word("");
    append_number(out_, value);
    return *this;
  }
  CsvLine& whole(std::integral auto value) { return word(std::to_string(value)); }
  CsvLine& number(const std::optional<double>& value) { return value ? number(*value) : nothing(); }
  template <std::integral Whole>
  CsvLine& whole(const std::optional<Whole>& value) {
    return value ? whole(*value) : nothing();
  }
  CsvLine& flag(const std::optional<bool>& value) {
    return value ? word(*value ? "true" : "false") : nothing();
  }
  CsvLine& nothing(int cells = 1) {
    for (; cells > 0; --cells) word("");
    return *this;
  }
  void end() { out_ += "\r\n"; }

 private:
  std::string& out_;
  bool first_{true};
};

constexpr const char* k_range_header =
    "id,t_us,mission,kind,tag,antenna,anchor,seq,distance_m,rss_dbm,fp_dbm,rx_dbm,std_noise,heading_deg,"
    "truth_distance_m,truth_los\r\n";
void append_range_csv(std::string& out, const Range& r, std::int64_t id) {
  const RangeTruth truth = r.truth.value_or(RangeTruth{});
  CsvLine line(out);
  line.whole(id).whole(r.time.us()).word(to_string(r.mission)).word(k_range_kind_words.word(r.kind));
  line.word(to_string(r.tag)).whole(r.antenna).word(to_string(r.anchor)).whole(r.seq);
  line.number(r.distance_m).number(r.rss_dbm).number(r.fp_dbm).number(r.rx_dbm).number(r.std_noise);
  line.number(r.heading_deg).number(truth.distance_m).flag(truth.los).end();
}

constexpr const char* k_fix_header =
    "id,t_us,mission,seq,lon,lat,h_m,x_m,y_m,z_m,fix,sigma_e_m,sigma_n_m,sigma_u_m,correction_age_s,"
    "satellites\r\n";
void append_fix_csv(std::string& out, const Fix& f, std::int64_t id) {
  CsvLine line(out);
  line.whole(id).whole(f.time.us()).word(to_string(f.mission)).whole(f.seq);
  if (f.frame == TrackFrame::wgs84)
    line.number(f.position.lon_deg).number(f.position.lat_deg).number(f.position.height_m).nothing(3);
  else
    line.nothing(3).number(f.local_m.x()).number(f.local_m.y()).number(f.local_m.z());
  line.word(k_fix_words.word(f.fix));
  if (f.covariance_m2)
    for (int i = 0; i < 3; ++i) line.number(std::sqrt(std::max(0.0, (*f.covariance_m2)(i, i))));
  else
    line.nothing(3);
  line.number(f.correction_age_s).whole(f.satellites).end();
}

constexpr std::size_t k_stream_page = 1000;

/// Streams every page that matches (or `limit` rows where asked for); memory is one page. The first is read
/// before the status is sent, so that a flight that is not there is 404 as in JSON.
template <class Fetch, class Write>
Response stream(const Request& request, MeasurementStore::Filter filter, std::string type, std::string header,
                Fetch fetch, Write write) {
  using Page = std::decay_t<decltype(fetch(filter).value())>;
  struct Progress {
    MeasurementStore::Filter filter;
    std::string header;
    std::size_t left;
    std::optional<Page> first{};
    bool done{false};
  };
  const bool limited = request.query_value("limit").has_value();
  const std::size_t most = limited ? filter.limit : SIZE_MAX;
  filter.limit = std::min(k_stream_page, most);
  auto first = value_or_problem(fetch(filter));
  auto state =
      std::make_shared<Progress>(Progress{std::move(filter), std::move(header), most, std::move(first)});
  Response response;
  response.header("Content-Type", std::move(type));
  response.body_stream = [state, fetch, write]() -> std::string {
    std::string out = std::exchange(state->header, {});
    if (!out.empty() || state->done) return out;
    // A page of a class may be empty and yet not the last: an empty answer here would be the end.
    while (out.empty() && !state->done) {
      auto page = std::exchange(state->first, std::nullopt);
      if (!page) {
        state->filter.limit = std::min(k_stream_page, state->left);
        auto fetched = fetch(state->filter);
        // The status is sent already; an early end is all that can still be told.
        if (!fetched) throw BodyError(503, fetched.error().message);
        page = std::move(fetched).value();
      }
      for (std::size_t i = 0; i < page->rows.size(); ++i) write(out, page->rows[i], page->ids[i]);
      state->left -= page->rows.size();
      state->filter.after = page->next;
      state->done = page->next.empty() || state->left == 0;
    }
    return out;
  };
  return response;
}

/// How a row is written: as a member of a list, and as a line of text.
template <class Row>
struct Writers {
  std::function<Ordered(const Row&, std::int64_t id)> json;
  std::function<void(std::string&, const Row&, std::int64_t id)> ndjson, csv;
  const char* csv_header;
};

template <class Row, class Fetch>
Response rows(const Request& request, MeasurementStore::Filter filter, Fetch fetch, Writers<Row> writers,
              std::optional<std::uint64_t> total = std::nullopt) {
  const std::string format = negotiate(request, {"json", "ndjson", "csv"});
  if (format == "csv")
    return stream(request, filter, "text/csv; charset=utf-8", writers.csv_header, fetch, writers.csv);
  if (format == "ndjson")
    return stream(request, filter, "application/x-ndjson", "", fetch,
                  [write = writers.ndjson](std::string& out, const Row& row, std::int64_t id) {
                    write(out, row, id);
                    out += '\n';
                  });
  const auto page = value_or_problem(fetch(filter));
  Ordered items = Ordered::array();
  for (std::size_t i = 0; i < page.rows.size(); ++i) items.push_back(writers.json(page.rows[i], page.ids[i]));
  return list_response(request, std::move(items), page.next, total);
}

/// One page of what the promoted models call `wanted`: they are asked row by row, since nothing of theirs is
/// stored.
Result<MeasurementStore::Page<Range>> classed(MeasurementStore& store, const ModelRegistry::Active& active,
                                              PredictedClass wanted, MeasurementStore::Filter filter) {
  const std::size_t limit = filter.limit;
  MeasurementStore::Page<Range> out;
  for (std::size_t looked = 0; out.rows.size() < limit && looked < k_class_scan_max;) {
    filter.limit = limit - out.rows.size();
    BOOST_OUTCOME_TRY(auto page, store.ranges(filter));
    looked += page.rows.size();
    for (std::size_t i = 0; i < page.rows.size(); ++i) {
      if (class_of(ModelRegistry::predict(active, features_of(page.rows[i]))) != wanted) continue;
      out.rows.push_back(std::move(page.rows[i]));
      out.ids.push_back(page.ids[i]);
    }
    out.next = filter.after = std::move(page.next);
    if (out.next.empty()) break;
  }
  return out;
}

Response list_ranges(MeasurementApi& s, const Request& request) {
  check_query(
      request,
      {"limit",         "cursor",        "fields", "format", "mission",  "anchor",         "tag",
       "since",         "until",         "sort",   "cir",    "features", "min_distance_m", "max_distance_m",
       "min_level_dbm", "max_level_dbm", "label",  "fix",    "class",    "predicted",      "every",
       "count"});
  const bool with_cir = query_flag(request, "cir"), with_features = query_flag(request, "features");
  auto filter = filter_of(request, s.measurements);
  filter.limits = query_limits(request);
  filter.fix = query_word(request, "fix", k_fix_words);
  filter.every = query_every(request);
  const auto wanted = query_class(request);
  std::optional<std::uint64_t> total;
  if (const auto count = request.query_value("count")) {
    if (*count != "exact" || wanted)
      throw_problem(422, "validation", "only stored values are counted",
                    {{"/count", "unknown_value", "must be exact, and cannot be combined with class"}});
    total = value_or_problem(s.measurements.count_ranges(filter));
  }
  const bool judged = wanted || query_flag(request, "predicted");
  const auto active = judged ? s.models.active() : std::make_shared<const ModelRegistry::Active>();
  filter.with_cir = with_cir || with_features || (judged && active->needs_cir);
  const auto asked = [with_features, judged, active](const Range& row) {
    Ordered out = Ordered::object();
    if (!with_features && !judged) return out;
    const auto features = features_of(row);
    if (with_features) out["features"] = features_json(features);
    if (judged) out["predicted"] = predicted_json(ModelRegistry::predict(*active, features));
    return out;
  };
  return rows<Range>(
      request, std::move(filter),
      [&store = s.measurements, active, wanted](const MeasurementStore::Filter& page) {
        return wanted ? classed(store, *active, *wanted, page) : store.ranges(page);
      },
      {[with_cir, asked](const Range& row, std::int64_t id) {
         Ordered json = range_json(row, id);
         json.update(asked(row));
         if (!with_cir) json.erase("cir");
         return json;
       },
       [with_cir, asked](std::string& out, const Range& row, std::int64_t id) {
         append_range(out, row, id, with_cir, asked(row));
       },
       append_range_csv, k_range_header},
      total);
}

Response list_fixes(MeasurementApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "format", "mission", "since", "until", "sort"});
  return rows<Fix>(
      request, filter_of(request, s.measurements),
      [&store = s.measurements](const MeasurementStore::Filter& filter) { return store.fixes(filter); },
      {[](const Fix& row, std::int64_t id) { return fix_json(row, id); },
       [](std::string& out, const Fix& row, std::int64_t id) { append_fix(out, row, id); }, append_fix_csv,
       k_fix_header});
}

Range one_range(MeasurementApi& s, const Request& request) {
  const auto& text = request.params.at("id");
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size())
    throw_problem(404, "not-found", "there is no such range");
  return value_or_problem(s.measurements.range(id));
}

Response range_cir(MeasurementApi& s, const Request& request) {
  check_query(request, {"format"});
  const Range range = one_range(s, request);
  if (!range.cir) throw_problem(404, "not-found", "this range has no impulse response");
  if (negotiate(request, {"json", "binary"}) == "json") return json_response(200, cir_json(*range.cir));
  Response response;
  response.header("Content-Type", "application/octet-stream");
  response.body = cir_bytes(*range.cir);
  return response;
}

Response demonstrate(MeasurementApi& s, const Request& request) {
  check_query(request, {});
  const auto body = json_body(request, true);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const double speed = fields.number("speed", 1, 20).value_or(1);
  fields.finish();
  refuse_if_any(errors);
  const Mission mission = value_or_problem(s.demonstration.start(speed));
  s.audit(request, "demonstration.start " + to_string(mission.id));
  Response response = json_response(202, Ordered{{"mission", to_string(mission.id)}});
  response.header("Location", "/api/v1/missions/" + to_string(mission.id));
  return response;
}

}  // namespace

void add_measurement_routes(Router& router, MeasurementApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto ingest = [&router](const char* path, Handler handler) {
    router.add(keeps_always({Method::post, path, Access::any_of({Role::gateway}), std::move(handler),
                             IngestService::k_max_body_bytes, true}));
  };
  ingest("/api/v1/ranges", [&s](const Request& request) { return s.ingest.ranges(request); });
  ingest("/api/v1/fixes", [&s](const Request& request) { return s.ingest.fixes(request); });
  router.add(as_heavy({Method::get, "/api/v1/ranges", readers(), on(list_ranges)}));
  router.add({Method::get, "/api/v1/ranges/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                std::int64_t id = 0;
                const auto& text = request.params.at("id");
                const Range range = one_range(s, request);
                std::from_chars(text.data(), text.data() + text.size(), id);
                Ordered json = range_json(range, id);
                json["features"] = features_json(features_of(range));
                return json_response(200, json);
              }});
  router.add({Method::get, "/api/v1/ranges/{id}/cir", readers(), on(range_cir)});
  router.add(as_heavy({Method::post, "/api/v1/demonstration", Access::any_of({Role::op}), on(demonstrate)}));
  router.add(as_heavy({Method::get, "/api/v1/fixes", readers(), on(list_fixes)}));
}

}  // namespace anchord::api
