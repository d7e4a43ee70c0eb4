#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"

namespace anchord::api {

/// Values of ISO 10303-21 as they stand between the brackets of an instance.
namespace step {

/// 'text': ASCII as it is, quotes and backslashes doubled, all else as \X2\ or \X4\; control characters are
/// blanks. Longer than 255 characters is cut, since IfcLabel ends there.
std::string text(std::string_view utf8);
/// "null" is $.
std::string text_or_null(std::string_view utf8);
/// With a decimal point, 0.1 mm.
std::string real(double value);
/// (#1,#2)
std::string list(const std::vector<std::string>& references);
/// The 22 characters of an IfcGloballyUniqueId: 128 bits, six a character, two in the first.
std::string guid(const Uuid& id);
/// As guid() gives them: 22 characters of its alphabet, the first at most 3.
bool is_guid(std::string_view text);

}  // namespace step

/// The instances of a DATA section, numbered from 1.
class StepData {
 public:
  /// NAME(VALUES) as the next instance; what refers to it, as "#12".
  std::string add(std::string_view name, std::string_view values);
  const std::string& instances() const { return instances_; }

 private:
  std::size_t last_{0};
  std::string instances_;
};

}  // namespace anchord::api
