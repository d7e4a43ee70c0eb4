// A flight folder from anywhere: flight.json, track and ranges, separated by a zero byte in the input.
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "api/formats/flight_folder.hpp"
#include "tests/fuzz/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  static const std::filesystem::path folder = [] {
    // One folder per process: libFuzzer may run several side by side.
    auto path = std::filesystem::temp_directory_path() / ("anchord-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    return path;
  }();
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  for (const char* name : {"flight.json", "track.csv", "ranges.csv"}) {
    const std::size_t end = rest.find('\0');
    std::ofstream(folder / name, std::ios::binary) << rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  }
  const auto flight = read_flight_folder(folder);
  if (!flight) fuzz::require(!flight.error().message.empty(), "an error has words");
  return 0;
}
