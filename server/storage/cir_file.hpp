#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/range.hpp"

namespace anchord::sql {

/// SHA-256 of all that an impulse response is.
using CirDigest = std::array<std::uint8_t, 32>;
CirDigest digest_of(const Cir& cir);

/// Where the files of the archive are: MISSION-N.db, of which the one with the highest N has everything.
/// Copies of it are the same folder.
class CirFolder {
  struct Holds {
    int n{0};
    std::vector<std::filesystem::path> waiting;  ///< removed when nobody holds any more
  };

 public:
  CirFolder() = default;  ///< nowhere: nothing is found
  explicit CirFolder(std::filesystem::path dir) : dir_(std::move(dir)) {}

  const std::filesystem::path& dir() const { return dir_; }
  std::string place() const;  ///< "HOST:/folder"
  /// Newest first.
  std::vector<std::filesystem::path> files(const MissionId& mission) const;
  /// A name that no file has.
  std::filesystem::path next(const MissionId& mission) const;
  /// All files of a mission but this one; where the folder is held, when it is no longer.
  void remove_others(const MissionId& mission, const std::filesystem::path& keep) const;
  /// While one lives, no file goes: a copy of the database names those that were there when it was begun.
  class Hold {
   public:
    explicit Hold(std::shared_ptr<Locked<Holds>> holds);
    ~Hold();
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

   private:
    const std::shared_ptr<Locked<Holds>> holds_;
  };
  Hold hold() const { return Hold(holds_); }
  /// What a process that died was writing.
  void remove_parts() const;

 private:
  std::filesystem::path dir_;
  std::shared_ptr<Locked<Holds>> holds_{std::make_shared<Locked<Holds>>()};
};

/// Writes one file under another name; it has its own when finish() succeeded. What is given up is deleted.
class CirFileWriter {
 public:
  static Result<std::unique_ptr<CirFileWriter>> create(const CirFolder& folder, const MissionId& mission);
  virtual ~CirFileWriter() = default;
  /// A range with its impulse response. errors: storage_full, storage_unavailable
  virtual Result<void> add(const Range& range) = 0;
  struct Written {
    std::filesystem::path file;
    std::string sha256_hex;
    std::uint64_t bytes{};
  };
  /// Closes and syncs the file, gives it its name, syncs that.
  virtual Result<Written> finish() = 0;
};

/// Reads every impulse response of a file in the order in which it was written, and compares it with the
/// digest. False from `go_on`: stop. errors: storage_unavailable, naming what differs; canceled
Result<void> check_cir_file(const std::filesystem::path& file, const std::vector<CirDigest>& digests,
                            const std::function<bool()>& go_on);

/// Finds impulse responses in the files; opened as they are needed. One thread.
class CirFinder {
 public:
  explicit CirFinder(const CirFolder& folder);
  ~CirFinder();
  CirFinder(const CirFinder&) = delete;
  CirFinder& operator=(const CirFinder&) = delete;

  /// Of this range, whose mission is filled in; it has this digest. errors: storage_unavailable, saying which
  /// file is missing or damaged.
  Result<Cir> find(const Range& range, const CirDigest& digest);

 private:
  class File;
  const CirFolder& folder_;
  std::map<MissionId, std::vector<std::unique_ptr<File>>> open_;
};

}  // namespace anchord::sql
