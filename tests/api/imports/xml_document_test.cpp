// XML of strangers: what is refused is refused with its line, before it costs memory or stack.
#include "api/formats/xml_document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <pugixml.hpp>
#include <string>

#include "core/base/text.hpp"

namespace anchord::api::xml_document_test {
namespace {

using ::testing::HasSubstr;

std::string why_not(const std::string& text) {
  pugi::xml_document document;
  const auto read = read_xml(text, document);
  if (read) return "";
  EXPECT_EQ(read.error().code, Errc::invalid_argument);
  return read.error().message;
}

std::string nested(int levels) {
  std::string open, close;
  for (int i = 0; i < levels; ++i) {
    open += "<a>";
    close += "</a>";
  }
  return open + close;
}

TEST(XmlDocument, GivesNamesWithoutPrefixAndTextWithoutItsEnds) {
  pugi::xml_document document;
  ASSERT_TRUE(read_xml(
      "\xEF\xBB\xBF<?xml version='1.0' encoding='UTF-16'?><!-- c --><k:kml xmlns:k='x' a=\">\">\n"
      " <gx:b> one &lt;two&gt; <!-- not this --> <![CDATA[<three>]]>\n</gx:b><b/></k:kml>\n<!-- d -->",
      document));
  const auto root = document.document_element();
  EXPECT_EQ(local_name(root), "kml");
  EXPECT_EQ(child_text(root, "b"), "one <two> <three>");
  EXPECT_EQ(child_text(root, "c"), "");
  EXPECT_FALSE(child_of(root, "c"));
}

TEST(XmlDocument, RefusesDocumentTypesAndWhatTheyDefine) {
  const std::string bomb =
      "<?xml version=\"1.0\"?>\n<!DOCTYPE lolz [<!ENTITY a \"lol\"><!ENTITY b \"&a;&a;&a;&a;\">\n"
      "<!ENTITY c \"&b;&b;&b;&b;\">]>\n<kml>&c;</kml>";
  EXPECT_THAT(why_not(bomb), HasSubstr("line 2: a document type (DOCTYPE) is not accepted"));
  EXPECT_THAT(why_not("<!DOCTYPE kml SYSTEM \"file:///etc/passwd\"><kml/>"), HasSubstr("document type"));
  EXPECT_NE(why_not("<kml><!DOCTYPE a></kml>"), "");
  EXPECT_NE(why_not("<!doctype kml><kml/>"), "");
}

TEST(XmlDocument, LeavesEntitiesThatNobodyDefinedAsTheyStand) {
  pugi::xml_document document;
  ASSERT_TRUE(read_xml("<a>&xxe; &amp;amp;</a>", document));
  EXPECT_EQ(text_of(document.document_element()), "&xxe; &amp;");
}

TEST(XmlDocument, KeepsTextUtf8WhateverAReferenceNames) {
  for (const char* text :
       {"<a>&#xD800;</a>", "<a>&#x110000;</a>", "<a>&#xFFFFFFFF;</a>", "<a>\xC3\x28</a>"}) {
    pugi::xml_document document;
    ASSERT_TRUE(read_xml(text, document)) << text;
    EXPECT_TRUE(is_utf8(text_of(document.document_element()))) << text;
  }
}

TEST(XmlDocument, BoundsDepthAndNumberOfElements) {
  EXPECT_EQ(why_not(nested(64)), "");
  EXPECT_THAT(why_not(nested(65)), HasSubstr("64 levels"));
  EXPECT_THAT(why_not(nested(100'000)), HasSubstr("64 levels"));
  std::string many = "<a>";
  for (int i = 0; i < 199'999; ++i) many += "<b/>";
  EXPECT_EQ(why_not(many + "</a>"), "");
  EXPECT_THAT(why_not(many + "<b/></a>"), HasSubstr("more than 200000 elements"));
  EXPECT_THAT(why_not(std::string(10'000'000, '<')), HasSubstr("more than 200000 elements"));
}

TEST(XmlDocument, NamesTheLineOfWhatIsNotWellFormed) {
  EXPECT_THAT(why_not("<kml>\n<Placemark></kml>"), HasSubstr("line 2: not well-formed"));
  EXPECT_THAT(why_not("<a>\n\n<b"), HasSubstr("line 3"));
  EXPECT_THAT(why_not("<a/>\n<b/>"), HasSubstr("line 2: there is text after"));
  EXPECT_THAT(why_not("<a/>\ntext"), HasSubstr("text outside"));
  EXPECT_THAT(why_not("text<a/>"), HasSubstr("text outside"));
  EXPECT_THAT(why_not(std::string("<a>\n") + '\0' + "</a>"), HasSubstr("line 2: a zero byte"));
  for (const char* broken : {"", " ", "<", "<a", "<a>", "</a>", "<>", "<a b=>", "<a><!-- </a>",
                             "<a><![CDATA[</a>", "<?xml", "<a></b>", "&lt;a/>"})
    EXPECT_NE(why_not(broken), "") << broken;
}

TEST(XmlDocument, EndsAtEveryCutOfADocument) {
  const std::string whole = "<?xml version='1.0'?><a x='1'><b>t &amp; u</b><!-- c --><![CDATA[d]]></a>";
  ASSERT_EQ(why_not(whole), "");
  for (std::size_t n = 0; n < whole.size(); ++n) EXPECT_NE(why_not(whole.substr(0, n)), "") << n;
}

}  // namespace
}  // namespace anchord::api::xml_document_test
