#pragma once

#include <boost/outcome/basic_result.hpp>
#include <boost/outcome/policy/base.hpp>
#include <boost/outcome/try.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace anchord {

/// Why something could not be done. One table in api/kit/problem maps these to HTTP statuses.
enum class Errc {
  bad_frame,
  checksum_mismatch,
  too_few_observations,
  weak_geometry,
  no_convergence,
  not_found,
  conflict,
  invalid_argument,
  unsupported,
  queue_full,
  link_lost,
  storage_full,
  storage_unavailable,
  canceled,
  internal,
};

/// An answer that is not a value. `message` is for people and carries the numbers.
struct Error {
  Errc code{Errc::internal};
  std::string message;
};

/// Thrown when value() is taken of an error: a bug of ours, never an ordinary answer.
class BadResultAccess : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

struct ThrowBadResultAccess : boost::outcome_v2::policy::base {
  template <class Impl>
  static constexpr void wide_value_check(Impl&& self) {
    if (!base::_has_value(std::forward<Impl>(self))) {
      throw BadResultAccess("value taken of an error: " + base::_error(std::forward<Impl>(self)).message);
    }
  }
  template <class Impl>
  static constexpr void wide_error_check(Impl&& self) {
    if (!base::_has_error(std::forward<Impl>(self))) throw BadResultAccess("error taken of a value");
  }
};

/// A value or an Error. [[nodiscard]] by the type; hand an error on with BOOST_OUTCOME_TRY.
template <class T>
using Result = boost::outcome_v2::basic_result<T, Error, ThrowBadResultAccess>;

inline Error make_error(Errc code, std::string message) { return Error{code, std::move(message)}; }

}  // namespace anchord
