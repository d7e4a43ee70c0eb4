#pragma once

#include <cmath>

namespace anchord::ml {

inline double sigmoid(double z) { return 1 / (1 + std::exp(-z)); }

}  // namespace anchord::ml
