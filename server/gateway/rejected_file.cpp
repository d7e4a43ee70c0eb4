#include "server/gateway/rejected_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "server/gateway/row_lines.hpp"

namespace anchord::gateway {
namespace {

namespace fs = std::filesystem;
using Ordered = nlohmann::ordered_json;

constexpr std::uintmax_t k_turn_over_bytes = 64u << 20;

std::string_view cut(std::string_view& rest) {
  const auto end = std::min(rest.find(','), rest.size());
  const auto cell = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return cell;
}

/// Our CSV has no quotes.
Ordered row_json(Lines lines, std::string_view line) {
  auto header = header_of(lines);
  if (header.empty()) return Ordered::parse(line, nullptr, false);
  header.remove_suffix(1);
  Ordered out = Ordered::object();
  while (!header.empty()) {
    const auto name = cut(header), cell = cut(line);
    if (!cell.empty()) out[std::string(name)] = cell;
  }
  return out;
}

Error failed(const fs::path& file, int error) {
  return make_error(error == ENOSPC || error == EDQUOT ? Errc::storage_full : Errc::storage_unavailable,
                    file.string() + ": " + std::strerror(error));
}

Result<void> write_synced(int fd, const fs::path& file, std::string_view text) {
  while (!text.empty()) {
    const auto n = ::write(fd, text.data(), text.size());
    if (n < 0 && errno != EINTR) return failed(file, errno);
    if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
  }
  if (::fsync(fd) != 0) return failed(file, errno);
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> RejectedFile::append(const std::vector<RejectedRow>& rows, UtcTime now) {
  std::string text;
  for (const auto& row : rows) {
    const Ordered line{{"at", to_rfc3339(now)},
                       {"mission", to_string(row.mission)},
                       {"kind", row.lines == Lines::fixes_csv ? "fix" : "range"},
                       {"code", row.code},
                       {"detail", row.detail},
                       {"row", row_json(row.lines, row.line)}};
    text += to_wire(line) + "\n";
  }
  std::error_code ignored;
  if (const auto size = fs::file_size(path(), ignored); !ignored && size > k_turn_over_bytes)
    fs::rename(path(), dir_ / "rejected.old.ndjson", ignored);
  const int fd = ::open(path().c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (fd < 0) return failed(path(), errno);
  auto written = write_synced(fd, path(), text);
  ::close(fd);
  return written;
}

}  // namespace anchord::gateway
