// XML of a stranger: refused with a line, or a document within its bounds whose texts are UTF-8.
#include "api/formats/xml_document.hpp"

#include <cstdint>
#include <pugixml.hpp>

#include "core/base/text.hpp"
#include "tests/fuzz/check.hpp"

namespace {

void walk(const pugi::xml_node& node, int depth) {
  using namespace anchord;
  fuzz::require(depth <= 65, "no deeper than 64 levels");
  fuzz::require(is_utf8(api::text_of(node)), "texts are UTF-8");
  (void)api::child_text(node, "name");
  for (const auto& child : node) walk(child, depth + 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  pugi::xml_document document;
  const auto read = api::read_xml({reinterpret_cast<const char*>(data), size}, document);
  if (!read) {
    fuzz::require(!read.error().message.empty(), "a refusal has its words");
    return 0;
  }
  fuzz::require(static_cast<bool>(document.document_element()), "what is accepted has an element");
  walk(document.document_element(), 1);
  return 0;
}
