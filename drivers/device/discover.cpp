#include "drivers/device/discover.hpp"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <memory>

#include "drivers/gnss/decoder.hpp"
#include "drivers/link/byte_link.hpp"
#include "drivers/link/serial_port.hpp"

namespace anchord::device {
namespace {

/// One port being listened to.
struct Ear {
  Candidate candidate;
  std::unique_ptr<link::ByteLink> link;
  gnss::Decoder decoder;
  gnss::Epochs epochs;
  std::string heard, why;
  std::uint64_t bytes{0};
};

/// Of the names udev builds from maker and product.
bool looks_like_pozyx(const std::string& address) {
  return address.find("Pozyx") != std::string::npos || address.find("pozyx") != std::string::npos;
}

void judge(Ear& ear) {
  auto& out = ear.candidate;
  for (const auto p : {gnss::Protocol::ubx, gnss::Protocol::erb, gnss::Protocol::llh, gnss::Protocol::gpsd,
                       gnss::Protocol::nmea}) {
    const auto n = ear.decoder.frames(p);
    // Text lines have no checksum: one that could be LLH or JSON proves nothing, a gpsd's greeting does.
    const bool sure =
        n > 0 && (p != gnss::Protocol::llh || n > 1) &&
        (p != gnss::Protocol::gpsd || ear.heard.find("\"class\":\"VERSION\"") != std::string::npos);
    if (!sure) continue;
    out.kind = "gnss";
    out.evidence = std::string(gnss::to_string(p)) + ", " + std::to_string(n) + " frames";
    return;
  }
  if (looks_like_pozyx(out.address)) {
    out.kind = "pozyx";
    out.evidence = "identified by its USB name";
    return;
  }
  out.evidence = !ear.why.empty() ? ear.why
                 : ear.bytes > 0  ? std::to_string(ear.bytes) +
                                       " bytes that no driver can read: is the baud rate another one?"
                                 : "open, but nothing was received";
}

}  // namespace

std::vector<Candidate> discover(const std::vector<std::string>& ours, const DiscoverOptions& options) {
  boost::asio::io_context io;
  std::vector<std::unique_ptr<Ear>> ears;
  std::vector<std::string> addresses;
  for (const auto& port : link::list_serial_ports(options.by_id_folder, options.dev_folder)) {
    addresses.push_back("serial:" + port.path);
  }
  const auto n_serial = addresses.size();
  addresses.insert(addresses.end(), options.also.begin(), options.also.end());
  for (const auto& text : addresses) {
    auto ear = std::make_unique<Ear>();
    ear->candidate.address = text;
    const auto own = [&](const std::string& o) { return o.substr(0, o.find('?')) == text; };
    ear->candidate.configured = std::any_of(ours.begin(), ours.end(), own);
    if (const auto address = link::parse_address(text); address && !ear->candidate.configured) {
      ear->link = link::make_link(io, address.value());
      auto* e = ear.get();
      ear->link->open({[] {},
                       [e](std::string_view bytes, const link::Arrival&) {
                         e->bytes += bytes.size();
                         if (e->heard.size() < 4096) e->heard += bytes.substr(0, 4096 - e->heard.size());
                         e->decoder.feed(bytes, e->epochs);
                         e->epochs.clear();
                       },
                       [e](const Error& why) { e->why = why.message; }});
    }
    ears.push_back(std::move(ear));
  }
  io.run_for(std::chrono::milliseconds(options.listen_ms));
  std::vector<Candidate> out;
  for (std::size_t i = 0; i < ears.size(); ++i) {
    auto& ear = *ears[i];
    if (ear.candidate.configured) {
      ear.candidate.evidence = "is already configured";
    } else {
      judge(ear);
      if (i >= n_serial && ear.candidate.kind.empty()) continue;  // a service that is not there is no news
    }
    out.push_back(std::move(ear.candidate));
  }
  return out;
}

}  // namespace anchord::device
