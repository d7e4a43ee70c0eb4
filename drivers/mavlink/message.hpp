#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace anchord::mavlink {

enum class FieldType : std::uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, text };
std::size_t size_of(FieldType type);

struct Field {
  std::string_view name;
  FieldType type{};
  std::size_t offset{};
  std::size_t count{1};  ///< of an array or the bytes of a text
  bool extension{false};
};

/// A row of the table, parsed.
struct MessageInfo {
  std::uint32_t id{};
  std::string_view name;
  std::uint8_t crc_extra{};
  std::size_t base_length{}, full_length{};
  std::vector<Field> fields;  ///< wire order
  const Field* field(std::string_view field_name) const;
};

/// Null when the table does not have it.
const MessageInfo* find_message(std::uint32_t id);
const MessageInfo* find_message(std::string_view name);
std::span<const MessageInfo> messages();

/// One message as its fields. Unset fields are 0. The names are those of the table: a name that is not there
/// is a mistake of ours and throws (ANCHORD_CHECK), it never comes from outside.
///
/// Integers go through std::int64_t except the 64-bit unsigned ones, which keep their bits.
class Message {
 public:
  explicit Message(std::string_view name);
  /// A payload as received: cut zeros are filled in, bytes beyond what is known are left out.
  Message(const MessageInfo& info, std::span<const std::uint8_t> payload);

  const MessageInfo& info() const { return *info_; }
  std::uint32_t id() const { return info_->id; }
  bool is(std::string_view name) const { return info_->name == name; }

  std::int64_t integer(std::string_view field, std::size_t index = 0) const;
  double real(std::string_view field, std::size_t index = 0) const;
  std::string text(std::string_view field) const;  ///< up to the first zero

  /// Out of the field's range: saturated. Chains: Message("HEARTBEAT").set("type", 6).set("autopilot", 8).
  Message& set(std::string_view field, std::int64_t value, std::size_t index = 0);
  Message& set_real(std::string_view field, double value, std::size_t index = 0);
  Message& set_text(std::string_view field, std::string_view value);  ///< cut to the field

  /// All bytes, extensions included, zeros not cut.
  std::span<const std::uint8_t> payload() const { return payload_; }

 private:
  const Field& at(std::string_view field, std::size_t index) const;
  const MessageInfo* info_;
  std::vector<std::uint8_t> payload_;
};

}  // namespace anchord::mavlink
