#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/ports/devices.hpp"

namespace anchord::server {

/// "kind=address" of the setting devices, without an id. errors: invalid_argument
Result<DeviceConfig> parse_device_setting(const std::string& text);

struct DeviceManagerOptions {
  std::filesystem::path data_dir;         ///< devices.json and recordings/ are in it
  std::vector<std::string> from_config;   ///< "kind=address"; added when no device has the address
  std::size_t max_waiting_rows{100'000};  ///< for the database
  std::function<void(const std::string& text)> log{};
};

/// The devices of this server: settings in `devices.json`, supervisors and drivers on one thread of their
/// own, raw recordings; rows go to the live flight by a second thread (each 20 ms or 200 rows) and to the
/// database by a third (each 100 ms), so that no flight waits for a disk.
///
/// At most max_waiting_rows wait for the database; then the oldest leave, counted (the recording has the
/// bytes).
class DeviceManager final : public DeviceControl {
 public:
  /// errors: invalid_argument (from_config)
  static Result<std::unique_ptr<DeviceManager>> open(DeviceManagerOptions options);
  ~DeviceManager() override;

  /// Rows go here from now on; devices are started. Once.
  void start(DeviceRows& rows);
  /// Closes every link, hands on what waits. Idempotent.
  void stop();

  std::vector<DeviceReport> devices() override;
  Result<DeviceReport> device(const Uuid& id) override;
  Result<DeviceReport> add(DeviceConfig config) override;
  Result<DeviceReport> change(DeviceConfig config, std::uint64_t expected_version) override;
  Result<void> remove(const Uuid& id, std::uint64_t expected_version) override;
  Result<std::string> act(const Uuid& id, std::string_view action, std::string_view arguments_json) override;
  std::vector<DiscoveredDevice> discover() override;
  std::vector<DiscoveredDevice> discovered() override;
  DeviceClock clock() override;
  void record_into(const std::optional<MissionId>& mission) override;
  std::optional<MissionId> recording_into() override;
  std::string recorder_failure() override;
  std::string not_started() override;

  /// Rows that were not stored in time; the recording has their bytes.
  std::uint64_t rows_lost();
  /// Devices that send more ids than a flight follows, one line; empty: none.
  std::string too_many_ids();
  std::string unused_sources();
  /// Devices whose base of corrections moved or changed in this flight, one line; empty: none.
  std::string moved_bases();
  /// What the raw recordings take of the disk, where they are and which device writes most of them, one line;
  /// empty: nothing worth moving.
  std::string recordings_on_disk();
  /// Prometheus text of all devices.
  std::string metrics();

 private:
  class Impl;
  explicit DeviceManager(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace anchord::server
