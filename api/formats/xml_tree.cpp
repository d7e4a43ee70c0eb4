#include "api/formats/xml_tree.hpp"

#include <algorithm>
#include <cctype>

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_deepest = 64, k_most = 200'000;

bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

std::string trimmed(std::string text) {
  const auto begin = std::find_if_not(text.begin(), text.end(), is_space);
  const auto end = std::find_if_not(text.rbegin(), std::make_reverse_iterator(begin), is_space).base();
  return {begin, end};
}

/// The five names of XML; numbers are left as they stand, nothing we read carries them.
std::string decoded(std::string_view text) {
  static constexpr std::pair<std::string_view, char> k_names[]{
      {"&lt;", '<'}, {"&gt;", '>'}, {"&amp;", '&'}, {"&quot;", '"'}, {"&apos;", '\''}};
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto* known = std::find_if(std::begin(k_names), std::end(k_names),
                                     [&](const auto& n) { return text.substr(i).starts_with(n.first); });
    out += known == std::end(k_names) ? text[i] : known->second;
    i += known == std::end(k_names) ? 1 : known->first.size();
  }
  return out;
}

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }

  Result<XmlNode> run() {
    BOOST_OUTCOME_TRYV(skip_to_tag(nullptr));
    BOOST_OUTCOME_TRY(auto root, element(0));
    BOOST_OUTCOME_TRYV(skip_to_tag(nullptr));
    if (at_ < text_.size()) return fail("there is more behind the document's end");
    return root;
  }

 private:
  Error fail(const std::string& what) const {
    const auto line =
        1 + std::count(text_.begin(),
                       text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size())), '\n');
    return make_error(Errc::invalid_argument, "line " + std::to_string(line) + ": " + what);
  }
  bool here(std::string_view wanted) const { return text_.substr(at_).starts_with(wanted); }
  Result<std::string_view> until(std::string_view end, const char* what) {
    const auto found = text_.find(end, at_);
    if (found == std::string_view::npos) return fail(std::string(what) + " never ends");
    const auto out = text_.substr(at_, found - at_);
    at_ = found + end.size();
    return out;
  }

  /// Text goes to `node`; comments and instructions are passed over.
  Result<void> skip_to_tag(XmlNode* node) {
    while (at_ < text_.size()) {
      if (here("<!--")) {
        BOOST_OUTCOME_TRYV(until("-->", "a comment"));
      } else if (here("<?")) {
        BOOST_OUTCOME_TRYV(until("?>", "an instruction"));
      } else if (here("<![CDATA[")) {
        at_ += 9;
        BOOST_OUTCOME_TRY(const auto raw, until("]]>", "a CDATA section"));
        if (node != nullptr) node->text += raw;
      } else if (here("<!")) {
        return fail("a document type is not read");
      } else if (here("<")) {
        return boost::outcome_v2::success();
      } else {
        const auto end = std::min(text_.find('<', at_), text_.size());
        const auto raw = text_.substr(at_, end - at_);
        if (node != nullptr) node->text += decoded(raw);
        if (node == nullptr && !std::all_of(raw.begin(), raw.end(), is_space))
          return fail("text outside of the document's element");
        at_ = end;
      }
    }
    return boost::outcome_v2::success();
  }

  Result<XmlNode> element(std::size_t depth) {
    if (depth > k_deepest || ++n_ > k_most) return fail("too deep or too large");
    if (!here("<")) return fail("an element is missing");
    ++at_;
    const auto begin = at_;
    bool quoted = false;
    char quote = 0;
    for (; at_ < text_.size() && (quoted || text_[at_] != '>'); ++at_) {
      const char c = text_[at_];
      if (quoted ? c == quote : (c == '"' || c == '\'')) quoted = !quoted, quote = c;
    }
    if (at_ >= text_.size()) return fail("a tag never ends");
    auto tag = text_.substr(begin, at_ - begin);
    ++at_;
    const bool empty = tag.ends_with('/');
    if (empty) tag.remove_suffix(1);
    const auto full =
        tag.substr(0, static_cast<std::size_t>(std::find_if(tag.begin(), tag.end(), is_space) - tag.begin()));
    if (full.empty()) return fail("a tag without a name");
    XmlNode node;
    const auto colon = full.find(':');
    node.name = full.substr(colon == std::string_view::npos ? 0 : colon + 1);
    if (empty) return node;
    while (true) {
      BOOST_OUTCOME_TRYV(skip_to_tag(&node));
      if (at_ >= text_.size()) return fail(node.name + " is not closed");
      if (here("</")) break;
      BOOST_OUTCOME_TRY(auto child, element(depth + 1));
      node.children.push_back(std::move(child));
    }
    at_ += 2;
    BOOST_OUTCOME_TRY(const auto closing, until(">", "a closing tag"));
    if (trimmed(std::string(closing)) != full)
      return fail(std::string(full) + " is closed as " + to_utf8(closing, 40));
    node.text = trimmed(std::move(node.text));
    return node;
  }

  std::string_view text_;
  std::size_t at_{0}, n_{0};
};

}  // namespace

const XmlNode* XmlNode::child(std::string_view wanted) const {
  const auto it =
      std::find_if(children.begin(), children.end(), [&](const XmlNode& c) { return c.name == wanted; });
  return it == children.end() ? nullptr : &*it;
}

std::string_view XmlNode::child_text(std::string_view wanted) const {
  const auto* found = child(wanted);
  return found == nullptr ? std::string_view{} : std::string_view(found->text);
}

Result<XmlNode> parse_xml(std::string_view text) { return Parser(text).run(); }

}  // namespace anchord::api
