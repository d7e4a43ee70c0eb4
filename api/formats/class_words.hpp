#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

/// LOS or NLOS of a cell, the same for campaigns and labelled tables.
namespace anchord::api {

/// What 0 and 1 mean in a column is said by its name (los, is_los, nlos, is_nlos) or by `los_value`; never
/// by anything else. The words LOS and NLOS say it themselves.
class ClassReader {
 public:
  enum class Said {
    nothing,  ///< an empty cell
    los,
    nlos,
    unreadable,  ///< a word that is neither
    untold       ///< a number or yes and no in a column that does not say which of them is LOS
  };

  /// los_value  what means LOS; empty: nobody said it
  /// always     it counts for columns that say it by their name too
  explicit ClassReader(std::string los_value = {}, bool always = false)
      : los_value_(std::move(los_value)), always_(always) {}

  Said read(std::string_view column, std::string_view cell);
  /// Of every column that was read: the value that was taken for LOS.
  const std::map<std::string, std::string>& taken() const { return taken_; }
  /// A cell was equal to `los_value`, or there is none.
  bool met() const { return los_value_.empty() || met_; }
  const std::string& los_value() const { return los_value_; }

  /// True for los, is_los, nlos and is_nlos, however they are spelled.
  static bool says_it(std::string_view column);

 private:
  std::string los_value_;
  bool always_, met_{false};
  std::map<std::string, std::string> taken_;
};

/// "column class has \"1\", ...": why a class is refused, and that `--los-value` or `los_value` resolves it.
std::string untold_class(std::string_view column, std::string_view cell);

}  // namespace anchord::api
