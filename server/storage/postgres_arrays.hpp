#pragma once

#include <string>
#include <vector>

#include "server/storage/sql.hpp"

namespace anchord::sql {

/// Types by their numbers in PostgreSQL's catalogue (pg_type.dat), which never change.
enum PostgresType : unsigned {
  k_bool = 16,
  k_bytea = 17,
  k_int8 = 20,
  k_int2 = 21,
  k_int4 = 23,
  k_text = 25,
  k_float8 = 701,
};

/// Appends a number as PostgreSQL's wire has it.
template <class T>
void put_big_endian(std::string& out, T value) {
  for (int shift = static_cast<int>(sizeof(T)) * 8 - 8; shift >= 0; shift -= 8)
    out += static_cast<char>(static_cast<unsigned char>(value >> shift));
}

/// Rows that are bound one after another, kept as one array a column in PostgreSQL's binary form.
class PostgresArrays final : public Statement {
 public:
  explicit PostgresArrays(std::size_t columns) : columns_(columns) {}

  void bind_null(int index) override;
  void bind_integer(int index, std::int64_t value) override;
  void bind_real(int index, double value) override;
  void bind_text(int index, std::string_view value) override;
  void bind_blob(int index, std::span<const std::byte> value) override;
  void reset() noexcept override {}

  std::size_t bytes() const { return bytes_; }
  /// Type of the elements; 0 when all are NULL.
  unsigned element(std::size_t column) const { return columns_[column].type; }
  unsigned type(std::size_t column) const;
  std::string array(std::size_t column) const;
  /// Empty again, for more rows.
  void clear();

  // It only takes values.
  bool step() override { return false; }
  std::optional<std::int64_t> insert(std::string_view) override { return std::nullopt; }
  bool is_null(int) override { return true; }
  std::int64_t integer(int) override { return 0; }
  double real(int) override { return 0; }
  std::string text(int) override { return {}; }
  std::span<const std::byte> blob(int) override { return {}; }

 private:
  struct Column {
    unsigned type{0};
    std::uint32_t rows{0};
    bool has_null{false};
    std::string elements;
  };
  /// Where the next element goes, its length written.
  std::string& next(int index, unsigned type, std::size_t bytes);

  std::vector<Column> columns_;
  std::size_t bytes_{0};
};

}  // namespace anchord::sql
