#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "api/anchors/frame_json.hpp"
#include "api/formats/csv_table.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/frame_fit.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/terminal_text.hpp"

namespace anchord::cli {
namespace {

struct Arguments {
  std::string pairs;
  int parameters{7};
  bool fixed_scale{false}, json{false};
};

struct Pairs {
  std::vector<FramePair> pairs;
  std::optional<Wgs84> origin{};  ///< of the ENU numbers, when the file has places on the globe
};

/// Columns name (optional), x_m, y_m, z_m, and either lon_deg, lat_deg, h_m or e_m, n_m, u_m; sigma_m
/// optional.
Result<Pairs> read_pairs(const std::filesystem::path& file) {
  if (file.extension() != ".csv")
    return make_error(Errc::invalid_argument, file.string() + ": not a .csv file");
  BOOST_OUTCOME_TRY(auto table, CsvTable::open(file.parent_path().empty() ? "." : file.parent_path(),
                                               file.stem().string()));
  const auto name = table.column("name"), sigma = table.column("sigma_m");
  const bool globe = table.column("lon_deg").has_value();
  std::array<std::size_t, 3> local{}, there{};
  const std::array<const char*, 3> local_names{"x_m", "y_m", "z_m"};
  const std::array<const char*, 3> names = globe ? std::array<const char*, 3>{"lon_deg", "lat_deg", "h_m"}
                                                 : std::array<const char*, 3>{"e_m", "n_m", "u_m"};
  for (std::size_t i = 0; i < 3; ++i) {
    BOOST_OUTCOME_TRY(local[i], table.require(local_names[i]));
    BOOST_OUTCOME_TRY(there[i], table.require(names[i]));
  }
  Pairs out;
  while (true) {
    BOOST_OUTCOME_TRY(const bool more, table.next());
    if (!more) return out;
    FramePair pair;
    if (name) pair.name = std::string(table.text(*name));
    Eigen::Vector3d at;
    for (std::size_t i = 0; i < 3; ++i) {
      BOOST_OUTCOME_TRY(pair.local_m[static_cast<Eigen::Index>(i)], table.number(local[i]));
      BOOST_OUTCOME_TRY(at[static_cast<Eigen::Index>(i)], table.number(there[i]));
    }
    if (!at.allFinite() || (globe && std::abs(at.y()) > 90))
      return table.error("not a position on the globe");
    if (globe) {
      const Wgs84 place{at.y(), at.x(), at.z()};
      if (!out.origin) out.origin = place;
      pair.enu_m = EnuFrame(*out.origin).enu_from_wgs84(place).m;
    } else {
      pair.enu_m = at;
    }
    BOOST_OUTCOME_TRY(pair.sigma_m, table.number(sigma));
    out.pairs.push_back(std::move(pair));
  }
}

void print(const Pairs& pairs, const FrameFit& fit) {
  const auto& t = fit.transform;
  std::printf("%d parameters from %zu pairs, %d redundant; residuals %.3f m rms\n",
              t.model == FrameModel::four ? 4 : 7, pairs.pairs.size(), fit.dof, fit.rms_m);
  if (pairs.origin)
    std::printf("ENU origin   %.9f, %.9f, %.3f m (longitude, latitude, ellipsoidal height)\n",
                pairs.origin->lon_deg, pairs.origin->lat_deg, pairs.origin->height_m);
  std::printf("shift        %.4f, %.4f, %.4f m (east, north, up of the local origin)\n", t.shift_m.x(),
              t.shift_m.y(), t.shift_m.z());
  std::printf("yaw          %.5f degrees from east to the local x axis, counter-clockwise; tilt %.4f\n",
              t.yaw_deg(), t.tilt_deg());
  std::printf("scale        %.7f\n", t.scale);
  if (fit.covariance)
    std::printf("sigma        %.4f, %.4f, %.4f m at the centroid; yaw %.5f degrees; scale %.1f ppm\n",
                std::sqrt((*fit.covariance)(0, 0)), std::sqrt((*fit.covariance)(1, 1)),
                std::sqrt((*fit.covariance)(2, 2)), std::sqrt((*fit.covariance)(5, 5)) * 57.29577951308232,
                std::sqrt((*fit.covariance)(6, 6)) * 1e6);
  std::printf("%-16s %9s %9s %9s   from where the other pairs place it\n", "pair", "de m", "dn m", "du m");
  for (std::size_t i = 0; i < pairs.pairs.size(); ++i) {
    const auto& r = fit.residuals[i];
    const std::string name = pairs.pairs[i].name.empty() ? std::to_string(i + 1) : pairs.pairs[i].name;
    std::printf("%-16s %9.4f %9.4f %9.4f   ", one_line(name).c_str(), r.residual_m.x(), r.residual_m.y(),
                r.residual_m.z());
    if (r.left_out_m)
      std::printf("%.4f m\n", r.left_out_m->norm());
    else
      std::printf("unknown\n");
  }
  for (const auto& note : fit.notes) std::printf("note: %s\n", printable(note).c_str());
}

int fit_command(const Arguments& a) {
  const auto pairs = read_pairs(a.pairs);
  if (!pairs) {
    std::fprintf(stderr, "anchord: %s\n", printable(pairs.error().message).c_str());
    return 2;
  }
  FrameFitOptions options;
  options.model = a.parameters == 4 ? FrameModel::four : FrameModel::seven;
  options.fit_scale = !a.fixed_scale;
  const auto fit = fit_frame(pairs.value().pairs, options);
  if (!fit) {
    std::fprintf(stderr, "anchord: %s: %s\n", a.pairs.c_str(), printable(fit.error().message).c_str());
    return fit.error().code == Errc::invalid_argument ? 2 : 1;
  }
  if (a.json) {
    auto json = api::frame_fit_json(fit.value(), pairs.value().pairs);
    json["origin"] = nullptr;
    if (const auto& at = pairs.value().origin)
      json["origin"] = {{"lon", at->lon_deg}, {"lat", at->lat_deg}, {"h_m", at->height_m}};
    std::printf("%s\n", to_wire(json, 1).c_str());
  } else {
    print(pairs.value(), fit.value());
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}

}  // namespace

void add_frame_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("frame", "Transforms between local frames of positioning systems and the globe");
  command->require_subcommand(1);
  auto* fit = command->add_subcommand(
      "fit", "Fit the transform from local to global coordinates from pairs of points");
  auto a = std::make_shared<Arguments>();
  fit->add_option(
         "pairs", a->pairs,
         "CSV with x_m, y_m, z_m and lon_deg, lat_deg, h_m (or e_m, n_m, u_m); name and sigma_m optional")
      ->required();
  fit->add_option("--parameters", a->parameters, "4: plane similarity and height shift; 7: Helmert")
      ->check(CLI::IsMember({4, 7}));
  fit->add_flag("--fixed-scale", a->fixed_scale, "Fix the scale to 1");
  fit->add_flag("--json", a->json, "Print the transform as JSON");
  fit->callback([a, &exit_code] { exit_code = fit_command(*a); });
}

}  // namespace anchord::cli
