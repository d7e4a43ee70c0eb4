#include "core/floor_plan/pdf.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "core/floor_plan/image_head.hpp"

namespace anchord::floor_plan {
namespace {

constexpr double k_points_per_inch = 72;
constexpr double k_least_dpi = 10;

/// What stands behind a label that begins a line, without the blanks before it.
std::optional<std::string_view> value_of(std::string_view text, std::string_view label) {
  for (std::size_t at = 0; at < text.size();) {
    const auto end = std::min(text.find('\n', at), text.size());
    const auto line = text.substr(at, end - at);
    if (line.starts_with(label)) {
      const auto begin = line.find_first_not_of(' ', label.size());
      return begin == std::string_view::npos ? std::string_view() : line.substr(begin);
    }
    at = end + 1;
  }
  return std::nullopt;
}

std::optional<double> number(std::string_view& text) {
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || !std::isfinite(value)) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

}  // namespace

bool is_pdf(std::span<const std::byte> bytes) {
  constexpr std::size_t k_before = 1024;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                              std::min(bytes.size(), k_before + 5));
  return text.find("%PDF-") != std::string_view::npos;
}

Result<PdfPage> read_pdf_info(std::string_view text, int page) {
  PdfPage out;
  if (auto pages = value_of(text, "Pages:")) {
    if (const auto n = number(*pages); n && *n >= 1 && *n < 1e6) out.pages = static_cast<int>(*n);
  }
  if (out.pages == 0) return make_error(Errc::bad_frame, "the PDF has no pages: export it again");
  if (page < 1 || page > out.pages)
    return make_error(Errc::invalid_argument, "the PDF has " + std::to_string(out.pages) +
                                                  " pages and no page " + std::to_string(page));
  // "Page    2 size:  842 x 595 pts (A4)"; the number is padded to four.
  auto name = std::to_string(page);
  name.insert(0, name.size() < 4 ? 4 - name.size() : 0, ' ');
  auto size = value_of(text, "Page " + name + " size:");
  const auto width = size ? number(*size) : std::nullopt;
  if (width && size->starts_with(" x ")) size->remove_prefix(3);
  const auto height = width ? number(*size) : std::nullopt;
  if (!width || !height || *width <= 0 || *height <= 0)
    return make_error(Errc::bad_frame,
                      "page " + std::to_string(page) + " of the PDF has no size: export it again");
  out.width_pt = *width;
  out.height_pt = *height;
  auto turned = value_of(text, "Page " + name + " rot:");
  const auto degrees = turned ? number(*turned) : std::nullopt;
  if (degrees && std::fmod(std::abs(*degrees), 180) == 90) std::swap(out.width_pt, out.height_pt);
  return out;
}

Result<double> drawable_dpi(const PdfPage& page, double wanted) {
  const double width_in = page.width_pt / k_points_per_inch, height_in = page.height_pt / k_points_per_inch;
  // A row and a column may be added by rounding up.
  const double most = std::min((k_max_image_side_px - 1) / std::max(width_in, height_in),
                               std::sqrt(0.99 * k_max_image_pixels / (width_in * height_in)));
  if (most < k_least_dpi)
    return make_error(Errc::invalid_argument, "the page is " +
                                                  std::to_string(std::llround(width_in * 0.0254)) + " x " +
                                                  std::to_string(std::llround(height_in * 0.0254)) +
                                                  " m of paper (limit 25 m): export it on a smaller sheet");
  return std::min(wanted, most);
}

}  // namespace anchord::floor_plan
