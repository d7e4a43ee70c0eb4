#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "tests/paths.hpp"

namespace anchord::pozyx {

/// One question of the host and the tag's answer, if it has one.
struct Exchange {
  std::string question, answer;
};

/// tests/data/captures/pozyx/NAME; README.md there.
inline std::vector<Exchange> transcript(const std::string& name) {
  std::ifstream file(std::string(ANCHORD_TEST_DATA) + "/captures/pozyx/" + name);
  std::vector<Exchange> out;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("> ")) out.push_back({line.substr(2), {}});
    if (line.starts_with("< ")) out.back().answer = line.substr(2);
  }
  return out;
}

}  // namespace anchord::pozyx
