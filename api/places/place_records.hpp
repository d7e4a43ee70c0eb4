#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/places/place_json.hpp"
#include "api/places/routes.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {

inline Floor path_floor(PlaceApi& s, const Request& request) {
  return value_or_problem(s.places.floor(path_id<FloorId>(request)));
}

/// Routes of a building's or a floor's record, which is made, read, changed and removed in one way. Kind says
/// what they differ in: Place; k_path, k_word; list(api, request), find(api, request), json(place), and
/// read(body, place, made), which throws what is wrong.
template <class Kind>
class PlaceRecords {
 public:
  static void add_to(Router& router, PlaceApi& s) {
    const auto on = [&s](auto function) {
      return [&s, function](const Request& request) { return function(s, request); };
    };
    const auto writers = Access::any_of({Role::integrator});
    const std::string all(Kind::k_path), one = all + "/{id}";
    router.add({Method::get, all, readers(), on(Kind::list)});
    router.add({Method::post, all, writers, on(create)});
    router.add({Method::get, one, readers(), on(get)});
    router.add({Method::patch, one, writers, on(patch), 1 << 20, false, true});
    router.add({Method::del, one, writers, on(remove), 1 << 20, false, true});
  }

 private:
  using Place = typename Kind::Place;

  static Response answer(int status, const Place& place) {
    Response response = json_response(status, Kind::json(place));
    response.header("ETag", etag(place));
    return response;
  }
  static void written(PlaceApi& s, const Request& request, const char* what, const Place& place) {
    s.changed();
    s.audit(request, std::string(Kind::k_word) + what + to_string(place.id));
  }

  static Response create(PlaceApi& s, const Request& request) {
    check_query(request, {});
    Place place;
    Kind::read(json_body(request), place, true);
    place.created = s.clock.now();
    place.id.uuid = make_uuid_v7(place.created);
    value_or_problem(s.places.insert(place));
    written(s, request, ".create ", place);
    Response response = answer(201, place);
    response.header("Location", std::string(Kind::k_path) + '/' + to_string(place.id));
    return response;
  }

  static Response get(PlaceApi& s, const Request& request) {
    check_query(request, {});
    return answer(200, Kind::find(s, request));
  }

  static Response patch(PlaceApi& s, const Request& request) {
    check_query(request, {});
    Place place = Kind::find(s, request);
    require_match(request, etag(place));
    Kind::read(json_body(request), place, false);
    value_or_problem(s.places.update(place, place.version));
    ++place.version;
    written(s, request, ".change ", place);
    return answer(200, place);
  }

  static Response remove(PlaceApi& s, const Request& request) {
    check_query(request, {});
    const Place place = Kind::find(s, request);
    require_match(request, etag(place));
    value_or_problem(s.places.remove(place.id, place.version));
    written(s, request, ".delete ", place);
    Response response;
    response.status = 204;
    return response;
  }
};

}  // namespace anchord::api
