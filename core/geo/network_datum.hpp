#pragma once

#include <array>
#include <string_view>

namespace anchord {

/// A datum that RTK networks of some region give: the word for it, without capitals, blanks and hyphens, and
/// the EPSG codes of its geographic systems.
struct NetworkDatum {
  std::string_view word;
  int flat_epsg, full_epsg;  ///< without and with heights
};
inline constexpr std::array k_network_datums{
    NetworkDatum{"wgs84", 4326, 4979},     NetworkDatum{"etrs89", 4258, 4937},
    NetworkDatum{"etrf2000", 9067, 7931},  NetworkDatum{"itrf2008", 8999, 7911},
    NetworkDatum{"itrf2014", 9000, 7912},  NetworkDatum{"itrf2020", 9990, 9989},
    NetworkDatum{"igs14", 9019, 9018},     NetworkDatum{"nad83(2011)", 6318, 6319},
    NetworkDatum{"gda94", 4283, 4939},     NetworkDatum{"gda2020", 7844, 7843},
    NetworkDatum{"jgd2011", 6668, 6667},   NetworkDatum{"nzgd2000", 4167, 4959},
    NetworkDatum{"sirgas2000", 4674, 4988}};

}  // namespace anchord
