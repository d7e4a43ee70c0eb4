#include "server/gateway/delivery.hpp"

#include <algorithm>

#include "server/gateway/row_lines.hpp"

namespace anchord::gateway {
namespace {

void append_lines(std::string_view body, std::vector<std::string_view>& out) {
  while (!body.empty()) {
    const auto end = std::min(body.find('\n'), body.size());
    if (end > 0) out.push_back(body.substr(0, end));
    body.remove_prefix(std::min(end + 1, body.size()));
  }
}

std::string body_of(Lines lines, std::span<const std::string_view> rows) {
  std::string out(header_of(lines));
  for (const auto row : rows) {
    out += row;
    out += '\n';
  }
  return out;
}

Assessment stays(Link link, std::string why) { return {Then::wait, link, std::move(why), std::nullopt, {}}; }
Assessment settled() { return {Then::settled, Link::up, {}, std::nullopt, {}}; }

}  // namespace

struct Delivery::Tally {
  std::uint64_t accepted{}, duplicates{}, repeated{};
  std::vector<RejectedRow> rejected;
};

Assessment Delivery::send(std::span<const Batch> batches) {
  const Batch& first = batches.front();
  std::vector<std::string_view> rows;
  for (const auto& batch : batches) append_lines(batch.body, rows);
  Tally tally;
  if (auto outcome = send_rows(first, rows, tally); outcome.then != Then::settled) return outcome;
  if (!tally.rejected.empty()) {
    // Before they leave the outbox: killed between the two, a row is named twice and never lost.
    if (const auto written = rejected_.append(tally.rejected, clock_.now()); !written)
      return stays(Link::up, "rejected rows cannot be written to the file: " + written.error().message);
  }
  Delivered delivered{{},
                      tally.accepted,
                      tally.duplicates - std::min(tally.duplicates, tally.repeated),
                      tally.rejected.size()};
  for (const auto& batch : batches) delivered.ids.push_back(batch.id);
  (void)outbox_.delivered(delivered);
  return settled();
}

Assessment Delivery::send_rows(const Batch& of, std::span<const std::string_view> rows, Tally& tally) {
  const auto answer =
      post_(target_of(of.lines, of.mission), content_type_of(of.lines), body_of(of.lines, rows));
  if (!answer) return stays(Link::lost, answer.error().message);
  auto outcome =
      assess(answer.value().status, answer.value().headers, answer.value().body, rows.size(), clock_.now());
  if (outcome.then != Then::settled && outcome.then != Then::halve) return outcome;
  const auto& report = outcome.report;
  const std::uint64_t before = header_of(of.lines).empty() ? 1 : 2;  // the line of the first row
  if (outcome.then == Then::settled && !report.truncated) {
    tally.accepted += report.accepted;
    tally.duplicates += report.duplicates;
    for (const auto& error : report.errors) {
      const auto at = error.line - before;
      if (at < rows.size())
        tally.rejected.push_back({of.mission, of.lines, std::string(rows[at]), error.code, error.detail});
    }
    return outcome;
  }
  if (rows.size() == 1) {
    tally.rejected.push_back({of.mission, of.lines, std::string(rows[0]), "refused", outcome.why});
    return settled();
  }
  // Which rows were rejected is not all said, or the whole was refused: each half tells more. What was taken
  // now will be a duplicate then.
  tally.accepted += report.accepted;
  tally.repeated += report.accepted;
  const auto half = rows.size() / 2;
  if (auto first = send_rows(of, rows.first(half), tally); first.then != Then::settled) return first;
  return send_rows(of, rows.subspan(half), tally);
}

std::vector<std::vector<Batch>> grouped(std::vector<Batch> batches) {
  std::ranges::stable_sort(batches, [](const Batch& a, const Batch& b) {
    return std::pair(a.mission, a.lines) < std::pair(b.mission, b.lines);
  });
  std::vector<std::vector<Batch>> out;
  for (auto& batch : batches) {
    if (out.empty() || out.back().front().mission != batch.mission || out.back().front().lines != batch.lines)
      out.emplace_back();
    out.back().push_back(std::move(batch));
  }
  return out;
}

}  // namespace anchord::gateway
