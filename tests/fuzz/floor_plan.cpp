// The file of a floor plan: its head is read in the server, a DXF in the worker; what is accepted is finite
// and bounded.
#include <cstdint>
#include <span>

#include "core/floor_plan/dxf.hpp"
#include "core/floor_plan/image_head.hpp"
#include "tests/fuzz/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord;
  const auto bytes = std::as_bytes(std::span(data, size));
  if (const auto head = floor_plan::image_head(bytes)) {
    const auto [width, height] = std::pair{head.value().width_px, head.value().height_px};
    fuzz::require(width > 0 && height > 0 && width * height <= floor_plan::k_max_image_pixels,
                  "an accepted picture has a size within the limit");
    fuzz::require(!floor_plan::is_dxf(bytes), "a picture is no drawing");
  }
  const auto drawing = floor_plan::read_dxf(bytes);
  if (!drawing) {
    fuzz::require(!drawing.error().message.empty(), "a refusal has its words");
    return 0;
  }
  fuzz::require(!drawing.value().lines.empty(), "what is accepted has a line");
  for (const auto& line : drawing.value().lines)
    fuzz::require(line.from.allFinite() && line.to.allFinite(), "lines are finite");
  return 0;
}
