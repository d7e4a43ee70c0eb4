#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/foreign_table.hpp"

namespace anchord::api {

/// What a column of a flight's tables can be, and the names under which loggers write it, the usual one
/// first.
struct FieldNames {
  std::string_view field, names;
};
/// As web/src/views/start/fields.ts has them: tests/data/import/columns.json holds both.
inline constexpr std::array k_foreign_fields{
    FieldNames{"time",
               "t_s t_us t_ms t_ns time time_s time_ms time_us time_ns time_utc time_utc_usec "
               "timestamp timestamp_s timestamp_ms timestamp_us timestamp_ns t utc gpst gps_time unix "
               "datetime date_time zeit time_unix_usec time_usec timeus timems time_boot_ms t_utc"},
    FieldNames{"zone", "tz timezone time_zone utc_offset tz_offset gmt_offset zeitzone"},
    FieldNames{"lat", "lat_deg lat latitude latitude_deg breite"},
    FieldNames{"lon", "lon_deg lon lng longitude longitude_deg laenge"},
    FieldNames{"lat_hemisphere",
               "n_s ns lat_dir latitude_dir lat_direction latitude_direction lat_ref latitude_ref lat_hemi "
               "lat_hemisphere latitude_hemisphere lat_ns north_south ns_indicator n_s_indicator hemisphere"},
    FieldNames{
        "lon_hemisphere",
        "e_w ew lon_dir longitude_dir lon_direction longitude_direction lon_ref longitude_ref lon_hemi "
        "lon_hemisphere longitude_hemisphere lon_ew east_west ew_indicator e_w_indicator lng_dir "
        "lng_ref hemisphere"},
    FieldNames{"height",
               "h_m h_ell h_ell_m height_ell hoehe_ell ell_height "
               "ellipsoidal_height height_ellipsoid height_ellipsoid_m ellipsoid_height "
               "altitude_ellipsoid_m alt_ellipsoid alt_hae hae alt_m height_m alt altitude height h "
               "altitude_m hoehe alt_msl alt_msl_m altitude_msl altitude_msl_m height_msl "
               "height_msl_m msl hmsl orthometric_height"},
    FieldNames{"separation",
               "geoid_separation geoid_separation_m geoid_sep geoidal_separation undulation "
               "undulation_m geoid_height geoid_height_m geoid_undulation"},
    FieldNames{"x",
               "x_m x e_m east east_m easting easting_m e rechtswert ostwert x_ecef_m ecef_x ecef_x_m "
               "e_baseline_m pe pe_m pos_e pos_e_m x_ned ned_x pos_ned_x pos_ned_0"},
    FieldNames{"y",
               "y_m y n_m north north_m northing northing_m n hochwert nordwert y_ecef_m ecef_y "
               "ecef_y_m n_baseline_m pn pn_m pos_n pos_n_m y_ned ned_y pos_ned_y pos_ned_1"},
    FieldNames{"z",
               "z_m z u_m up up_m z_ecef_m ecef_z ecef_z_m u_baseline_m pd pd_m pos_d pos_d_m down down_m "
               "z_ned ned_z pos_ned_z pos_ned_2"},
    FieldNames{"fix", "fix fix_type quality fix_quality gps_qual rtk q carrsoln status"},
    FieldNames{"sigma_h", "sd_h_m sigma_h_m hacc h_acc sd_h"},
    FieldNames{"sigma_v", "sd_v_m sigma_v_m vacc v_acc sd_v sdu_m sigma_u_m"},
    FieldNames{"sigma_e", "sde_m sigma_e_m"},
    FieldNames{"sigma_n", "sdn_m sigma_n_m"},
    FieldNames{"age", "correction_age_s age_s age"},
    FieldNames{"satellites", "satellites sats num_sv ns nsats satellites_used"},
    FieldNames{"heading", "heading_deg heading yaw_deg yaw"},
    FieldNames{"qx", "qx"},
    FieldNames{"qy", "qy"},
    FieldNames{"qz", "qz"},
    FieldNames{"qw", "qw"},
    FieldNames{"anchor",
               "anchor_id anchor anchor_address anchor_name remote remote_id dest destination anker"},
    FieldNames{"range",
               "range_m distance_m range distance dist range_mm distance_mm dist_m dist_mm range_cm "
               "distance_cm abstand entfernung entfernung_m entfernung_cm entfernung_mm"},
    FieldNames{"tag", "tag_id tag tag_address source local_id"},
    FieldNames{"rss", "rss_dbm rss rssi"},
    FieldNames{"rx", "rx_dbm rx_power rx"},
    FieldNames{"fp", "fp_dbm fp_power first_path_dbm"},
    FieldNames{"seq", "seq sequence"},
    FieldNames{"antenna", "antenna"},
    FieldNames{"kind", "kind"}};

/// Field -> name of its column.
using ForeignColumns = std::map<std::string, std::string, std::less<>>;

/// "Range [m]" -> "range_m"
std::string plain_name(std::string_view name);
ForeignColumns guessed_track_columns(const ForeignTable& table);
ForeignColumns guessed_range_columns(const ForeignTable& table);
/// Fields without which there is no flight and that have no column.
std::vector<std::string> missing_track_fields(const ForeignColumns& columns);
std::vector<std::string> missing_range_fields(const ForeignColumns& columns);

/// What the numbers of a track's places are.
enum class PlaceKind : std::uint8_t { degrees, degrees_1e7, no_degrees, local, map, ecef };
/// x, y, z in place of latitude, longitude, height.
bool is_local(const ForeignColumns& columns);
PlaceKind place_kind(const ForeignTable& table, const ForeignColumns& columns);

}  // namespace anchord::api
