#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "core/base/locked.hpp"
#include "core/base/steady.hpp"
#include "core/ports/backups.hpp"

namespace anchord {
class Database;
}

namespace anchord::server {

/// Backups of one database in one folder, named anchord-<number>-<UTC time>.db; other files there are left
/// alone. The number says which is newer: a clock that ran ahead must not make every later backup the oldest.
/// The files of impulse responses that they need are in its folder cir-archive, each once.
class BackupKeeper final : public Backups {
 public:
  static constexpr std::size_t k_fewest =
      7;  ///< whole ones that are always left, whatever Options::keep says
  struct Options {
    std::filesystem::path dir;
    std::size_t keep{k_fewest};  ///< whole ones; what is older than the last of them goes, whole or not
    std::size_t every_h{24};
    bool scheduled{true};                               ///< false: only when asked for
    const SteadyClock* steady{&system_steady_clock()};  ///< what the schedule runs on
  };
  BackupKeeper(Database& database, const Clock& clock, Options options);
  Result<Backup> make(const std::function<bool()>& go_on) override;
  std::vector<Backup> list() const override;
  BackupState state() const override { return state_.copy(); }
  bool due(std::uint64_t flights_ended) override;

 private:
  /// What was found of a file when it was read whole.
  struct Checked {
    std::uint64_t bytes{};
    std::filesystem::file_time_type written{};
    SteadyTime at{};
    bool good{false};
  };
  struct Due {
    std::optional<SteadyTime> newest{};  ///< when the newest was made, or the first look
    SteadyTime not_before{};
    std::uint64_t flights_saved{0};
  };
  Result<Backup> copy_now(const std::function<bool()>& go_on);
  SteadyTime steady_now() const;
  SteadyTime first_look(SteadyTime now) const;
  bool whole(const Backup& backup);
  void note_checked(const std::string& name, bool good);
  void drop_old();

  Database& database_;
  const Clock& clock_;
  const Options options_;
  std::mutex making_;  ///< one backup at a time; taken before the others
  Locked<std::map<std::string, Checked>> checked_;
  Locked<Due> due_;
  Locked<BackupState> state_;
};

/// Of a database that is copied by programs of its own: makes none, and says so.
class NoBackups final : public Backups {
 public:
  explicit NoBackups(std::string why) : why_(std::move(why)) {}
  Result<Backup> make(const std::function<bool()>&) override { return *refusal(); }
  std::vector<Backup> list() const override { return {}; }
  BackupState state() const override { return {}; }
  bool due(std::uint64_t) override { return false; }
  std::optional<Error> refusal() const override { return make_error(Errc::unsupported, why_); }

 private:
  const std::string why_;
};

}  // namespace anchord::server
