#include "api/formats/globe_track.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "core/geo/enu.hpp"

namespace anchord {
namespace {

std::string note_of(const SourceCrs& crs, const Wgs84& first, double convergence_rad) {
  char text[200];
  std::snprintf(
      text, sizeof text,
      "; first position at latitude %.6f, longitude %.6f; grid north %.3f degrees from true north; error "
      "of the datum %.3g m",
      first.lat_deg, first.lon_deg, convergence_rad * 180 / std::numbers::pi, crs.datum_error_m());
  return "track: from " + crs.name() + " to " + crs.datum() + "; heights " + crs.heights() + text;
}

}  // namespace

Result<void> put_on_globe(FlightData& flight, const SourceCrsSpec& spec, AttitudeOf attitude) {
  if (flight.fixes.empty()) return make_error(Errc::invalid_argument, "the track has no position");
  // Zeros are what a receiver without a fix writes.
  const auto first = std::ranges::find_if(
      flight.fixes, [](const Fix& fix) { return fix.local_m.x() != 0 || fix.local_m.y() != 0; });
  const Eigen::Vector3d first_m = (first == flight.fixes.end() ? flight.fixes.begin() : first)->local_m;
  BOOST_OUTCOME_TRY(const auto crs, SourceCrs::open(spec, first_m));
  const double convergence_rad = crs.convergence_rad(first_m);
  // One turn for a flight: within 300 m of it the convergence changes by less than 0.01 degrees.
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(-convergence_rad, Eigen::Vector3d::UnitZ()));
  std::size_t n_outside = 0;
  std::erase_if(flight.fixes, [&](Fix& fix) {
    const auto place = crs.wgs84(fix.local_m);
    if (!place) {
      ++n_outside;
      return true;
    }
    fix.position = place.value();
    fix.frame = TrackFrame::wgs84;
    fix.local_m.setZero();
    const Eigen::Matrix3d enu_from_axes =
        crs.geocentric() ? EnuFrame(fix.position).enu_from_ecef() : turn.toRotationMatrix();
    if (fix.covariance_m2) fix.covariance_m2 = enu_from_axes * *fix.covariance_m2 * enu_from_axes.transpose();
    if (fix.enu_from_body && attitude == AttitudeOf::axes) fix.enu_from_body = turn * *fix.enu_from_body;
    return false;
  });
  if (flight.fixes.empty())
    return make_error(Errc::invalid_argument, "no position of the track is within " + crs.name());
  const bool turned =
      std::ranges::any_of(flight.fixes, [](const Fix& fix) { return fix.enu_from_body.has_value(); });
  if (crs.geocentric() && turned && attitude == AttitudeOf::axes)
    return make_error(
        Errc::invalid_argument,
        "attitudes in earth-centred axes are not supported: give headings from true north, or none");
  flight.mission.frame = TrackFrame::wgs84;
  flight.notes.push_back(note_of(crs, flight.fixes.front().position, convergence_rad));
  if (n_outside > 0)
    flight.notes.push_back("track: " + std::to_string(n_outside) + " positions outside " + crs.name() +
                           " left out");
  return boost::outcome_v2::success();
}

}  // namespace anchord
