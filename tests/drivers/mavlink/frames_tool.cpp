// One line per message of the table: "NAME hex hex": a frame with every field set by the rule below, and one
// with the first field alone (whose zeros are cut). A last line has a signed frame.
// tests/e2e/mavlink.test.mjs makes the same with another implementation and compares the bytes.
//
// Rule: element i of the j-th field (wire order) of message id is v = (id + 13 j + 3 i) % 100 + 1; floats v +
// 0.5; texts "text<j>".
#include <cstdio>
#include <string>

#include "drivers/mavlink/frame.hpp"

namespace {

using namespace anchord::mavlink;

Message filled(const MessageInfo& info, bool first_only) {
  Message message(info.name);
  std::size_t j = 0;
  for (const auto& field : info.fields) {
    if (field.type == FieldType::text) {
      message.set_text(field.name, "text" + std::to_string(j));
    } else {
      for (std::size_t i = 0; i < field.count; ++i) {
        const auto value = static_cast<std::int64_t>((info.id + 13 * j + 3 * i) % 100 + 1);
        if (field.type == FieldType::f32)
          message.set_real(field.name, static_cast<double>(value) + 0.5, i);
        else
          message.set(field.name, value, i);
      }
    }
    ++j;
    if (first_only) break;
  }
  return message;
}

void print(const std::vector<std::uint8_t>& frame) {
  std::fputc(' ', stdout);
  for (const auto byte : frame) std::printf("%02x", static_cast<unsigned>(byte));
}

}  // namespace

int main() {
  for (const auto& info : messages()) {
    std::printf("%s", std::string(info.name).c_str());
    print(Packer({255, 190}).pack(filled(info, false)));
    print(Packer({255, 190}).pack(filled(info, true)));
    std::printf("\n");
  }
  Secret secret{};
  for (std::size_t i = 0; i < secret.size(); ++i) secret[i] = static_cast<std::uint8_t>(i);
  Packer packer({255, 190});
  packer.sign_with(secret, 3, 0x123456789a);
  std::printf("SIGNED");
  print(packer.pack(filled(*find_message("COMMAND_LONG"), false)));
  std::printf("\n");
}
