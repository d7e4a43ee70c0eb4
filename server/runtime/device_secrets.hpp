#pragma once

#include <filesystem>
#include <string>

#include "core/base/result.hpp"
#include "core/ports/devices.hpp"

namespace anchord::server {

/// Passwords of devices: one file each in `secrets/` of the data folder (0700, files 0600). They come over
/// REST, are read by the driver alone, and are in no answer, no setting and no log. One thread at a time.
class DeviceSecrets {
 public:
  explicit DeviceSecrets(std::filesystem::path data_dir) : folder_(std::move(data_dir) / "secrets") {}

  /// Takes `password` out of the options of a device that is to be set up or changed, and says in
  /// `password_set` whether it has one. `before` is what it was; null: new. Nothing is stored yet. errors
  /// invalid_argument: the address changes and the password of the old one would go to the new one
  struct Change {
    DeviceConfig config;
    bool given{false};     ///< there was a password, or the wish to forget it
    std::string password;  ///< of `given`; empty: forget
  };
  static Result<Change> split(DeviceConfig config, const DeviceConfig* before);
  /// Stores or forgets. errors: storage_full, storage_unavailable
  Result<void> store(const Change& change) const;
  void forget(const Uuid& id) const;
  /// Back to what a change replaced, when the change fails; empty: there was none.
  std::string kept(const Uuid& id) const;
  void put_back(const Uuid& id, const std::string& password) const;
  /// Options as the driver takes them: with the file, where there is a password.
  std::string driver_options(const DeviceConfig& config) const;

  /// Of a devices.json of before 0.6, where a file could be named over REST: takes that name out. Returns
  /// whether there was one.
  static bool drop_password_file(DeviceConfig& config);

 private:
  std::filesystem::path file(const Uuid& id) const { return folder_ / to_string(id); }
  const std::filesystem::path folder_;
};

}  // namespace anchord::server
