#include "api/places/plan_work.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "api/kit/reader.hpp"
#include "core/base/base64.hpp"
#include "core/base/enum_table.hpp"
#include "core/base/sha256.hpp"
#include "core/base/steady.hpp"
#include "core/base/to_wire.hpp"
#include "core/floor_plan/backdrop.hpp"
#include "core/floor_plan/draw.hpp"
#include "core/floor_plan/image_head.hpp"
#include "core/floor_plan/pdf.hpp"
#include "core/floor_plan/trace.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

constexpr std::string_view k_mark = "floor_plan ";
constexpr auto k_task_words = enum_table<PlanTask>({{"inspect", PlanTask::inspect},
                                                    {"backdrop", PlanTask::backdrop},
                                                    {"tiles", PlanTask::tiles},
                                                    {"trace", PlanTask::trace},
                                                    {"draw", PlanTask::draw},
                                                    {"page", PlanTask::page}});
/// More than any plan has (core/floor_plan/tiles).
constexpr int k_max_tile_levels = 16;
constexpr std::int64_t k_max_tiled_px = 50'000;
/// The head of a message that needs a program begins so.
constexpr std::string_view k_page_mark = "floor_plan page ";

Json point_json(const Eigen::Vector2d& m) { return {m.x(), m.y()}; }

Result<std::string> inspect(floor_plan::Image image) {
  const int width = image.width_px, height = image.height_px;
  auto preview = floor_plan::shrunk(std::move(image), k_preview_px);
  BOOST_OUTCOME_TRY(const auto png, floor_plan::encode_png_within(std::move(preview), k_max_picture_bytes));
  return to_wire(Json{{"width_px", width}, {"height_px", height}, {"png", base64(png)}});
}

Result<std::string> backdrop(const floor_plan::Image& image, const floor_plan::PlanTransform& transform) {
  BOOST_OUTCOME_TRY(auto made, floor_plan::make_backdrop(image, transform, k_backdrop_px));
  BOOST_OUTCOME_TRY(const auto png,
                    floor_plan::encode_png_within(std::move(made.image), k_max_picture_bytes));
  return to_wire(
      Json{{"low_m", point_json(made.low_m)}, {"high_m", point_json(made.high_m)}, {"png", base64(png)}});
}

/// A line of JSON, then the pictures one behind the other.
Result<std::string> tiles(const floor_plan::Image& image, const floor_plan::PlanTransform& transform) {
  BOOST_OUTCOME_TRY(auto made, floor_plan::make_tiles(image, transform));
  Json list = Json::array();
  std::size_t bytes = 0;
  for (const auto& tile : made.tiles) {
    list.push_back({tile.level, tile.column, tile.row, tile.png.size()});
    bytes += tile.png.size();
  }
  std::string out = to_wire(Json{{"north_west_m", point_json(made.north_west_m)},
                                 {"m_per_px", made.m_per_px},
                                 {"width_px", made.width_px},
                                 {"height_px", made.height_px},
                                 {"n_levels", made.n_levels},
                                 {"tiles", std::move(list)}}) +
                    '\n';
  out.reserve(out.size() + bytes);
  for (auto& tile : made.tiles) out += std::exchange(tile.png, {});
  return out;
}

Error unreadable() { return make_error(Errc::internal, "the answer of the worker process cannot be read"); }

/// What a worker made of a stranger's picture may be anything: every number is looked at.
Result<MadeTiles> read_tiles(std::string answer) {
  MadeTiles out;
  out.answer = std::move(answer);
  const std::string_view text(out.answer);
  const auto line_end = std::min(text.find('\n'), text.size());
  const auto head = Json::parse(text.substr(0, line_end), nullptr, false);
  try {
    auto& what = out.what;
    what.n_levels = head.at("n_levels").get<int>();
    what.m_per_px = head.at("m_per_px").get<double>();
    what.width_px = head.at("width_px").get<std::int64_t>();
    what.height_px = head.at("height_px").get<std::int64_t>();
    what.west_m = head.at("north_west_m").at(0).get<double>();
    what.north_m = head.at("north_west_m").at(1).get<double>();
    const bool sound = what.n_levels >= 1 && what.n_levels <= k_max_tile_levels && what.m_per_px > 0 &&
                       what.width_px > 0 && what.width_px <= k_max_tiled_px && what.height_px > 0 &&
                       what.height_px <= k_max_tiled_px;
    if (!sound) return unreadable();
    std::size_t at = line_end + 1;
    Sha256 sum;
    for (const auto& row : head.at("tiles")) {
      PlanTile tile{row.at(0).get<int>(), row.at(1).get<int>(), row.at(2).get<int>(), {}};
      const auto n = row.at(3).get<std::size_t>();
      if (at > text.size() || n > text.size() - at || !is_tile_of(what, tile.level, tile.column, tile.row))
        return unreadable();
      tile.png = text.substr(at, n);
      at += n;
      const auto png = floor_plan::image_head(std::as_bytes(std::span(tile.png)));
      if (!png || png.value().format != floor_plan::ImageFormat::png ||
          png.value().width_px != floor_plan::k_tile_px || png.value().height_px != floor_plan::k_tile_px)
        return unreadable();
      what.bytes += static_cast<std::int64_t>(n);
      sum.add(tile.png);
      out.pictures.push_back(tile);
    }
    what.sha256_hex = sum.hex();
  } catch (const Json::exception&) {
    return unreadable();
  }
  return out;
}

Result<std::string> trace(const floor_plan::Image& image, const floor_plan::PlanTransform& transform,
                          const std::stop_token& stop, const WorkProgressSink& progress) {
  BOOST_OUTCOME_TRY(const auto found,
                    floor_plan::trace_plan(image, transform, {}, [&](double fraction, std::string_view step) {
                      if (progress) progress({std::string(step), 0, 3, fraction, ""});
                      return !stop.stop_requested();
                    }));
  Json outline = Json::array(), walls = Json::array();
  for (const auto& corner : found.outline_m) outline.push_back(point_json(corner));
  for (const auto& wall : found.walls)
    walls.push_back({{"from_m", point_json(wall.from_m)},
                     {"to_m", point_json(wall.to_m)},
                     {"thickness_m", wall.thickness_m}});
  return to_wire(Json{{"outline_m", std::move(outline)},
                      {"walls", std::move(walls)},
                      {"cell_m", found.cell_m},
                      {"notes", found.notes}});
}

Result<std::string> draw(std::span<const std::byte> dxf, const std::optional<Eigen::Vector2d>& site_map_m) {
  BOOST_OUTCOME_TRY(const auto drawing, floor_plan::read_dxf(dxf));
  BOOST_OUTCOME_TRY(auto made, floor_plan::draw_plan(drawing, site_map_m));
  const auto& m = made.drawing_m_from_pixel;
  const int width = made.image.width_px;
  BOOST_OUTCOME_TRY(const auto png,
                    floor_plan::encode_png_within(std::move(made.image), floor_plan::k_max_image_bytes));
  const auto head = floor_plan::image_head(std::as_bytes(std::span(png)));
  // A picture that had to be made smaller has larger pixels.
  const double by = head ? static_cast<double>(width) / static_cast<double>(head.value().width_px) : 1;
  return to_wire(Json{
      {"png", base64(png)},
      {"is_at_site", made.is_at_site},
      {"drawing_m_from_pixel", {by * m(0, 0), by * m(0, 1), m(0, 2), by * m(1, 0), by * m(1, 1), m(1, 2)}}});
}

/// The line of JSON of a message; discarded where there is none.
Json head_of(std::string_view message) {
  if (!is_plan_work(message)) return Json(Json::value_t::discarded);
  const auto mark = is_page_work(message) ? k_page_mark.size() : k_mark.size();
  return Json::parse(message.substr(mark, message.find('\n') - mark), nullptr, false);
}

/// The error of a program of poppler, with what to do about it.
Error advised(Error error) {
  if (error.code == Errc::no_convergence)
    error.message +=
        ", far more than a floor plan needs: export the page as PNG, or again without its hatch patterns";
  if (error.code == Errc::unsupported)
    error.message += ": install poppler-utils on the server, or export the page as PNG";
  if (error.code == Errc::bad_frame) error.message += ": export the PDF again, without a password";
  return error;
}

Result<std::string> page(std::string_view pdf, int number, double wanted_dpi, const RunProgram& run) {
  if (!run) return make_error(Errc::unsupported, "this server cannot read PDF: export the page as PNG");
  const auto n = std::to_string(number);
  // From the first page on: of a page that is not there alone pdfinfo prints not even how many there are.
  const auto info = run({"pdfinfo", "-f", "1", "-l", n, "-"}, pdf, 4 << 20);
  if (!info) return advised(info.error());
  BOOST_OUTCOME_TRY(const auto found, floor_plan::read_pdf_info(info.value(), number));
  BOOST_OUTCOME_TRY(auto dpi, floor_plan::drawable_dpi(found, wanted_dpi));
  while (true) {
    const auto png =
        run({"pdftoppm", "-png", "-singlefile", "-f", n, "-l", n, "-r", std::to_string(dpi), "-"}, pdf,
            floor_plan::k_max_image_bytes);
    if (png) return to_wire(Json{{"png", base64(png.value())}, {"pages", found.pages}});
    // Too many bytes for a plan: coarser.
    if (png.error().code != Errc::invalid_argument || dpi < k_min_plan_dpi) return advised(png.error());
    dpi /= 2;
  }
}

}  // namespace

bool is_plan_work(std::string_view message) { return message.starts_with(k_mark); }
bool is_page_work(std::string_view message) { return message.starts_with(k_page_mark); }

int plan_work_cpu_s(std::string_view message) {
  const auto head = head_of(message);
  return head.is_object() ? head.value("cpu_s", k_picture_cpu_s) : k_picture_cpu_s;
}

bool is_tile_of(const PlanTiles& tiles, int level, int column, int row) {
  return level >= 0 && level < tiles.n_levels && column >= 0 && column < tile_columns(tiles, level) &&
         row >= 0 && row < tile_rows(tiles, level);
}

Error too_busy(int cpu_s) {
  return make_error(Errc::no_convergence,
                    "decoding the picture took more than " + std::to_string(cpu_s) +
                        " s of processor time: save it again as a plain PNG, or a simpler or smaller page");
}

Result<std::string> do_plan_work(std::string_view message, const std::stop_token& stop,
                                 const WorkProgressSink& progress, const RunProgram& run_program) {
  const auto line_end = message.find('\n');
  if (!is_plan_work(message) || line_end == std::string_view::npos)
    return make_error(Errc::bad_frame, "unknown work on a floor plan");
  const auto head = head_of(message);
  const auto bytes = message.substr(line_end + 1);
  try {
    BOOST_OUTCOME_TRY(const auto task, k_task_words.parse("task", head.at("task").get<std::string>()));
    floor_plan::PlanTransform transform;
    const auto& m = head.at("enu_from_pixel");
    transform.linear << m.at(0).get<double>(), m.at(1).get<double>(), m.at(3).get<double>(),
        m.at(4).get<double>();
    transform.shift_m = {m.at(2).get<double>(), m.at(5).get<double>()};
    if (task == PlanTask::draw) {
      std::optional<Eigen::Vector2d> site_map_m;
      if (const auto at = head.find("site_map_m"); at != head.end())
        site_map_m.emplace(at->at(0).get<double>(), at->at(1).get<double>());
      return draw(std::as_bytes(std::span(bytes)), site_map_m);
    }
    if (task == PlanTask::page)
      return page(bytes, head.at("page").get<int>(), head.at("dots_per_inch").get<double>(),
                  is_page_work(message) ? run_program : RunProgram{});
    BOOST_OUTCOME_TRY(auto image, floor_plan::decode_image(std::as_bytes(std::span(bytes))));
    switch (task) {
      case PlanTask::inspect:
        return inspect(std::move(image));
      case PlanTask::backdrop:
        return backdrop(image, transform);
      case PlanTask::tiles:
        return tiles(image, transform);
      case PlanTask::trace:
        return trace(image, transform, stop, progress);
      case PlanTask::draw:
      case PlanTask::page:
        break;
    }
  } catch (const Json::exception& fault) {
    return make_error(Errc::bad_frame, fault.what());
  }
  return make_error(Errc::bad_frame, "unknown kind of work");
}

Result<std::string> plan_work_inline(const std::string& message, const WorkProgressSink& progress,
                                     const std::function<bool()>& canceled) {
  std::stop_source stop;
  return do_plan_work(message, stop.get_token(),
                      [&](const WorkProgress& p) {
                        if (canceled()) stop.request_stop();
                        if (progress) progress(p);
                      },
                      {});
}

namespace {

Result<std::string> asked(const RunWork& run, const SteadyClock& steady, const PlanQuestion& question,
                          std::string_view picture, const WorkProgressSink& progress,
                          const std::function<bool()>& canceled) {
  const auto& m = question.transform.linear;
  const auto& shift = question.transform.shift_m;
  Json head{{"task", k_task_words.word(question.task)},
            {"enu_from_pixel", {m(0, 0), m(0, 1), shift.x(), m(1, 0), m(1, 1), shift.y()}},
            {"cpu_s", question.cpu_s()}};
  if (question.site_map_m) head["site_map_m"] = point_json(*question.site_map_m);
  if (question.task == PlanTask::page) {
    head["page"] = question.page;
    head["dots_per_inch"] = question.dots_per_inch;
  }
  std::string message =
      std::string(question.task == PlanTask::page ? k_page_mark : k_mark) + to_wire(head) + '\n';
  message.append(picture);
  const auto begun = steady.now();
  bool late = false;
  const auto answer = run(message, progress, [&] {
    late = late || seconds_between(begun, steady.now()) > k_plan_work_s;
    return late || canceled();
  });
  if (!answer && late)
    return make_error(Errc::no_convergence, "the picture was not processed within " +
                                                std::to_string(static_cast<int>(k_plan_work_s)) +
                                                " s: scale it down, or send it when the server is less busy");
  return answer;
}

}  // namespace

Result<Json> ask_worker(const RunWork& run, const SteadyClock& steady, const PlanQuestion& question,
                        std::string_view picture, const WorkProgressSink& progress,
                        const std::function<bool()>& canceled) {
  BOOST_OUTCOME_TRY(const auto text, asked(run, steady, question, picture, progress, canceled));
  Json out;
  if (parse_json(text, out) || !out.is_object()) return unreadable();
  return out;
}

Result<MadeTiles> ask_for_tiles(const RunWork& run, const SteadyClock& steady,
                                const floor_plan::PlanTransform& transform, std::string_view picture) {
  BOOST_OUTCOME_TRY(auto answer,
                    asked(run, steady, {PlanTask::tiles, transform}, picture, {}, [] { return false; }));
  return read_tiles(std::move(answer));
}

}  // namespace anchord::api
