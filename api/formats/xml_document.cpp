#include "api/formats/xml_document.hpp"

#include <algorithm>
#include <cctype>
#include <pugixml.hpp>

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr int k_deepest = 64;
constexpr std::size_t k_most = 200'000;
// Fragments: text and further elements beside the first are then there to be seen. Document types: as well.
constexpr unsigned k_how = pugi::parse_default | pugi::parse_fragment | pugi::parse_doctype;

/// Where elements may begin. Before anything is built: a tree takes many times its text.
std::size_t count_tags(std::string_view text) {
  std::size_t n = 0;
  for (std::size_t at = 0; at + 1 < text.size(); ++at) {
    const char next = text[at + 1];
    n += text[at] != '<' || next == '/' || next == '!' || next == '?' ? 0 : 1;
  }
  return n;
}

Error at_line(std::string_view text, std::ptrdiff_t offset, const std::string& what) {
  const auto before = text.substr(0, static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0)));
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  return make_error(Errc::invalid_argument, "line " + std::to_string(line) + ": " + what);
}

/// The first element that is too deep.
struct DepthWalker : pugi::xml_tree_walker {
  pugi::xml_node too_deep;
  bool for_each(pugi::xml_node& node) override {
    if (node.type() == pugi::node_element && depth() >= k_deepest) too_deep = node;  // the first has depth 0
    return !too_deep;
  }
};

}  // namespace

Result<void> read_xml(std::string_view text, pugi::xml_document& document) {
  if (const auto zero = text.find('\0'); zero != std::string_view::npos)
    return at_line(text, static_cast<std::ptrdiff_t>(zero), "a zero byte");
  if (count_tags(text) > k_most)
    return make_error(Errc::invalid_argument, "more than " + std::to_string(k_most) + " elements");
  const auto done = document.load_buffer(text.data(), text.size(), k_how, pugi::encoding_utf8);
  if (!done) return at_line(text, done.offset, std::string("not well-formed XML: ") + done.description());
  pugi::xml_node root;
  for (const auto& node : document) {
    const auto fail = [&](const char* what) { return at_line(text, node.offset_debug(), what); };
    if (node.type() == pugi::node_doctype) return fail("a document type (DOCTYPE) is not accepted");
    if (node.type() != pugi::node_element) return fail("text outside of the document's element");
    if (root) return fail("there is text after the end of the document");
    root = node;
  }
  if (!root) return at_line(text, 0, "an element is missing");
  DepthWalker walker;
  document.traverse(walker);
  if (walker.too_deep)
    return at_line(text, walker.too_deep.offset_debug(),
                   "more than " + std::to_string(k_deepest) + " levels of elements");
  return boost::outcome_v2::success();
}

std::string_view local_name(const pugi::xml_node& node) {
  const std::string_view full = node.name();
  const auto colon = full.find(':');
  return full.substr(colon == std::string_view::npos ? 0 : colon + 1);
}

pugi::xml_node child_of(const pugi::xml_node& node, std::string_view name) {
  return node.find_child([&](const pugi::xml_node& child) { return local_name(child) == name; });
}

std::string text_of(const pugi::xml_node& node) {
  std::string out;
  for (const auto& part : node)
    if (part.type() == pugi::node_pcdata || part.type() == pugi::node_cdata) out += part.value();
  const auto space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  out.erase(out.begin(), std::find_if_not(out.begin(), out.end(), space));
  while (!out.empty() && space(out.back())) out.pop_back();
  return to_utf8(out);
}

std::string child_text(const pugi::xml_node& node, std::string_view name) {
  return text_of(child_of(node, name));
}

}  // namespace anchord::api
