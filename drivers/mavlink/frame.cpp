#include "drivers/mavlink/frame.hpp"

#include <algorithm>
#include <string_view>

#include "core/base/sha256.hpp"

namespace anchord::mavlink {
namespace {

constexpr std::uint8_t k_start_v1 = 0xFE, k_start_v2 = 0xFD, k_flag_signed = 0x01;
constexpr std::size_t k_head_v1 = 6, k_head_v2 = 10, k_sum = 2, k_signature = 13;
constexpr std::size_t k_max_senders = 64;  ///< of a hostile stream; beyond it the oldest address is forgotten

std::array<std::uint8_t, 6> signature_of(const Secret& secret, std::span<const std::uint8_t> signed_bytes) {
  Sha256 sha;
  sha.add(std::string_view(reinterpret_cast<const char*>(secret.data()), secret.size()));
  sha.add(std::string_view(reinterpret_cast<const char*>(signed_bytes.data()), signed_bytes.size()));
  const auto digest = sha.digest();
  std::array<std::uint8_t, 6> out{};
  std::copy_n(digest.begin(), out.size(), out.begin());
  return out;
}

std::uint64_t time_of(std::span<const std::uint8_t> signature) {
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < 6; ++i) out |= static_cast<std::uint64_t>(signature[1 + i]) << (8 * i);
  return out;
}

}  // namespace

std::uint16_t crc_x25(std::span<const std::uint8_t> bytes, std::uint16_t crc) {
  for (const std::uint8_t byte : bytes) {
    auto t = static_cast<std::uint8_t>(byte ^ (crc & 0xFFU));
    t = static_cast<std::uint8_t>(t ^ (t << 4U));
    crc = static_cast<std::uint16_t>((crc >> 8U) ^ (t << 8U) ^ (t << 3U) ^ (t >> 4U));
  }
  return crc;
}

std::uint64_t signature_time(std::int64_t unix_us) {
  constexpr std::int64_t k_2015_us = 1'420'070'400'000'000;
  return unix_us <= k_2015_us ? 0 : static_cast<std::uint64_t>((unix_us - k_2015_us) / 10);
}

void Packer::sign_with(const Secret& secret, std::uint8_t link, std::uint64_t timestamp) {
  secret_ = secret;
  link_ = link;
  timestamp_ = timestamp;
}

void Packer::set_time(std::uint64_t timestamp) { timestamp_ = std::max(timestamp_, timestamp); }

std::vector<std::uint8_t> Packer::pack(const Message& message) {
  const auto payload = message.payload();
  std::size_t length = payload.size();
  while (length > 1 && payload[length - 1] == 0) --length;  // trailing zeros are cut, one byte stays
  const std::uint32_t id = message.id();
  std::vector<std::uint8_t> out{k_start_v2,
                                static_cast<std::uint8_t>(length),
                                secret_ ? k_flag_signed : std::uint8_t{0},
                                0,
                                sequence_++,
                                from_.system,
                                from_.component,
                                static_cast<std::uint8_t>(id),
                                static_cast<std::uint8_t>(id >> 8U),
                                static_cast<std::uint8_t>(id >> 16U)};
  out.insert(out.end(), payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(length));
  const std::array extra{message.info().crc_extra};
  const auto crc = crc_x25(extra, crc_x25(std::span(out).subspan(1)));
  out.push_back(static_cast<std::uint8_t>(crc));
  out.push_back(static_cast<std::uint8_t>(crc >> 8U));
  if (secret_) {
    out.push_back(link_);
    for (unsigned i = 0; i < 6; ++i) out.push_back(static_cast<std::uint8_t>(timestamp_ >> (8 * i)));
    ++timestamp_;
    const auto signature = signature_of(*secret_, out);
    out.insert(out.end(), signature.begin(), signature.end());
  }
  return out;
}

void Framer::require_signature(const Secret& secret, std::uint64_t now) {
  book_ = std::make_shared<SignatureBook>(secret);
  book_->set_time(now);
}

void Framer::feed(std::span<const std::uint8_t> bytes, std::vector<Received>& out) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  std::size_t at = 0;
  bool waits = false;
  while (at < buffer_.size() && !waits) at += take(std::span(buffer_).subspan(at), out, waits);
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at));
}

std::size_t Framer::take(std::span<const std::uint8_t> bytes, std::vector<Received>& out, bool& waits) {
  const bool v2 = bytes[0] == k_start_v2;
  if (!v2 && bytes[0] != k_start_v1) {
    ++counters_.skipped_bytes;
    return 1;
  }
  const std::size_t head = v2 ? k_head_v2 : k_head_v1;
  if (bytes.size() < head) {
    waits = true;
    return 0;
  }
  const std::size_t length = bytes[1];
  const bool is_signed = v2 && (bytes[2] & k_flag_signed) != 0;
  if (v2 && (bytes[2] & ~k_flag_signed) != 0) {  // a flag that we must understand and do not
    ++counters_.bad_flag;
    return 1;
  }
  const std::size_t plain = head + length + k_sum, whole = plain + (is_signed ? k_signature : 0);
  if (bytes.size() < whole) {
    waits = true;
    return 0;
  }
  const std::uint32_t id =
      v2 ? bytes[7] | static_cast<std::uint32_t>(bytes[8]) << 8U | static_cast<std::uint32_t>(bytes[9]) << 16U
         : bytes[5];
  const MessageInfo* info = find_message(id);
  if (info == nullptr) {
    ++counters_.unknown;
    return whole;
  }
  const std::array extra{info->crc_extra};
  const auto crc = crc_x25(extra, crc_x25(bytes.subspan(1, head + length - 1)));
  if (crc != (bytes[plain - 2] | static_cast<unsigned>(bytes[plain - 1]) << 8U)) {
    ++counters_.bad_sum;
    return 1;
  }
  const Address from = v2 ? Address{bytes[5], bytes[6]} : Address{bytes[3], bytes[4]};
  if (book_) {
    if (!is_signed) {
      ++counters_.unsigned_refused;
      return whole;
    }
    using Verdict = SignatureBook::Verdict;
    if (const auto verdict = book_->judge(bytes.first(whole)); verdict != Verdict::good) {
      ++counters_.bad_signature;
      ++(verdict == Verdict::wrong_key ? counters_.wrong_key
         : verdict == Verdict::behind  ? counters_.behind
                                       : counters_.replayed);
      return whole;
    }
  }
  const std::uint8_t sequence = v2 ? bytes[4] : bytes[2];
  count_sequence(from, sequence);
  ++counters_.received;
  out.push_back({from, sequence, v2 ? 2 : 1, is_signed && book_ != nullptr,
                 Message(*info, bytes.subspan(head, length))});
  return whole;
}

SignatureBook::Verdict SignatureBook::judge(std::span<const std::uint8_t> frame) {
  const auto signature = frame.last(k_signature);
  const auto wanted = signature_of(secret_, frame.first(frame.size() - 6));
  if (!std::equal(wanted.begin(), wanted.end(), signature.begin() + 7)) return Verdict::wrong_key;
  constexpr std::uint64_t k_minute = 6'000'000;  // 10 us units
  const std::uint64_t time = time_of(signature);
  const std::pair<Address, std::uint8_t> stream{{frame[5], frame[6]}, signature[0]};
  const auto known = streams_.find(stream);
  if (known == streams_.end()) {
    if (time + k_minute < now_ || streams_.size() >= k_max_senders) return Verdict::behind;
    streams_[stream] = time;
  } else if (time <= known->second) {
    return Verdict::replayed;
  } else {
    known->second = time;
  }
  newest_ = std::max(newest_, time);
  return Verdict::good;
}

void Framer::count_sequence(Address from, std::uint8_t sequence) {
  const auto known = sequences_.find(from);
  if (known == sequences_.end()) {
    if (sequences_.size() >= k_max_senders) sequences_.erase(sequences_.begin());
    sequences_.emplace(from, sequence);
    return;
  }
  counters_.lost += static_cast<std::uint8_t>(sequence - known->second - 1);
  known->second = sequence;
}

}  // namespace anchord::mavlink
