#pragma once

#include <optional>
#include <string_view>
#include <variant>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::nmea {

/// Fields as sent; an empty field is absent, never zero. Talkers (GP, GN, ...) do not matter.
struct Gga {
  std::optional<std::int64_t> tod_ns;
  std::optional<double> lat_deg, lon_deg;
  std::optional<int> quality, satellites;
  std::optional<double> hdop, height_msl_m, geoid_separation_m, age_s;
};
/// The same with one mode letter per satellite system; quality is GGA's digit for the best of them.
struct Gns : Gga {};
struct Rmc {
  std::optional<std::int64_t> tod_ns, days;  ///< days since 1970-01-01
  bool valid{false};
  std::optional<double> lat_deg, lon_deg, speed_mps, course_deg;
  char mode{0};  ///< A, D, R, F, P, E, N; 0 before NMEA 2.3
};
struct Gst {
  std::optional<std::int64_t> tod_ns;
  std::optional<double> sigma_lat_m, sigma_lon_m, sigma_height_m;
};
struct Gsa {
  std::optional<double> pdop, hdop, vdop;
};
struct Vtg {
  std::optional<double> course_deg, speed_mps;
};
struct Zda {
  std::optional<std::int64_t> tod_ns, days;
};
/// A good sentence that carries nothing needed here.
struct Other {};
using Message = std::variant<Other, Gga, Gns, Rmc, Gst, Gsa, Vtg, Zda>;

/// The text between $ and *, checksum already checked. errors: bad_frame, naming the field. Pure.
Result<Message> parse(std::string_view sentence);

/// How GST's two horizontal sigmas are read.
enum class GstOrder : std::uint8_t {
  /// The larger of the two for both axes: the open Reach encoder prints east where north belongs, others do
  /// not,
  /// and nothing in the stream tells which.
  larger_for_both,
  standard,  ///< latitude, longitude: where the maker is known to be right
};
inline constexpr auto k_gst_order_words =
    enum_table<GstOrder>({{"larger_for_both", GstOrder::larger_for_both}, {"standard", GstOrder::standard}});

/// Joins the sentences of one time into an epoch, which is published when the next time begins.
///
/// The position is GGA's, else GNS's, else that of a valid RMC. The date comes from RMC or ZDA (or
/// set_reference) and runs on over midnight; epochs before the first date wait, at most 600 of them. Sigmas
/// of the last GST serve for 2 s while the quality stays. Not thread-safe.
class Assembler {
 public:
  explicit Assembler(GstOrder order = GstOrder::larger_for_both) : order_(order) {}
  /// One frame; false when it says the same epoch again (some receivers repeat the last GGA after a loss).
  bool add(const Message& message, Epochs& out);
  void finish(Epochs& out);
  /// Publishes what is being collected when it holds a position; epochs without a date go on waiting.
  void quiet(Epochs& out);
  /// A time known from elsewhere, e.g. from UBX on the same wire.
  void set_reference(UtcTime time);

 private:
  struct Group {
    std::optional<std::int64_t> tod_ns;
    std::optional<Gga> gga;
    std::optional<Gns> gns;
    std::optional<Rmc> rmc;
    std::optional<Gst> gst;
    std::optional<Zda> zda;
    std::optional<double> hdop;
    bool any{false};

    const Gga* position() const { return gga ? &*gga : gns ? &*gns : nullptr; }
    bool has_position() const { return position() != nullptr || (rmc && rmc->valid); }
  };
  template <class T>
  bool put(std::optional<T>& slot, const T& value, Epochs& out);
  void publish(Epochs& out);
  void emit(Epoch epoch, std::optional<std::int64_t> tod_ns, Epochs& out);
  void flush(Epochs& out);
  void apply_sigmas(const Group& group, Epoch& epoch);

  GstOrder order_;
  Group group_;
  std::optional<UtcTime> reference_;  ///< last instant known with its date
  struct KeptSigmas {
    Gst gst;
    std::int64_t tod_ns;
    int quality;
  };
  std::optional<KeptSigmas> kept_;
  Epochs waiting_;  ///< without a date yet
};

}  // namespace anchord::gnss::nmea
