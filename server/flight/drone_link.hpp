#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/ports/drone.hpp"
#include "drivers/mavlink/frame.hpp"

namespace anchord::flight {

/// The aircraft at an address (drivers/link/address.hpp): a MAVLink session behind a socket or a serial port
/// on a thread of its own from start() on. A lost link is opened again each second. Thread-safe.
class DroneLink final : public Drone {
 public:
  /// `log`: one line for the operator's log. `key`: of MAVLink 2 signing; frames without it are refused.
  /// errors  invalid_argument: the address
  static Result<std::unique_ptr<DroneLink>> open(const std::string& address,
                                                 std::function<void(std::string_view)> log,
                                                 const std::optional<mavlink::Secret>& key = {});
  ~DroneLink() override;
  /// Once, after expect(): nobody is heard before.
  void start();

  void new_flight(double speed_mps) override;
  void end_flight() override;
  std::uint64_t take_off(double above_ground_m) override;
  std::uint64_t go_to(double lat_deg, double lon_deg, double height_m,
                      std::optional<double> heading_deg) override;
  void steer(double lat_deg, double lon_deg, double height_m) override;
  std::uint64_t hold() override;
  std::uint64_t return_home() override;
  std::uint64_t land() override;
  std::uint64_t disarm() override;
  std::uint64_t upload_route(const std::vector<RoutePoint>& route) override;
  std::uint64_t upload_fence(const DroneFence& fence) override;
  void ask_parameters(const std::vector<std::string>& names) override;
  void take_back() override;
  void change_peer(const std::string& sender) override;
  void expect(const DroneIdentity& aircraft) override;
  DroneStatus status() const override;
  std::vector<CommandReport> take_reports() override;

 private:
  struct Impl;
  explicit DroneLink(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace anchord::flight
