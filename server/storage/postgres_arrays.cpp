#include "server/storage/postgres_arrays.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace anchord::sql {
namespace {

constexpr std::size_t k_head_bytes = 5 * sizeof(std::uint32_t);
constexpr std::uint32_t k_null_length = 0xffffffff;

/// Of the arrays of a type (typarray in pg_type.dat).
unsigned array_of(unsigned element) {
  switch (element) {
    case k_bytea:
      return 1001;
    case k_text:
      return 1009;
    case k_float8:
      return 1022;
    default:
      return 1016;  // of int8
  }
}

}  // namespace

std::string& PostgresArrays::next(int index, unsigned type, std::size_t bytes) {
  Column& column = columns_.at(static_cast<std::size_t>(index - 1));
  if (column.type != 0 && column.type != type)
    throw SqlError(Failure::internal,
                   "database: column " + std::to_string(index) + " got values of two types");
  if (bytes > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    throw SqlError(Failure::constraint, "database: a value of more than 2 GiB");
  column.type = type;
  ++column.rows;
  bytes_ += bytes + sizeof(std::uint32_t);
  put_big_endian(column.array, static_cast<std::uint32_t>(bytes));
  return column.array;
}

void PostgresArrays::bind_null(int index) {
  Column& column = columns_.at(static_cast<std::size_t>(index - 1));
  ++column.rows;
  column.has_null = true;
  bytes_ += sizeof(std::uint32_t);
  put_big_endian(column.array, k_null_length);
}

void PostgresArrays::bind_integer(int index, std::int64_t value) {
  put_big_endian(next(index, k_int8, sizeof value), static_cast<std::uint64_t>(value));
}

void PostgresArrays::bind_real(int index, double value) {
  // As SQLite does it: a NaN is kept as NULL.
  if (std::isnan(value)) return bind_null(index);
  put_big_endian(next(index, k_float8, sizeof value), std::bit_cast<std::uint64_t>(value));
}

void PostgresArrays::bind_text(int index, std::string_view value) {
  next(index, k_text, value.size()).append(value);
}

void PostgresArrays::bind_blob(int index, std::span<const std::byte> value) {
  next(index, k_bytea, value.size()).append(reinterpret_cast<const char*>(value.data()), value.size());
}

unsigned PostgresArrays::type(std::size_t column) const { return array_of(columns_[column].type); }

/// Dimensions, whether there are NULLs, type of the elements, length, lower bound, elements: array_send().
std::string_view PostgresArrays::array(std::size_t column) {
  Column& of = columns_[column];
  std::size_t at = 0;
  for (const std::uint32_t word : {1u, std::uint32_t{of.has_null}, of.type, of.rows, 1u}) {
    const auto bytes = big_endian_bytes(word);
    std::ranges::copy(bytes, of.array.begin() + static_cast<std::ptrdiff_t>(at));
    at += bytes.size();
  }
  return of.array;
}

void PostgresArrays::clear() {
  for (Column& column : columns_) {
    column.type = 0;
    column.rows = 0;
    column.has_null = false;
    column.array.assign(k_head_bytes, '\0');
  }
  bytes_ = 0;
}

}  // namespace anchord::sql
