#pragma once

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/text.hpp"
#include "core/base/time.hpp"

/// Values as bytes, little endian, for messages between processes of one version. One function names the
/// fields of a type, for both ways:
///
///   template <class P>
///   void fields(P& p, Packed<P, Valued>& v) {
///     p(v.value, v.sigma);
///   }
///
/// found by the namespace of P. An enum needs packed_words(E), its table.
namespace anchord::api {

/// A value that P reads into, or only looks at.
template <class P, class T>
using Packed = std::conditional_t<P::k_reads, T, const T>;

template <class T>
concept PackedNumber = std::unsigned_integral<T> && !std::same_as<T, bool>;

class Packer {
 public:
  static constexpr bool k_reads = false;

  template <class... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }
  /// A number for which the kept form has null where it is none.
  void loose(double value) { put(value); }
  template <class T>
  void list(const std::vector<T>& values, std::size_t) {
    put(std::uint64_t{values.size()});
    for (const T& value : values) put(value);
  }
  template <class K, class V>
  void map(const std::map<K, V>& values, std::size_t) {
    put(std::uint64_t{values.size()});
    for (const auto& [key, value] : values) (*this)(key, value);
  }
  /// Rows column by column, which compresses to a third: the same member of all, then the next.
  template <class T, class... Column>
  void columns(const std::vector<T>& rows, Column... column) {
    put(std::uint64_t{rows.size()});
    (each(rows, column), ...);
  }
  void at(std::string_view) {}
  std::string take() { return std::move(bytes_); }

 private:
  template <class T, class Column>
  void each(const std::vector<T>& rows, Column column) {
    for (const T& row : rows) column(*this, row);
  }
  template <PackedNumber T>
  void put(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i)
      bytes_ += static_cast<char>(static_cast<unsigned char>(value >> (8 * i)));
  }
  void put(bool value) { put(static_cast<std::uint8_t>(value)); }
  void put(std::int64_t value) { put(static_cast<std::uint64_t>(value)); }
  void put(int value) { put(static_cast<std::int64_t>(value)); }
  void put(double value) { put(std::bit_cast<std::uint64_t>(value)); }
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    bytes_ += text;
  }
  template <class T>
  void put(const std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <class T>
  requires std::is_enum_v<T>
  void put(T value) { put(static_cast<std::uint8_t>(value)); }
  template <class T>
  requires std::is_class_v<T>
  void put(const T& value) { fields(*this, value); }

  std::string bytes_;
};

/// Reads what a stranger may have written: no list is longer than its limit, no number is none, a text is
/// UTF-8. After the first fault everything is empty, and done() says what it was.
class Unpacker {
 public:
  static constexpr bool k_reads = true;
  /// finite  false: of our own, whose numbers may be what they are
  explicit Unpacker(std::string_view bytes, bool finite = true) : rest_(bytes), finite_(finite) {}

  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  void loose(double& value) {
    std::uint64_t bits = 0;
    get(bits);
    value = std::bit_cast<double>(bits);
  }
  template <class T>
  void list(std::vector<T>& values, std::size_t most) {
    values.clear();
    for (std::uint64_t n = count(most); n > 0 && !faulty(); --n) get(values.emplace_back());
  }
  template <class K, class V>
  void map(std::map<K, V>& values, std::size_t most) {
    values.clear();
    for (std::uint64_t n = count(most); n > 0 && !faulty(); --n) {
      K key{};
      get(key);
      if (!values.empty() && !(values.rbegin()->first < key)) return refuse("its keys are not in order");
      get(values[std::move(key)]);
    }
  }
  template <class T, class... Column>
  void columns(std::vector<T>& rows, Column... column) {
    rows.resize(count(rest_.size() / sizeof...(Column)));
    (each(rows, column), ...);
  }
  /// What is read from here on, for the fault.
  void at(std::string_view what) {
    if (!faulty()) what_ = what;
  }
  void refuse(std::string_view why) {
    if (!faulty()) fault_ = std::string(what_) + ": " + std::string(why);
    rest_ = {};
  }
  bool faulty() const { return !fault_.empty(); }
  /// bad_frame: something was wrong, or bytes are left
  Result<void> done() {
    if (!rest_.empty()) refuse(std::to_string(rest_.size()) + " bytes are left over");
    if (faulty()) return make_error(Errc::bad_frame, fault_);
    return boost::outcome_v2::success();
  }

 private:
  template <class T, class Column>
  void each(std::vector<T>& rows, Column column) {
    for (T& row : rows) {
      if (faulty()) return;
      column(*this, row);
    }
  }
  std::uint64_t count(std::size_t most) {
    std::uint64_t n = 0;
    get(n);
    if (n <= most) return n;
    refuse(std::to_string(n) + " of them, and at most " + std::to_string(most) + " are allowed");
    return 0;
  }
  template <PackedNumber T>
  void get(T& value) {
    value = 0;
    if (rest_.size() < sizeof(T)) return refuse("it is cut off");
    for (std::size_t i = 0; i < sizeof(T); ++i)
      value = static_cast<T>(value |
                             static_cast<T>(static_cast<T>(static_cast<unsigned char>(rest_[i])) << (8 * i)));
    rest_.remove_prefix(sizeof(T));
  }
  void get(bool& value) {
    std::uint8_t byte = 0;
    get(byte);
    if (byte > 1) refuse("neither yes nor no");
    value = byte == 1;
  }
  void get(std::int64_t& value) {
    std::uint64_t bits = 0;
    get(bits);
    value = static_cast<std::int64_t>(bits);
  }
  void get(int& value) {
    std::int64_t wide = 0;
    get(wide);
    if (wide < std::numeric_limits<int>::min() || wide > std::numeric_limits<int>::max()) {
      refuse("a number is too large");
      wide = 0;
    }
    value = static_cast<int>(wide);
  }
  void get(double& value) {
    loose(value);
    if (!finite_ || std::isfinite(value)) return;
    refuse("a number is not finite");
    value = 0;
  }
  void get(std::string& text) {
    constexpr std::size_t k_longest = std::size_t{1} << 20;
    const std::uint64_t n = count(k_longest);
    if (rest_.size() < n) return refuse("a text is cut off");
    text = rest_.substr(0, n);
    rest_.remove_prefix(n);
    if (!is_utf8(text)) refuse("a text is not UTF-8");
  }
  template <class T>
  void get(std::optional<T>& value) {
    bool there = false;
    get(there);
    value.reset();
    if (there) get(value.emplace());
  }
  template <class T>
  requires std::is_enum_v<T>
  void get(T& value) {
    std::uint8_t number = 0;
    get(number);
    if (const auto known = packed_words(value).of_number(number))
      value = *known;
    else
      refuse("an unknown word");
  }
  template <class T>
  requires std::is_class_v<T>
  void get(T& value) { fields(*this, value); }

  std::string_view rest_;
  bool finite_;
  std::string what_{"the message"}, fault_;
};

template <class P>
void fields(P& p, Packed<P, UtcTime>& time) {
  p(time.ns);
}
template <class P>
void fields(P& p, Packed<P, NetworkId>& id) {
  p(id.value);
}
template <class P, class I>
requires std::same_as<std::remove_const_t<decltype(I::uuid)>, Uuid>
void fields(P& p, I& id) {
  for (auto& byte : id.uuid.bytes) p(byte);
}
template <class P, class M>
requires std::is_base_of_v<Eigen::MatrixBase<std::remove_const_t<M>>, std::remove_const_t<M>>
void fields(P& p, M& matrix) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) p(matrix.data()[i]);
}

}  // namespace anchord::api
