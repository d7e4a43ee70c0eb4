#include "drivers/gnss/decoder.hpp"

namespace anchord::gnss {

Decoder::Decoder(const DecoderOptions& options)
    : framer_(options.only, skips_), nmea_(options.gst_order), llh_(options.llh_time) {
  if (options.reference) nmea_.set_reference(*options.reference);
}

void Decoder::feed(std::string_view bytes, Epochs& out) {
  fed_ += bytes.size();
  framer_.feed(bytes, [&](const Frame& frame) { take(frame, out); });
}

void Decoder::finish(Epochs& out) {
  framer_.finish([&](const Frame& frame) { take(frame, out); });
  ubx_.finish(out);
  count_without_pvt(fed_);
  erb_.finish(out);
  gpsd_.finish(out);
  if (!out.empty()) {
    const Epoch& last = out.back();
    if (last.time && last.protocol != Protocol::nmea) nmea_.set_reference(*last.time);
  }
  nmea_.finish(out);
}

void Decoder::quiet(Epochs& out) {
  ubx_.finish(out);
  erb_.finish(out);
  gpsd_.finish(out);
  nmea_.quiet(out);
}

template <class Parsed, class Assembler>
void Decoder::take_binary(const Parsed& parsed, Assembler& assembler, const Frame& frame, const char* reason,
                          Epochs& out) {
  if (!parsed) return skips_.count(reason, frame.offset, parsed.error().message);
  const auto before = out.size();
  assembler.add(parsed.value(), out);
  // A receiver that speaks both on one wire tells NMEA the date.
  for (std::size_t i = before; i < out.size(); ++i) {
    const Epoch& epoch = out[i];
    if (epoch.time) nmea_.set_reference(*epoch.time);
  }
}

void Decoder::take(const Frame& frame, Epochs& out) {
  switch (frame.protocol) {
    case Protocol::nmea:
      return take_nmea(frame, out);
    case Protocol::ubx:
      good(frame);
      take_binary(ubx::parse(frame.bytes), ubx_, frame, "ubx: payload not readable", out);
      return count_without_pvt(frame.offset);
    case Protocol::erb:
      good(frame);
      return take_binary(erb::parse(frame.bytes), erb_, frame, "erb: payload not readable", out);
    case Protocol::llh:
      return take_llh(frame, out);
    case Protocol::gpsd:
      return take_gpsd(frame, out);
  }
}

/// The first of its kind is told whole: what is wrong, and the text of it.
void Decoder::skip(std::string_view reason, const Frame& frame, const Error& why) {
  const bool first = skips_[reason] == 0;
  skips_.count(reason, frame.offset, first ? why.message + ": " + std::string(frame.bytes) : std::string());
}

void Decoder::take_nmea(const Frame& frame, Epochs& out) {
  good(frame);
  const auto message = nmea::parse(frame.bytes);
  if (!message) return skip("nmea: field not readable", frame, message.error());
  const auto* gns = std::get_if<nmea::Gns>(&message.value());
  const auto* gga = gns ? gns : std::get_if<nmea::Gga>(&message.value());
  if (gga && gga->quality.value_or(0) > 5) {
    skips_.count("nmea: quality 6 to 9, dead reckoning or not measured", frame.offset, frame.bytes);
  }
  if (!nmea_.add(message.value(), out)) skips_.count("nmea: same time again", frame.offset, frame.bytes);
}

void Decoder::take_llh(const Frame& frame, Epochs& out) {
  const auto line = llh_.line(frame.bytes);
  if (!line) {
    const bool form = line.error().code == Errc::unsupported;
    return skip(form ? "llh: no WGS84 position" : "llh: line not readable", frame, line.error());
  }
  good(frame);
  if (const auto& epoch = line.value()) out.push_back(*epoch);
}

void Decoder::take_gpsd(const Frame& frame, Epochs& out) {
  const auto done = gpsd_.line(frame.bytes, out);
  if (!done) {
    const bool timeless = done.error().code == Errc::unsupported;
    return skip(timeless ? "gpsd: position without a time" : "gpsd: line not readable", frame, done.error());
  }
  good(frame);
}

void Decoder::count_without_pvt(std::uint64_t offset) {
  const auto now = ubx_.without_pvt();
  if (now > without_pvt_)
    skips_.count("ubx: position without NAV-PVT, which gives the fix", offset, {}, now - without_pvt_);
  without_pvt_ = now;
}

}  // namespace anchord::gnss
