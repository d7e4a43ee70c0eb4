#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

/// A page of a PDF as a floor plan. Programs of poppler read and draw the document, in the worker's sandbox;
/// here is what is asked of them and what their answers mean.
namespace anchord::floor_plan {

/// Whether a file begins as a PDF does; readers allow up to 1024 bytes of something else before.
bool is_pdf(std::span<const std::byte> bytes);

struct PdfPage {
  int pages{};                     ///< of the document
  double width_pt{}, height_pt{};  ///< of the page as it is shown; 72 points are an inch of paper
};

/// Of what `pdfinfo -f 1 -l PAGE` printed. errors: invalid_argument (no such page), bad_frame (no size)
Result<PdfPage> read_pdf_info(std::string_view text, int page);

/// Dots per inch to draw a page with: `wanted`, or less so that the picture is not larger than a plan may be.
/// errors: invalid_argument (a page of more than some 25 m of paper)
Result<double> drawable_dpi(const PdfPage& page, double wanted);

}  // namespace anchord::floor_plan
