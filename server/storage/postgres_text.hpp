#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace anchord::sql {

/// A text of the seam as PostgreSQL reads it: ?1 becomes $1 and ifnull coalesce, outside of strings, quoted
/// names and comments.
class PostgresText {
 public:
  explicit PostgresText(std::string_view sql);

  /// Whether a parameter has a value, from 1 at [0]. One without stands in the text as NULL: PostgreSQL wants
  /// a type of each parameter, and a NULL has none.
  using Given = std::vector<bool>;
  std::string with(const Given& given) const;
  /// All parameters have values.
  const std::string& whole() const { return whole_; }
  /// The highest number of a parameter.
  int parameters() const { return parameters_; }

 private:
  struct Piece {
    std::string text;
    int parameter{0};  ///< what stands behind the text; 0: nothing
  };
  std::vector<Piece> pieces_;
  std::string whole_;
  int parameters_{0};
};

/// Address of a database without the password, for messages; "PostgreSQL" where it is not a URL.
std::string shown_address(std::string_view address);

/// Why this is no address of a database to give: another kind, or one with a password in it. Empty: it is.
std::string address_fault(std::string_view address);

}  // namespace anchord::sql
