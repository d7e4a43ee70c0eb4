#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "drivers/mavlink/message.hpp"

namespace anchord::mavlink {

/// CRC-16/MCRF4XX, the X.25 sum of MAVLink.
std::uint16_t crc_x25(std::span<const std::uint8_t> bytes, std::uint16_t crc = 0xFFFF);

/// Who sends.
struct Address {
  std::uint8_t system{}, component{};
  auto operator<=>(const Address&) const = default;
};

using Secret = std::array<std::uint8_t, 32>;

/// A message as it came off the wire.
struct Received {
  Address from;
  std::uint8_t sequence{};
  int version{2};
  bool is_signed{false};  ///< with a signature that was checked
  Message message;
};

/// Packs messages of one sender; counts the sequence. With a secret every frame is signed.
class Packer {
 public:
  explicit Packer(Address from) : from_(from) {}
  /// `timestamp`: 10 us units since 2015-01-01 UTC, of the first frame; it grows with every frame by itself.
  void sign_with(const Secret& secret, std::uint8_t link, std::uint64_t timestamp);
  /// Raises the time stamp of the next frame to at least this.
  void set_time(std::uint64_t timestamp);
  std::vector<std::uint8_t> pack(const Message& message);
  Address from() const { return from_; }

 private:
  Address from_;
  std::uint8_t sequence_{0};
  std::optional<Secret> secret_;
  std::uint8_t link_{0};
  std::uint64_t timestamp_{0};
};

/// Who signed what last: the time stamp must grow per sender and link, and a sender that is new may be at
/// most one minute behind. Shared by framers that read pieces of one link.
class SignatureBook {
 public:
  enum class Verdict : std::uint8_t { good, wrong_key, behind, replayed };

  explicit SignatureBook(const Secret& secret) : secret_(secret) {}
  void set_time(std::uint64_t now) { now_ = now; }
  /// Enters the frame's time stamp when its signature is good.
  Verdict judge(std::span<const std::uint8_t> frame);
  /// The newest time stamp accepted: ours must not be behind it.
  std::uint64_t newest() const { return newest_; }

 private:
  Secret secret_;
  std::uint64_t now_{0}, newest_{0};
  std::map<std::pair<Address, std::uint8_t>, std::uint64_t> streams_;  ///< time stamp per sender and link
};

/// Finds frames in a byte stream, v1 and v2. Pure: bytes in, messages out.
///
/// A wrong sum, an unknown flag or a bad signature costs one byte, not the stream: the search goes on behind
/// the start byte. Messages that the table does not have are skipped by their length, unchecked. Holds at
/// most one frame (280 bytes).
class Framer {
 public:
  struct Counters {
    std::uint64_t received{}, bad_sum{}, bad_flag{}, bad_signature{}, unsigned_refused{}, unknown{}, lost{};
    std::uint64_t skipped_bytes{};
    /// Of bad_signature: of another key; more than a minute old; not newer than the one before.
    std::uint64_t wrong_key{}, behind{}, replayed{};
  };

  /// From now on only frames with this signature count; the time stamp must grow per sender and link. A new
  /// sender may be at most one minute older than `now` (10 us units).
  void require_signature(const Secret& secret, std::uint64_t now);
  void require_signature(std::shared_ptr<SignatureBook> book) { book_ = std::move(book); }
  void set_time(std::uint64_t now) {
    if (book_) book_->set_time(now);
  }
  /// 10 us units; 0 without signatures.
  std::uint64_t newest_signature() const { return book_ ? book_->newest() : 0; }
  /// A datagram has ended: what is left of it never becomes a frame.
  void drop_partial() { buffer_.clear(); }

  void feed(std::span<const std::uint8_t> bytes, std::vector<Received>& out);
  const Counters& counters() const { return counters_; }

 private:
  std::size_t take(std::span<const std::uint8_t> bytes, std::vector<Received>& out, bool& waits);
  void count_sequence(Address from, std::uint8_t sequence);

  std::vector<std::uint8_t> buffer_;
  Counters counters_;
  std::shared_ptr<SignatureBook> book_;
  std::map<Address, std::uint8_t> sequences_;
};

/// 10 us units since 2015-01-01 UTC, the time stamp of signatures.
std::uint64_t signature_time(std::int64_t unix_us);

}  // namespace anchord::mavlink
