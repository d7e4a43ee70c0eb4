#pragma once

#include <array>
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

/// A number as PostgreSQL's wire has it.
template <class T>
std::array<char, sizeof(T)> big_endian_bytes(T value) {
  std::array<char, sizeof(T)> out;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out[i] = static_cast<char>(static_cast<unsigned char>(value >> (8 * (sizeof(T) - 1 - i))));
  return out;
}
template <class T>
void put_big_endian(std::string& out, T value) {
  const auto bytes = big_endian_bytes(value);
  out.append(bytes.data(), bytes.size());
}

/// Rows that are bound one after another, kept as one array a column in PostgreSQL's binary form.
class PostgresArrays final : public Statement {
 public:
  explicit PostgresArrays(std::size_t columns) : columns_(columns) { clear(); }

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
  /// Until the next change.
  std::string_view array(std::size_t column);
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
    std::string array;  ///< the elements behind room for what describes them
  };
  /// Where the next element goes, its length written.
  std::string& next(int index, unsigned type, std::size_t bytes);

  std::vector<Column> columns_;
  std::size_t bytes_{0};
};

}  // namespace anchord::sql
