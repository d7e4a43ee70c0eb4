#include "drivers/mavlink/message.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <limits>

#include "core/base/check.hpp"
#include "core/base/text.hpp"
#include "drivers/mavlink/message_table.hpp"

namespace anchord::mavlink {
namespace {

FieldType type_of(std::string_view word) {
  if (word == "u8") return FieldType::u8;
  if (word == "i8") return FieldType::i8;
  if (word == "u16") return FieldType::u16;
  if (word == "i16") return FieldType::i16;
  if (word == "u32") return FieldType::u32;
  if (word == "i32") return FieldType::i32;
  if (word == "u64") return FieldType::u64;
  if (word == "i64") return FieldType::i64;
  if (word == "f") return FieldType::f32;
  ANCHORD_CHECK(word == "c", "type in the table of messages: " << word);
  return FieldType::text;
}

Field parse_field(std::string_view word) {
  Field field;
  const auto colon = word.find(':');
  field.name = word.substr(0, colon);
  auto type = word.substr(colon + 1);
  if (const auto bracket = type.find('['); bracket != std::string_view::npos) {
    const auto digits = type.substr(bracket + 1);
    std::from_chars(digits.data(), digits.data() + digits.size(), field.count);
    type = type.substr(0, bracket);
  }
  field.type = type_of(type);
  return field;
}

MessageInfo parse_row(const MessageRow& row) {
  MessageInfo info{row.id, row.name, row.crc_extra, 0, 0, {}};
  bool extension = false;
  std::string_view left = row.layout;
  while (!left.empty()) {
    const auto space = left.find(' ');
    const auto word = left.substr(0, space);
    left = space == std::string_view::npos ? std::string_view{} : left.substr(space + 1);
    if (word == "|") {
      extension = true;
      continue;
    }
    Field field = parse_field(word);
    field.offset = info.full_length;
    field.extension = extension;
    info.full_length += size_of(field.type) * field.count;
    if (!extension) info.base_length = info.full_length;
    info.fields.push_back(field);
  }
  return info;
}

const std::vector<MessageInfo>& table() {
  static const std::vector<MessageInfo> parsed = [] {
    std::vector<MessageInfo> out;
    for (const auto& row : k_messages) out.push_back(parse_row(row));
    return out;  // in rising order of id, as the table is
  }();
  return parsed;
}

std::int64_t saturated(FieldType type, std::int64_t value) {
  const auto within = [value](auto limits) {
    using L = decltype(limits);
    return std::clamp<std::int64_t>(value, L::min(), L::max());
  };
  switch (type) {
    case FieldType::u8:
    case FieldType::text:
      return within(std::numeric_limits<std::uint8_t>());
    case FieldType::i8:
      return within(std::numeric_limits<std::int8_t>());
    case FieldType::u16:
      return within(std::numeric_limits<std::uint16_t>());
    case FieldType::i16:
      return within(std::numeric_limits<std::int16_t>());
    case FieldType::u32:
      return within(std::numeric_limits<std::uint32_t>());
    case FieldType::i32:
      return within(std::numeric_limits<std::int32_t>());
    case FieldType::u64:
    case FieldType::i64:
    case FieldType::f32:
      return value;
  }
  return value;
}

}  // namespace

std::size_t size_of(FieldType type) {
  switch (type) {
    case FieldType::u8:
    case FieldType::i8:
    case FieldType::text:
      return 1;
    case FieldType::u16:
    case FieldType::i16:
      return 2;
    case FieldType::u32:
    case FieldType::i32:
    case FieldType::f32:
      return 4;
    case FieldType::u64:
    case FieldType::i64:
      return 8;
  }
  return 0;
}

const Field* MessageInfo::field(std::string_view field_name) const {
  const auto it =
      std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.name == field_name; });
  return it == fields.end() ? nullptr : &*it;
}

const MessageInfo* find_message(std::uint32_t id) {
  const auto& all = table();
  const auto it =
      std::lower_bound(all.begin(), all.end(), id,
                       [](const MessageInfo& info, std::uint32_t wanted) { return info.id < wanted; });
  return it == all.end() || it->id != id ? nullptr : &*it;
}

const MessageInfo* find_message(std::string_view name) {
  const auto& all = table();
  const auto it =
      std::find_if(all.begin(), all.end(), [&](const MessageInfo& info) { return info.name == name; });
  return it == all.end() ? nullptr : &*it;
}

std::span<const MessageInfo> messages() { return table(); }

Message::Message(std::string_view name) : info_(find_message(name)) {
  ANCHORD_CHECK(info_ != nullptr, "no message " << name << " in the table");
  payload_.assign(info_->full_length, 0);
}

Message::Message(const MessageInfo& info, std::span<const std::uint8_t> payload)
    : info_(&info), payload_(info.full_length, 0) {
  std::copy_n(payload.begin(), std::min(payload.size(), payload_.size()), payload_.begin());
}

const Field& Message::at(std::string_view field, std::size_t index) const {
  const Field* found = info_->field(field);
  ANCHORD_CHECK(found != nullptr, info_->name << " has no field " << field);
  ANCHORD_CHECK(index < found->count, info_->name << "." << field << " has no element " << index);
  return *found;
}

std::int64_t Message::integer(std::string_view field, std::size_t index) const {
  const Field& f = at(field, index);
  if (f.type == FieldType::f32) return static_cast<std::int64_t>(real(field, index));
  const std::size_t size = size_of(f.type);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < size; ++i) {
    bits |= static_cast<std::uint64_t>(payload_[f.offset + index * size + i]) << (8 * i);
  }
  switch (f.type) {
    case FieldType::i8:
      return static_cast<std::int8_t>(bits);
    case FieldType::i16:
      return static_cast<std::int16_t>(bits);
    case FieldType::i32:
      return static_cast<std::int32_t>(bits);
    case FieldType::u8:
    case FieldType::u16:
    case FieldType::u32:
    case FieldType::u64:
    case FieldType::i64:
    case FieldType::f32:
    case FieldType::text:
      break;
  }
  return static_cast<std::int64_t>(bits);
}

double Message::real(std::string_view field, std::size_t index) const {
  const Field& f = at(field, index);
  if (f.type != FieldType::f32) return static_cast<double>(integer(field, index));
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    bits |= static_cast<std::uint32_t>(payload_[f.offset + index * 4 + i]) << (8 * i);
  }
  return static_cast<double>(std::bit_cast<float>(bits));
}

std::string Message::text(std::string_view field) const {
  const Field& f = at(field, 0);
  const std::string_view all(reinterpret_cast<const char*>(payload_.data()) + f.offset, f.count);
  return to_utf8(all.substr(0, all.find('\0')));  // full fields have no zero at the end
}

Message& Message::set(std::string_view field, std::int64_t value, std::size_t index) {
  const Field& f = at(field, index);
  if (f.type == FieldType::f32) return set_real(field, static_cast<double>(value), index);
  const auto bits = static_cast<std::uint64_t>(saturated(f.type, value));
  const std::size_t size = size_of(f.type);
  for (std::size_t i = 0; i < size; ++i) {
    payload_[f.offset + index * size + i] = static_cast<std::uint8_t>(bits >> (8 * i));
  }
  return *this;
}

Message& Message::set_real(std::string_view field, double value, std::size_t index) {
  const Field& f = at(field, index);
  ANCHORD_CHECK(f.type == FieldType::f32, info_->name << "." << field << " is no float");
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
  for (std::size_t i = 0; i < 4; ++i) {
    payload_[f.offset + index * 4 + i] = static_cast<std::uint8_t>(bits >> (8 * i));
  }
  return *this;
}

Message& Message::set_text(std::string_view field, std::string_view value) {
  const Field& f = at(field, 0);
  for (std::size_t i = 0; i < f.count; ++i) {
    payload_[f.offset + i] = i < value.size() ? static_cast<std::uint8_t>(value[i]) : std::uint8_t{0};
  }
  return *this;
}

}  // namespace anchord::mavlink
