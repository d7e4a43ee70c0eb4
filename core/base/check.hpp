#pragma once

#include <sstream>
#include <stdexcept>

/// Broken invariant: throws std::logic_error with the place and the values, in every build type.
/// The only macro of the project, because it needs the text of its condition.
#define ANCHORD_CHECK(cond, text)                                                                          \
  do {                                                                                                     \
    if (!(cond)) {                                                                                         \
      std::ostringstream anchord_check_message;                                                            \
      anchord_check_message << __FILE__ << ':' << __LINE__ << ": " << #cond << " does not hold: " << text; \
      throw std::logic_error(anchord_check_message.str());                                                 \
    }                                                                                                      \
  } while (false)
