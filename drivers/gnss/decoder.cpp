#include "drivers/gnss/decoder.hpp"

namespace anchord::gnss {

Decoder::Decoder(const DecoderOptions& options) : framer_(options.only, skips_), nmea_(options.gst_order) {
  if (options.reference) nmea_.set_reference(*options.reference);
}

void Decoder::feed(std::string_view bytes, Epochs& out) {
  framer_.feed(bytes, [&](const Frame& frame) { take(frame, out); });
}

void Decoder::finish(Epochs& out) {
  framer_.finish([&](const Frame& frame) { take(frame, out); });
  ubx_.finish(out);
  erb_.finish(out);
  gpsd_.finish(out);
  if (!out.empty() && out.back().time && out.back().protocol != Protocol::nmea)
    nmea_.set_reference(*out.back().time);
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
    if (out[i].time) nmea_.set_reference(*out[i].time);
  }
}

void Decoder::take(const Frame& frame, Epochs& out) {
  ++frames_[static_cast<std::size_t>(frame.protocol)];
  switch (frame.protocol) {
    case Protocol::nmea: {
      const auto message = nmea::parse(frame.bytes);
      if (!message) return skips_.count("nmea: field not readable", frame.offset, frame.bytes);
      if (!nmea_.add(message.value(), out)) skips_.count("nmea: same time again", frame.offset, frame.bytes);
      return;
    }
    case Protocol::ubx:
      return take_binary(ubx::parse(frame.bytes), ubx_, frame, "ubx: payload not readable", out);
    case Protocol::erb:
      return take_binary(erb::parse(frame.bytes), erb_, frame, "erb: payload not readable", out);
    case Protocol::llh: {
      auto epoch = llh_.line(frame.bytes);
      if (!epoch) {
        const bool form = epoch.error().code == Errc::unsupported;
        return skips_.count(form ? "llh: ECEF or baseline form" : "llh: line not readable", frame.offset,
                            frame.bytes);
      }
      if (epoch.value()) out.push_back(*epoch.value());
      return;
    }
    case Protocol::gpsd:
      if (const auto done = gpsd_.line(frame.bytes, out); !done) {
        skips_.count("gpsd: line not readable", frame.offset, frame.bytes);
      }
      return;
  }
}

}  // namespace anchord::gnss
