#include "api/stream/frames.hpp"

#include <cstdio>

namespace anchord::api {
namespace {

void append_elements(std::string& out, const std::vector<LiveElement>& elements, bool as_array) {
  const bool bracket = as_array || elements.size() != 1;
  if (bracket) out += '[';
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (i != 0) out += ',';
    out += *elements[i].json;
  }
  if (bracket) out += ']';
}

}  // namespace

std::shared_ptr<const std::string> data_frame(std::uint64_t sub, std::uint64_t seq, std::uint64_t prev,
                                              std::int64_t t_us, const std::vector<LiveElement>& elements,
                                              bool as_array, std::uint64_t conflated) {
  auto out = std::make_shared<std::string>();
  std::size_t size = 128;
  for (const auto& element : elements) size += element.json->size() + 1;
  out->reserve(size);
  *out += R"({"op":"data","sub":)" + std::to_string(sub) + ",\"seq\":" + std::to_string(seq) +
          ",\"prev\":" + std::to_string(prev) + ",\"t_us\":" + std::to_string(t_us);
  if (conflated > 0) *out += ",\"conflated\":" + std::to_string(conflated);
  *out += ",\"data\":";
  append_elements(*out, elements, as_array);
  *out += '}';
  return out;
}

std::string snap_frame(std::uint64_t sub, std::uint64_t seq, std::int64_t t_us,
                       const std::vector<LiveElement>& elements, bool as_array) {
  std::string out = R"({"op":"snap","sub":)" + std::to_string(sub) + ",\"seq\":" + std::to_string(seq) +
                    ",\"t_us\":" + std::to_string(t_us) + ",\"data\":";
  if (!as_array && elements.empty())
    out += "null";
  else
    append_elements(out, elements, as_array);
  return out + '}';
}

std::string gap_frame(std::uint64_t sub, std::uint64_t from_seq, std::uint64_t to_seq,
                      std::uint64_t dropped) {
  return R"({"op":"gap","sub":)" + std::to_string(sub) + ",\"from_seq\":" + std::to_string(from_seq) +
         ",\"to_seq\":" + std::to_string(to_seq) + R"(,"reason":"slow_consumer","dropped":)" +
         std::to_string(dropped) + '}';
}

std::string heartbeat_frame(std::int64_t t_us, double queue, bool conflating) {
  char number[32];
  std::snprintf(number, sizeof number, "%.2f", queue);
  return R"({"op":"hb","t_us":)" + std::to_string(t_us) + ",\"queue\":" + number +
         ",\"conflating\":" + (conflating ? "true" : "false") + '}';
}

std::string bye_frame(std::uint16_t code, std::string_view reason) {
  return R"({"op":"bye","code":)" + std::to_string(code) + R"(,"reason":")" + std::string(reason) +
         R"(","retry_ms":2000})";
}

}  // namespace anchord::api
