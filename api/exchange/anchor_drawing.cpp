#include "api/exchange/anchor_drawing.hpp"

#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

std::string number(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

const std::string& label(const Anchor& anchor, const std::string& id) {
  return anchor.name.empty() ? id : anchor.name;
}

/// A group: its code on one line, its value on the next.
std::string group(int code, std::string_view value) {
  return std::to_string(code) + "\r\n" + std::string(value) + "\r\n";
}

/// Text of R12: one line of ASCII; other characters have a form of their own.
std::string dxf_text(std::string_view utf8) {
  std::string out;
  for (std::size_t i = 0; i < utf8.size();) {
    const auto byte = static_cast<unsigned char>(utf8[i]);
    if (byte < 0x80) {
      // %%d is a degree sign to every CAD program, %%% a percent sign (AutoCAD, control codes of text).
      if (utf8.substr(i, 2) == "%%" || (byte == '%' && out.ends_with('%')))
        out += "%%%";
      else if (byte == '^')
        out += "^ ";  // ^J is a line end (DXF reference, control characters)
      else
        out += byte < 0x20 || byte == 0x7f ? ' ' : utf8[i];
      ++i;
      continue;
    }
    const int more = byte >= 0xf0 ? 3 : byte >= 0xe0 ? 2 : 1;
    std::uint32_t code = byte & (0x3fU >> more);
    for (int k = 1; k <= more && i + static_cast<std::size_t>(k) < utf8.size(); ++k)
      code = (code << 6) | (static_cast<unsigned char>(utf8[i + static_cast<std::size_t>(k)]) & 0x3fU);
    i += static_cast<std::size_t>(more) + 1;
    char escaped[16];
    std::snprintf(escaped, sizeof escaped, "\\U+%04X", code);
    out += code > 0xffff ? "?" : escaped;
  }
  return out;
}

/// Layers of R12 have 31 characters: letters, digits, $, - and _.
std::string layer_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
    const bool small = c >= 'a' && c <= 'z';
    out += plain ? c : small ? static_cast<char>(c - 'a' + 'A') : '_';
  }
  return out.substr(0, 24);
}

/// A name for each building and floor; two that only differ in what a layer cannot say get numbers.
class Layers {
 public:
  const std::string& of(const Anchor& anchor) {
    auto [it, fresh] = names_.try_emplace({anchor.building, anchor.floor});
    if (!fresh) return it->second;
    const std::string building =
        anchor.building.empty() ? "" : layer_text(anchor.building).substr(0, 10) + '_';
    std::string name =
        building + (anchor.floor.empty() ? "NO_FLOOR" : "FLOOR_" + layer_text(anchor.floor).substr(0, 10));
    for (int n = 2; !used_.insert(name).second; ++n) name = name.substr(0, 28) + '_' + std::to_string(n);
    return it->second = name;
  }
  const std::set<std::string>& names() const { return used_; }

 private:
  std::map<std::pair<std::string, std::string>, std::string> names_;
  std::set<std::string> used_;
};

std::string at(const AnchorFeature& feature, FileHeight height, double east_m) {
  return group(10, number(feature.projected->e_m + east_m, 4)) +
         group(20, number(feature.projected->n_m, 4)) + group(30, number(file_height_m(feature, height), 4));
}

std::string_view word(FileHeight height) { return k_file_height_words.word(height); }

}  // namespace

double file_height_m(const AnchorFeature& feature, FileHeight height) {
  return height == FileHeight::orthometric ? *feature.height_orthometric_m
                                           : feature.estimate->best->wgs84->height_m;
}

std::string anchors_dxf(std::span<const AnchorFeature> anchors, FileHeight height) {
  constexpr double k_text_m = 0.2;
  Layers layers;
  std::string entities, comments;
  for (const auto& feature : anchors) {
    const std::string id = to_string(feature.anchor.network_id);
    const auto& layer = layers.of(feature.anchor);
    entities += group(0, "POINT") + group(8, layer) + at(feature, height, 0);
    entities += group(0, "TEXT") + group(8, layer) + at(feature, height, k_text_m) +
                group(40, number(k_text_m, 2)) + group(1, dxf_text(label(feature.anchor, id)));
  }
  if (!anchors.empty()) {
    const auto& first = anchors.front();
    comments = group(999, "EPSG:" + std::to_string(first.projected->epsg) + ", metres, " +
                              std::string(word(height)) + " heights" +
                              (height == FileHeight::orthometric ? " by " + dxf_text(first.geoid) : ""));
  }
  std::string table;
  for (const auto& name : layers.names())
    table += group(0, "LAYER") + group(2, name) + group(70, "0") + group(62, "7") + group(6, "CONTINUOUS");
  // Points are drawn as crosses (34 is a cross in a circle) 0.1 m wide, else a plot shows nothing of them.
  return comments + group(0, "SECTION") + group(2, "HEADER") + group(9, "$ACADVER") + group(1, "AC1009") +
         group(9, "$PDMODE") + group(70, "34") + group(9, "$PDSIZE") + group(40, "0.1") + group(0, "ENDSEC") +
         group(0, "SECTION") + group(2, "TABLES") + group(0, "TABLE") + group(2, "LTYPE") + group(70, "1") +
         group(0, "LTYPE") + group(2, "CONTINUOUS") + group(70, "0") + group(3, "Solid line") +
         group(72, "65") + group(73, "0") + group(40, "0.0") + group(0, "ENDTAB") + group(0, "TABLE") +
         group(2, "LAYER") + group(70, std::to_string(layers.names().size())) + table + group(0, "ENDTAB") +
         group(0, "ENDSEC") + group(0, "SECTION") + group(2, "ENTITIES") + entities + group(0, "ENDSEC") +
         group(0, "EOF");
}

std::string anchors_pnezd(std::span<const AnchorFeature> anchors, FileHeight height) {
  std::string out;
  for (const auto& feature : anchors) {
    const Anchor& anchor = feature.anchor;
    const std::string id = to_string(anchor.network_id);
    // A description goes as it is into drawings and spreadsheets: one line, without the separator.
    std::string text = "UWB " + id + (anchor.name.empty() ? "" : ' ' + anchor.name) +
                       " EPSG:" + std::to_string(feature.projected->epsg) + ' ' + std::string(word(height));
    for (char& c : text) {
      if (c == ',' || c == '"' || static_cast<unsigned char>(c) < 0x20) c = ' ';
    }
    out += std::to_string(anchor.network_id.value) + ',' + number(feature.projected->n_m, 4) + ',' +
           number(feature.projected->e_m, 4) + ',' + number(file_height_m(feature, height), 4) + ',' + text +
           "\r\n";
  }
  return out;
}

std::string anchors_pozyx(std::span<const AnchorFeature> anchors) {
  auto list = nlohmann::ordered_json::array();
  const auto mm = [](double metres) { return static_cast<std::int32_t>(std::lround(metres * 1000)); };
  for (const auto& feature : anchors) {
    const auto& at_m = *feature.local_m;
    list.push_back({{"network_id", to_string(feature.anchor.network_id)},
                    {"flag", 1},  // 1: an anchor (reg:POS of the Pozyx register map)
                    {"x_mm", mm(at_m.x())},
                    {"y_mm", mm(at_m.y())},
                    {"z_mm", mm(at_m.z())}});
  }
  return to_wire(list, 1) + '\n';
}

}  // namespace anchord::api
