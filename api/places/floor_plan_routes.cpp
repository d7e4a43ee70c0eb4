#include <charconv>
#include <nlohmann/json.hpp>

#include "api/admin/job_answer.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/places/georeference.hpp"
#include "api/places/place_json.hpp"
#include "api/places/place_records.hpp"
#include "api/places/plan_work.hpp"
#include "api/places/routes.hpp"
#include "api/places/structure_json.hpp"
#include "core/base/base64.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "core/floor_plan/dxf.hpp"
#include "core/floor_plan/image_head.hpp"
#include "core/floor_plan/pdf.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_pictures_at_once = 2;

/// Held while a picture is read, never while its bytes arrive: a slow link would keep the place.
class Reading {
 public:
  Reading(PlaceApi& s, const Request& request) : reading_(s.reading), token_(request.principal.token_id) {
    auto reading = reading_.lock();
    if (reading->contains(token_))
      throw_problem(
          429, "rate-limited",
          "another plan of this token is being processed: wait for its answer, then send this one again");
    if (reading->size() >= k_pictures_at_once)
      throw_problem(503, "overloaded",
                    std::to_string(k_pictures_at_once) +
                        " plans of other users are being processed: send this one again in a moment");
    reading->insert(token_);
  }
  ~Reading() {
    auto reading = reading_.lock();
    reading->erase(token_);
  }
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;

 private:
  Locked<std::set<std::string>>& reading_;
  const std::string token_;
};

Site site_of(PlaceApi& s, const Floor& floor) {
  return value_or_problem(s.sites.site(value_or_problem(s.places.building(floor.building)).site));
}

Response answer(int status, const Floor& floor) {
  Response response = json_response(status, floor_json(floor));
  response.header("ETag", etag(floor));
  return response;
}

/// A picture that is refused is the sender's to mend, whoever noticed it.
[[noreturn]] void refuse_picture(const Error& error) {
  switch (error.code) {
    case Errc::unsupported:
      throw_problem(415, "media-type", error.message);
    case Errc::bad_frame:
    case Errc::invalid_argument:
    case Errc::no_convergence:
    case Errc::weak_geometry:
      throw_problem(422, "validation", error.message);
    case Errc::link_lost:
      throw_problem(422, "validation",
                    "the picture cannot be decoded (" + error.message + "): save it again");
    default:
      throw ProblemException{problem_of(error)};
  }
}

std::string picture_of(const Request& request) {
  const auto too_large = [] {
    throw_problem(413, "too-large",
                  "the plan is larger than " + std::to_string(floor_plan::k_max_image_bytes >> 20) +
                      " MiB: scale it down, or send a single floor");
  };
  std::string out;
  if (request.body_stream == nullptr) {
    out = request.body;
  } else {
    std::vector<char> part(std::size_t{1} << 18);
    for (std::size_t n;
         (n = request.body_stream->read(part)) > 0 && out.size() <= floor_plan::k_max_image_bytes;)
      out.append(part.data(), n);
  }
  if (out.size() > floor_plan::k_max_image_bytes) too_large();
  if (out.empty()) throw_problem(422, "validation", "the body is empty: send the plan's file");
  return out;
}

floor_plan::ImageHead head_of(const std::string& picture) {
  const auto head = floor_plan::image_head(std::as_bytes(std::span(picture)));
  if (head) return head.value();
  if (head.error().code == Errc::invalid_argument) throw_problem(413, "too-large", head.error().message);
  refuse_picture(head.error());
}

StoredImage stored(PlaceApi& s, ImageKind kind, std::string_view media_type, std::int64_t width_px,
                   std::int64_t height_px, const std::string& bytes) {
  Sha256 sum;
  sum.add(bytes);
  return {ImageId{make_uuid_v7(s.clock.now())},    kind,     std::string(media_type), width_px, height_px,
          static_cast<std::int64_t>(bytes.size()), sum.hex()};
}

Json worked(PlaceApi& s, const PlanQuestion& question, const std::string& picture) {
  auto done = ask_worker(s.run_work, s.steady, question, picture, {}, [] { return false; });
  if (!done) refuse_picture(done.error());
  return std::move(done).value();
}

std::string png_of(const Json& answer) {
  const auto png = from_base64(answer.value("png", std::string()));
  if (!png || !floor_plan::image_head(std::as_bytes(std::span(*png))))
    throw_problem(500, "internal", "the answer of the worker process cannot be read");
  return *png;
}

/// Has the plan cut into tiles and keeps them, or says why there are none: it has its backdrop all the same.
void tile(PlaceApi& s, Floor& floor, Ordered& document, const floor_plan::PlanTransform& transform,
          const std::string& picture) {
  auto made = ask_for_tiles(s.run_work, s.steady, transform, picture);
  floor.tiles.reset();
  if (!made) {
    document["tiles_missing"] = made.error().message;
    return;
  }
  auto& tiles = made.value().what;
  tiles.id = PlanTilesId{make_uuid_v7(s.clock.now())};
  value_or_problem(s.places.keep(floor.id, tiles, made.value().pictures));
  floor.tiles = tiles;
}

/// Has the plan turned north up, and keeps that with where it lies. The floor is not stored yet.
void place(PlaceApi& s, Floor& floor, const Georeference& georeference, const std::string& picture) {
  const Json made = worked(s, {PlanTask::backdrop, georeference.transform}, picture);
  const auto png = png_of(made);
  const auto head = head_of(png);
  const auto image = stored(s, ImageKind::backdrop, "image/png", head.width_px, head.height_px, png);
  value_or_problem(s.places.keep(floor.id, image, png));
  floor.backdrop = image;
  auto document = kept_json(georeference.document.text);
  const auto &low = made.at("low_m"), &high = made.at("high_m");
  document["extent_m"] = {low.at(0), low.at(1), high.at(0), high.at(1)};
  tile(s, floor, document, georeference.transform, picture);
  floor.georeference = {to_wire(document)};
  floor.proposal = {};
}

SiteDatum datum_of(const Site& site) {
  return {site.crs_frame, stated_epoch_year(site.crs_frame, site.crs_epoch)};
}

/// Where a site is in its map system; nothing where it has none, or lies outside of it.
std::optional<Eigen::Vector2d> on_map_m(const Site& site) {
  if (!site.projected_epsg || !site.origin) return std::nullopt;
  const auto map = map_of(*site.projected_epsg, datum_of(site));
  if (!map) return std::nullopt;
  const auto at = map.value().easting_northing_m(*site.origin);
  return at ? std::optional(at.value()) : std::nullopt;
}

/// A drawing has no code of its map system: one that lies at the site is in the site's.
std::optional<floor_plan::GeoTags> tags_of_drawing(const Json& drawn, const Site& site) {
  if (!drawn.at("is_at_site").get<bool>()) return std::nullopt;
  floor_plan::GeoTags tags;
  tags.epsg = site.projected_epsg.value();
  const auto& m = drawn.at("drawing_m_from_pixel");
  tags.map_from_pixel << m.at(0), m.at(1), m.at(2), m.at(3), m.at(4), m.at(5);
  return tags;
}

/// The page of a PDF that is asked for, as a picture.
std::string page_of(PlaceApi& s, const Request& request, const std::string& pdf) {
  PlanQuestion question;
  question.task = PlanTask::page;
  question.page = static_cast<int>(query_number(request, "page", 1, 9999).value_or(1));
  question.dots_per_inch = query_number(request, "dpi", k_min_plan_dpi, k_max_plan_dpi).value_or(k_plan_dpi);
  return png_of(worked(s, question, pdf));
}

Response put_plan(PlaceApi& s, const Request& request) {
  check_query(request, {"page", "dpi"});
  Floor floor = path_floor(s, request);
  require_match(request, etag(floor));
  const Site site = site_of(s, floor);
  std::string picture = picture_of(request);
  const Reading held(s, request);
  std::optional<Json> drawn;
  if (floor_plan::is_dxf(std::as_bytes(std::span(picture)))) {
    drawn = worked(s, {PlanTask::draw, {}, on_map_m(site)}, picture);
    picture = png_of(*drawn);
  } else if (floor_plan::is_pdf(std::as_bytes(std::span(picture)))) {
    picture = page_of(s, request, picture);
  }
  const auto head = head_of(picture);
  const Json seen = worked(s, {PlanTask::inspect}, picture);
  const auto preview = png_of(seen);
  const auto preview_head = head_of(preview);
  const bool made = !floor.plan;
  floor.plan = stored(s, ImageKind::plan, floor_plan::k_image_format_words.word(head.format), head.width_px,
                      head.height_px, picture);
  floor.preview =
      stored(s, ImageKind::preview, "image/png", preview_head.width_px, preview_head.height_px, preview);
  floor.backdrop.reset();
  floor.tiles.reset();
  floor.georeference = floor.proposal = {};
  value_or_problem(s.places.keep(floor.id, *floor.plan, picture));
  value_or_problem(s.places.keep(floor.id, *floor.preview, preview));
  if (const auto tags = drawn ? tags_of_drawing(*drawn, site) : head.geo) {
    const auto by_tags = by_map(*tags, drawn ? "drawing" : "geotiff", head.width_px, head.height_px,
                                site.origin, datum_of(site));
    // Tags of a system that is not known here leave the plan to be clicked.
    if (by_tags) place(s, floor, by_tags.value(), picture);
  }
  value_or_problem(s.places.update(floor, floor.version));
  ++floor.version;
  s.audit(request, "floor.plan " + to_string(floor.id) + ' ' + floor.plan->sha256_hex);
  return answer(made ? 201 : 200, floor);
}

Response picture(PlaceApi& s, const Request& request, std::optional<StoredImage> Floor::*which,
                 const char* absent) {
  check_query(request, {});
  const Floor floor = path_floor(s, request);
  const auto& image = floor.*which;
  if (!image) throw_problem(404, "not-found", absent);
  Response response;
  response.header("ETag", '"' + image->sha256_hex + '"').header("Content-Type", image->media_type);
  // Unchanged pictures are not read.
  if (request.header("if-none-match") == '"' + image->sha256_hex + '"') return response;
  response.body = value_or_problem(s.places.bytes(image->id));
  return response;
}

/// A number of the path; nothing where it is none that a tile could have.
std::optional<int> path_count(const Request& request, const char* name) {
  const auto& text = request.params.at(name);
  int value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

Response tile_picture(PlaceApi& s, const Request& request) {
  check_query(request, {});
  const Floor floor = path_floor(s, request);
  if (!floor.tiles)
    throw_problem(404, "not-found",
                  floor.backdrop
                      ? "the plan has no tiles: the field tiles_missing of the floor gives the reason"
                      : "the plan has no georeference: PUT .../plan/georeference");
  const auto& tiles = *floor.tiles;
  const auto level = path_count(request, "level"), column = path_count(request, "column"),
             row = path_count(request, "row");
  if (!level || *level < 0 || *level >= tiles.n_levels)
    throw_problem(404, "not-found",
                  "the plan has no tiles of level " + request.params.at("level") + ", but of levels 0 to " +
                      std::to_string(tiles.n_levels - 1));
  if (!column || !row || !is_tile_of(tiles, *level, *column, *row))
    throw_problem(404, "not-found",
                  "level " + std::to_string(*level) + " of the plan has columns 0 to " +
                      std::to_string(tile_columns(tiles, *level) - 1) + " and rows 0 to " +
                      std::to_string(tile_rows(tiles, *level) - 1) + ", and no tile at column " +
                      request.params.at("column") + ", row " + request.params.at("row"));
  Response response;
  response.header("ETag", '"' + tiles.sha256_hex + '"').header("Content-Type", "image/png");
  // Unchanged pictures are not read.
  if (request.header("if-none-match") == '"' + tiles.sha256_hex + '"') return response;
  auto png = value_or_problem(s.places.tile(tiles.id, *level, *column, *row));
  if (png)
    response.body = std::move(*png);
  else
    response.status = 204;
  return response;
}

Response remove_plan(PlaceApi& s, const Request& request) {
  check_query(request, {});
  Floor floor = path_floor(s, request);
  require_match(request, etag(floor));
  if (!floor.plan) throw_problem(404, "not-found", "the floor has no plan");
  floor.plan.reset();
  floor.preview.reset();
  floor.backdrop.reset();
  floor.tiles.reset();
  floor.georeference = floor.proposal = {};
  value_or_problem(s.places.update(floor, floor.version));
  s.audit(request, "floor.plan.delete " + to_string(floor.id));
  Response response;
  response.status = 204;
  return response;
}

Response put_georeference(PlaceApi& s, const Request& request) {
  check_query(request, {"dry_run"});
  Floor floor = path_floor(s, request);
  require_match(request, etag(floor));
  if (!floor.plan) throw_problem(422, "state", "the floor has no plan: PUT .../plan first");
  const Site site = site_of(s, floor);
  const Json body = json_body(request);
  std::optional<floor_plan::GeoTags> tags;
  std::string bytes;
  const bool try_out = query_flag(request, "dry_run"),
             from_tags = body.is_object() && body.contains("geotiff");
  if (!try_out || from_tags) bytes = value_or_problem(s.places.bytes(floor.plan->id));
  if (from_tags) tags = head_of(bytes).geo;
  const auto found =
      read_georeference(body, tags, floor.plan->width_px, floor.plan->height_px, site.origin, datum_of(site));
  if (try_out) {
    floor.georeference = found.document;
    floor.backdrop.reset();
    floor.tiles.reset();
    return answer(200, floor);
  }
  if (found.wrong) throw_problem(422, "validation", *found.wrong, {{"/points", "outlier", *found.wrong}});
  const Reading held(s, request);
  place(s, floor, found, bytes);
  value_or_problem(s.places.update(floor, floor.version));
  ++floor.version;
  s.audit(request, "floor.georeference " + to_string(floor.id));
  return answer(200, floor);
}

/// Written over what the floor is by then, unless its plan was changed or moved meanwhile.
Result<void> keep_proposal(PlaceApi& s, const Floor& traced, const Document& proposal) {
  while (true) {
    BOOST_OUTCOME_TRY(auto floor, s.places.floor(traced.id));
    if (!floor.plan || floor.plan->id != traced.plan->id || floor.georeference != traced.georeference)
      return make_error(Errc::conflict, "the plan was changed while it was traced: trace it again");
    floor.proposal = proposal;
    const auto kept = s.places.update(floor, floor.version);
    if (kept || kept.error().code != Errc::conflict) return kept;
  }
}

Result<JobEnd> trace(PlaceApi& s, const Floor& floor, const Georeference& georeference, JobContext& job) {
  BOOST_OUTCOME_TRY(const auto bytes, s.places.bytes(floor.plan->id));
  BOOST_OUTCOME_TRY(const auto traced,
                    ask_worker(
                        s.run_work, s.steady, {PlanTask::trace, georeference.transform}, bytes,
                        [&job](const WorkProgress& p) { job.progress(0.95 * p.fraction, p.stage, p.detail); },
                        [&job] { return job.canceled(); }));
  std::string proposal;
  try {
    proposal = to_wire(proposal_json(traced, georeference.origin));
  } catch (const Json::exception&) {
    return make_error(Errc::internal, "the answer of the worker process cannot be read");
  }
  BOOST_OUTCOME_TRYV(keep_proposal(s, floor, {proposal}));
  return JobEnd{"/api/v1/floors/" + to_string(floor.id) + "/plan/trace",
                std::to_string(traced.value("walls", Json::array()).size()) + " walls"};
}

Response proposal(const Floor& floor) {
  if (floor.proposal.empty()) throw_problem(404, "not-found", "the plan was not traced: POST .../plan/trace");
  return json_response(200, kept_json(floor.proposal.text));
}

Response post_trace(PlaceApi& s, const Request& request) {
  check_query(request, {});
  const Floor floor = path_floor(s, request);
  const auto georeference = kept_georeference(floor.georeference);
  if (!floor.plan || !georeference)
    throw_problem(422, "state", "the plan has no scale yet: PUT .../plan/georeference first");
  auto job = value_or_problem(s.jobs.submit(
      "floor_plan_trace", to_wire(Json{{"floor", to_string(floor.id)}}),
      [&s, floor, georeference](JobContext& context) { return trace(s, floor, *georeference, context); }));
  s.audit(request, "floor.trace " + to_string(floor.id));
  return job_outcome(s.jobs, request, std::move(job), [&s, id = floor.id](const Job&) {
    return proposal(value_or_problem(s.places.floor(id)));
  });
}

}  // namespace

void add_floor_plan_routes(Router& router, PlaceApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto writers = Access::any_of({Role::integrator});
  const std::string plan = "/api/v1/floors/{id}/plan";
  router.add(as_heavy({Method::put, plan, writers, on(put_plan), floor_plan::k_max_image_bytes, true, true}));
  router.add({Method::del, plan, writers, on(remove_plan), 1 << 20, false, true});
  const auto shows = [&](const std::string& path, std::optional<StoredImage> Floor::*which,
                         const char* absent) {
    router.add(as_heavy({Method::get, path, readers(), [&s, which, absent](const Request& request) {
                           return picture(s, request, which, absent);
                         }}));
  };
  shows(plan, &Floor::plan, "the floor has no plan");
  shows(plan + "/preview", &Floor::preview, "the floor has no plan");
  shows(plan + "/backdrop", &Floor::backdrop, "the plan has no georeference: PUT .../plan/georeference");
  router.add({Method::get, plan + "/tiles/{level}/{column}/{row}", readers(), on(tile_picture)});
  router.add(
      as_heavy({Method::put, plan + "/georeference", writers, on(put_georeference), 1 << 20, false, true}));
  router.add({Method::post, plan + "/trace", writers, on(post_trace)});
  router.add({Method::get, plan + "/trace", readers(), [&s](const Request& request) {
                check_query(request, {});
                return proposal(path_floor(s, request));
              }});
}

}  // namespace anchord::api
