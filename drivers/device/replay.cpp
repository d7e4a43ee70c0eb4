#include "drivers/device/replay.hpp"

#include <fstream>
#include <iterator>
#include <optional>

#include "drivers/device/pipeline.hpp"
#include "drivers/record/recorder.hpp"

namespace anchord::device {
namespace {

class Sink final : public PipelineSink {
 public:
  explicit Sink(const ReplayRows& rows) : rows_(rows) {}
  void send(std::uint16_t, std::string_view) override {}  // nobody is at the other end
  void fix(std::uint16_t, const Fix& fix) override {
    ++summary.fixes;
    keep(rows_.fix(fix));
  }
  void range(std::uint16_t, const Range& range) override {
    ++summary.ranges;
    keep(rows_.range(range));
  }
  void rover(std::uint16_t, const RoverStatus&) override {}
  void identified(std::uint16_t, const Identity&) override {}
  void heard(std::uint16_t) override {}
  void dropped(std::uint16_t, std::string_view reason, std::uint64_t n) override {
    summary.dropped[std::string(reason)] += n;
  }
  void answer(std::uint16_t, std::uint64_t, const Result<std::string>&) override {}
  void hang_up(std::uint16_t, std::string_view, std::int64_t) override {}

  ReplaySummary summary;
  std::optional<Error> error{};

 private:
  void keep(const Result<void>& done) {
    if (!done && !error) error = done.error();
  }
  const ReplayRows& rows_;
};

}  // namespace

Result<ReplaySummary> replay(const std::filesystem::path& file, const ReplayRows& rows) {
  Sink sink(rows);
  Pipeline pipeline(sink);
  BOOST_OUTCOME_TRY(const auto parts, record::parts_of(file));
  for (const auto& part : parts) {
    std::ifstream in(part, std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    record::EventReader reader(text);
    if (!in || !reader.begin()) return make_error(Errc::bad_frame, part.string() + " is no recording");
    while (const auto event = reader.next()) {
      ++sink.summary.events;
      // What the live pipeline refused it refuses again; that is part of the recording.
      (void)pipeline.take(*event);
      if (sink.error) return *sink.error;
    }
    sink.summary.unreadable_bytes += reader.left();
  }
  return sink.summary;
}

bool is_recording(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string head(record::k_magic.size(), '\0');
  return in.read(head.data(), static_cast<std::streamsize>(head.size())) && head == record::k_magic;
}

}  // namespace anchord::device
