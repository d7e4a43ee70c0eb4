#include "api/formats/binary_file.hpp"

#include <algorithm>
#include <array>

namespace anchord::api {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t k_looked_at = 4096;

struct Kind {
  std::string_view magic, what;
};
constexpr std::array k_kinds{
    Kind{"PK\x03\x04"sv,
         "a zip archive or an Excel workbook (.zip, .xlsx): unpack it, or save the sheet as CSV UTF-8"},
    Kind{"PK\x05\x06"sv, "an empty zip archive"},
    Kind{"\x1F\x8B"sv, "gzip: unpack it first (gunzip)"},
    Kind{"\xD0\xCF\x11\xE0"sv, "an Excel workbook of the old kind (.xls): save the sheet as CSV UTF-8"},
    Kind{"MATLAB 5.0 MAT-file"sv, "a MATLAB file (.mat): write the table with writetable as CSV"},
    Kind{"\x89HDF"sv, "HDF5 (.h5, or .mat of MATLAB 7.3): write the table as CSV"},
    Kind{"#ROSBAG"sv, "a ROS bag: write the topic as CSV (rostopic echo -b FILE -p TOPIC)"},
    Kind{"\x89MCAP0"sv, "an MCAP recording: write the topic as CSV"},
    Kind{"SQLite format 3"sv, "an SQLite database (a ROS 2 bag is one): write the table as CSV"},
    Kind{"ULog\x01"sv, "a PX4 ULog: convert it with ulog2csv"},
    Kind{"\xA3\x95"sv, "a log of ArduPilot (.bin): convert it with mavlogdump.py --format csv"},
    Kind{"PAR1"sv, "Parquet: write the table as CSV"},
    Kind{"ARROW1"sv, "Feather: write the table as CSV"},
    Kind{"\x93NUMPY"sv, "an array of NumPy (.npy): write it with numpy.savetxt as CSV"},
    Kind{"%PDF"sv, "a PDF: a table in CSV is needed"},
    Kind{"7z\xBC\xAF"sv, "a 7z archive: unpack it first"},
    Kind{"\xFD\x37zXZ"sv, "xz: unpack it first"},
    Kind{"BZh"sv, "bzip2: unpack it first"},
    Kind{"\x28\xB5\x2F\xFD"sv, "zstd: unpack it first"}};

bool is_control(char c) {
  const auto u = static_cast<unsigned char>(c);
  return u < 0x20 && c != '\t' && c != '\n' && c != '\r' && c != '\f' && c != '\v' && c != '\x1A';
}

}  // namespace

std::string binary_file(std::string_view bytes) {
  for (const auto& kind : k_kinds)
    if (bytes.starts_with(kind.magic)) return std::string(kind.what);
  // UTF-16 is text, and its reader says what it is where it has no mark.
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF")) return {};
  const auto begin = bytes.substr(0, k_looked_at);
  const auto zero = begin.find('\0');
  const auto controls = std::ranges::count_if(begin, [](char c) { return c != '\0' && is_control(c); });
  if (controls > 0 && (zero != std::string_view::npos || 50 * controls > std::ssize(begin)))
    return "a binary file, no text: a table in CSV is needed";
  return {};
}

}  // namespace anchord::api
