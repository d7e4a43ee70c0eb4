#include "drivers/mqtt/subscriber.hpp"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::mqtt {
namespace {

constexpr std::int64_t k_s = 1'000'000'000;
constexpr std::int64_t k_answer_ns = 10 * k_s;
/// The supervisor calls a device silent after 2 s: a broker that has nothing to say answers a ping before.
constexpr std::int64_t k_ping_ns = 3 * k_s / 2;
constexpr std::uint16_t k_keep_alive_s = 15, k_subscription = 1;
constexpr std::size_t k_most_topic = 65'535 + 4;
constexpr std::string_view k_pozyx_topics = "tags/#";

std::optional<std::string> first_line(const std::string& file) {
  std::ifstream in(file);
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  if (line.ends_with('\r')) line.pop_back();
  return line;
}

/// Section 3.2.2.3.
std::string refusal(unsigned code) {
  switch (code) {
    case 1:
      return "the broker does not support MQTT 3.1.1";
    case 2:
      return "the broker rejects the client id";
    case 3:
      return "the broker is not available";
    case 4:
      return "the broker rejects the user or the password";
    case 5:
      return "the broker does not authorize this connection: check user and password";
    default:
      return "the broker rejects the connection with code " + std::to_string(code);
  }
}

}  // namespace

Subscriber::Subscriber(SubscriberOptions options, device::DriverOutput& output)
    : options_(std::move(options)),
      out_(output),
      reader_(mapping::Decoder::k_most_bytes + k_most_topic),
      decoder_(std::in_place_type<PozyxPositions>, output) {
  if (options_.mapping) decoder_.emplace<mapping::Decoder>(*options_.mapping, output);
}

void Subscriber::opened(const device::Arrival& now) {
  reader_.clear();
  first_ = true;
  state_ = State::connecting;
  deadline_ns_ = now.steady_ns + k_answer_ns;
  Login login{options_.client_id, options_.user, std::nullopt, k_keep_alive_s};
  if (!options_.password_file.empty()) {
    login.password = first_line(options_.password_file);
    if (!login.password)
      return refuse("the file of the password cannot be read: send the password again", 30);
  }
  out_.send(connect_packet(login));
}

void Subscriber::refuse(const std::string& why, std::int64_t wait_s) {
  state_ = State::refused;
  deadline_ns_.reset();
  out_.hang_up(why, wait_s * k_s);
}

void Subscriber::bytes(std::string_view bytes, const device::Arrival& at) {
  if (state_ == State::closed || state_ == State::refused || bytes.empty()) return;
  // What else speaks first would be waited for as if it were a long packet.
  if (std::exchange(first_, false) &&
      static_cast<PacketType>(static_cast<unsigned char>(bytes[0]) >> 4) != PacketType::connack)
    return refuse("this is not an MQTT broker", 30);
  const auto taken = reader_.take(
      bytes, [&](const Packet& one) { packet(one, at); }, [&] { out_.dropped("too_large"); });
  if (!taken && state_ != State::refused) refuse(taken.error().message, 5);
}

void Subscriber::packet(const Packet& one, const device::Arrival& at) {
  if (state_ == State::refused) return;
  last_ns_ = at.steady_ns;
  switch (one.type) {
    case PacketType::connack:
      return accepted(one, at);
    case PacketType::suback:
      if (one.body.size() != 3 || one.body[2] != 0)
        return refuse("the broker rejects the subscription to \"" + options_.topic + '"', 30);
      state_ = State::live;
      deadline_ns_ = at.steady_ns + k_ping_ns;
      return out_.heard();
    case PacketType::publish:
      return message(one, at);
    case PacketType::pingresp:
      return out_.heard();
    case PacketType::connect:
    case PacketType::puback:
    case PacketType::subscribe:
    case PacketType::pingreq:
    case PacketType::disconnect:
      break;
  }
  refuse(
      "a packet of type " + std::to_string(static_cast<unsigned>(one.type)) + ", which a broker never sends",
      5);
}

void Subscriber::accepted(const Packet& one, const device::Arrival& at) {
  if (state_ != State::connecting || one.body.size() != 2) return refuse("this is not an MQTT broker", 30);
  const auto code = static_cast<unsigned char>(one.body[1]);
  if (code != 0) return refuse(refusal(code), 30);
  device::Identity identity;
  identity.model = options_.mapping ? "ranges from MQTT" : "Pozyx positions from MQTT";
  out_.identified(identity);
  state_ = State::subscribing;
  deadline_ns_ = at.steady_ns + k_answer_ns;
  out_.send(subscribe_packet(k_subscription, options_.topic));
}

void Subscriber::message(const Packet& one, const device::Arrival& at) {
  const auto message = message_of(one);
  if (!message) return refuse(message.error().message, 5);
  const auto& m = message.value();
  if (m.qos == 2) return refuse("a message of QoS 2, which was not requested", 5);
  if (m.qos == 1) out_.send(puback_packet(m.id));
  if (m.retained) return out_.dropped("retained");
  if (auto* ranges = std::get_if<mapping::Decoder>(&decoder_))
    ranges->message(m.payload, m.topic, at);
  else
    std::get<PozyxPositions>(decoder_).message(m.payload, at);
}

void Subscriber::tick(const device::Arrival& now) {
  if (!deadline_ns_ || now.steady_ns < *deadline_ns_) return;
  if (state_ == State::connecting) return refuse("no answer: is this an MQTT broker, without TLS?", 5);
  if (state_ == State::subscribing) return refuse("no answer to the subscription", 5);
  if (now.steady_ns - last_ns_ > k_answer_ns) return refuse("the broker no longer answers", 1);
  out_.send(ping_packet());
  deadline_ns_ = now.steady_ns + k_ping_ns;
}

void Subscriber::closed(const device::Arrival&) {
  state_ = State::closed;
  deadline_ns_.reset();
  if (auto* ranges = std::get_if<mapping::Decoder>(&decoder_)) ranges->closed();
}

void Subscriber::command(const device::Command& command, const device::Arrival&) {
  const auto* positions = std::get_if<PozyxPositions>(&decoder_);
  if (command.name == "positions" && positions != nullptr) return out_.answer(command.id, positions->json());
  out_.answer(command.id,
              make_error(Errc::unsupported,
                         positions != nullptr ? "a Pozyx position stream supports only the command positions"
                                              : "a device of ranges from MQTT does not support commands"));
}

Result<std::unique_ptr<device::Driver>> make_subscriber(std::string_view options_json,
                                                        std::string_view device_id,
                                                        device::DriverOutput& output) {
  using Json = nlohmann::json;
  const auto bad = [](std::string_view option, std::string_view why) {
    return make_error(Errc::invalid_argument, std::string(option) + ": " + std::string(why));
  };
  const auto options = Json::parse(options_json.begin(), options_json.end(), nullptr, false);
  SubscriberOptions out;
  bool pozyx = false;
  std::string topic;
  for (const auto& [key, value] : options.items()) {
    const bool text = value.is_string() && value.get_ref<const std::string&>().size() <= 1000;
    if (key == "format") {
      if (value != "mapping" && value != "pozyx") return bad(key, "must be one of mapping, pozyx");
      pozyx = value == "pozyx";
    } else if (key == "mapping") {
      BOOST_OUTCOME_TRY(out.mapping, mapping::parse_mapping(to_wire(value)));
    } else if (key == "topic") {
      topic = text ? value.get<std::string>() : "";
      if (const auto wrong = mapping::wrong_filter(topic); !wrong.empty()) return bad(key, wrong);
    } else if (key == "user") {
      if (!text) return bad(key, "must be a name");
      out.user = value.get<std::string>();
    } else if (key == "password_file") {
      if (!text) return bad(key, "must be a path");
      out.password_file = value.get<std::string>();
    } else {
      return bad(key, "no such option: an mqtt device has format, mapping, topic, user, password");
    }
  }
  if (pozyx && out.mapping)
    return bad("mapping", "the format pozyx has a mapping of its own: remove one of the two");
  if (!pozyx && !out.mapping)
    return bad("mapping", "is needed: an object that gives the place of each value");
  if (!out.password_file.empty() && out.user.empty()) return bad("user", "a password needs a user");
  out.topic = !topic.empty() ? topic : out.mapping ? out.mapping->topic : std::string(k_pozyx_topics);
  if (out.topic.empty()) return bad("mapping/topic", "is needed, like \"uwb/+/ranges\"");
  // Section 3.1.3.1: 23 letters and digits are what every broker takes.
  out.client_id = "anchord";
  for (const char c : device_id.substr(device_id.size() - std::min<std::size_t>(device_id.size(), 12))) {
    if (c != '-') out.client_id += c;
  }
  return std::unique_ptr<device::Driver>(std::make_unique<Subscriber>(std::move(out), output));
}

}  // namespace anchord::mqtt
