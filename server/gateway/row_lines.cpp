#include "server/gateway/row_lines.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <utility>

#include "api/measurements/flight_requests.hpp"

namespace anchord::gateway {
namespace {

// Columns of docs/formats.md; the mission is named once, in the address of the request.
constexpr std::string_view k_fix_columns =
    "t_us,received_us,seq,lon,lat,h_m,x_m,y_m,z_m,fix,cov_ee_m2,cov_en_m2,cov_eu_m2,cov_nn_m2,cov_nu_m2,"
    "cov_uu_m2,qx,qy,qz,qw,correction_age_s,satellites\n";
constexpr std::string_view k_range_columns =
    "t_us,received_us,seq,kind,tag,antenna,anchor,distance_m,rss_dbm,fp_dbm,rx_dbm,std_noise,heading_deg\n";

/// One line of comma-separated cells. Numbers are the shortest text that reads back as the same.
class Line {
 public:
  explicit Line(std::string& out) : out_(out) {}
  template <class Number>
  Line& number(Number value) {
    begin();
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    out_.append(text, end);
    return *this;
  }
  template <class Number>
  Line& number(const std::optional<Number>& value) {
    return value ? number(*value) : nothing();
  }
  Line& word(std::string_view text) {
    begin();
    out_ += text;
    return *this;
  }
  Line& nothing(int cells = 1) {
    for (; cells > 0; --cells) begin();
    return *this;
  }
  void end() { out_ += '\n'; }

 private:
  void begin() {
    if (!std::exchange(first_, false)) out_ += ',';
  }
  std::string& out_;
  bool first_{true};
};

template <class Row>
Line& when(Line& line, const Row& row) {
  line.number(row.time.us());
  row.received ? line.number(row.received->us()) : line.nothing();
  return line.number(row.seq);
}

void append_csv(std::string& out, const Fix& fix) {
  Line line(out);
  when(line, fix);
  if (fix.frame == TrackFrame::wgs84)
    line.number(fix.position.lon_deg).number(fix.position.lat_deg).number(fix.position.height_m).nothing(3);
  else
    line.nothing(3).number(fix.local_m.x()).number(fix.local_m.y()).number(fix.local_m.z());
  line.word(k_fix_words.word(fix.fix));
  if (const auto& c = fix.covariance_m2)
    line.number((*c)(0, 0))
        .number((*c)(0, 1))
        .number((*c)(0, 2))
        .number((*c)(1, 1))
        .number((*c)(1, 2))
        .number((*c)(2, 2));
  else
    line.nothing(6);
  if (const auto& q = fix.enu_from_body)
    line.number(q->x()).number(q->y()).number(q->z()).number(q->w());
  else
    line.nothing(4);
  line.number(fix.correction_age_s).number(fix.satellites).end();
}

void append_csv(std::string& out, const Range& range) {
  Line line(out);
  when(line, range);
  line.word(range.kind == RangeKind::tag_anchor ? "" : k_range_kind_words.word(range.kind));
  line.word(to_string(range.tag)).number(static_cast<int>(range.antenna)).word(to_string(range.anchor));
  line.number(range.distance_m).number(range.rss_dbm).number(range.fp_dbm).number(range.rx_dbm);
  line.number(range.std_noise).number(range.heading_deg).end();
}

Lines lines_of(const Fix&) { return Lines::fixes_csv; }
Lines lines_of(const Range& range) {
  return range.cir || range.truth ? Lines::ranges_ndjson : Lines::ranges_csv;
}
void append(std::string& out, Lines, const Fix& fix) { append_csv(out, fix); }
void append(std::string& out, Lines lines, const Range& range) {
  lines == Lines::ranges_csv ? append_csv(out, range) : api::append_ndjson(out, range);
}

template <class Row>
void gather(const std::vector<Row>& rows, std::vector<Batch>& out) {
  for (const auto& row : rows) {
    const auto lines = lines_of(row);
    auto at = std::ranges::find_if(
        out, [&](const Batch& b) { return b.mission == row.mission && b.lines == lines; });
    if (at == out.end()) at = out.insert(at, Batch{{}, row.mission, lines, 0, row.time, {}});
    append(at->body, lines, row);
    ++at->n_rows;
    at->newest = std::max(at->newest, row.time);
  }
}

}  // namespace

std::vector<Batch> batches_of(const DeviceBatch& rows) {
  std::vector<Batch> out;
  gather(rows.fixes, out);
  gather(rows.ranges, out);
  return out;
}

std::string_view header_of(Lines lines) {
  switch (lines) {
    case Lines::fixes_csv:
      return k_fix_columns;
    case Lines::ranges_csv:
      return k_range_columns;
    case Lines::ranges_ndjson:
      break;
  }
  return {};
}

std::string_view content_type_of(Lines lines) {
  return lines == Lines::ranges_ndjson ? "application/x-ndjson" : "text/csv";
}

std::string target_of(Lines lines, const MissionId& mission) {
  return (lines == Lines::fixes_csv ? "/api/v1/fixes?mission=" : "/api/v1/ranges?mission=") +
         to_string(mission);
}

}  // namespace anchord::gateway
