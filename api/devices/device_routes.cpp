#include <nlohmann/json.hpp>

#include "api/admin/job_answer.hpp"
#include "api/admin/job_service.hpp"
#include "api/devices/device_json.hpp"
#include "api/devices/device_stream.hpp"
#include "api/devices/routes.hpp"
#include "api/kit/content_tag.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

std::string etag(const DeviceReport& device) { return "\"d-" + std::to_string(device.config.version) + '"'; }

Response answer(int status, const DeviceReport& device) {
  Response response = json_response(status, device_json(device));
  response.header("ETag", etag(device));
  return response;
}

/// Settings no driver or link takes are the client's 422 and not our fault.
template <class T>
T accepted(Result<T> result) {
  if (!result && result.error().code == Errc::invalid_argument) {
    const auto& text = result.error().message;
    const bool options = text.starts_with("kind: ") || text.find(": ") < 40;
    throw_problem(422, "validation", text, {{options ? "/options" : "/address", "refused", text}});
  }
  return value_or_problem(std::move(result));
}

/// What is set up here, then the radios that were heard in missions.
Response list(DeviceApi& s, const Request& request) {
  check_query(request, {"mission", "fields"});
  const auto mission = query_mission(request);
  Ordered items = Ordered::array();
  if (!mission && current_sites().all()) {  // what is set up here is of no site
    for (const auto& device : s.devices.devices()) items.push_back(device_json(device));
  }
  for (const auto& radio : value_or_problem(s.measurements.devices(mission))) {
    items.push_back({{"network_id", to_string(radio.network_id)},
                     {"kind", k_radio_words.word(radio.kind)},
                     {"mission", to_string(radio.mission)},
                     {"first_seen_us", radio.first_seen.us()},
                     {"last_seen_us", radio.last_seen.us()},
                     {"n_ranges", radio.n_ranges}});
  }
  return list_response(request, std::move(items), "");
}

Response create(DeviceApi& s, const Request& request) {
  std::vector<FieldError> errors;
  DeviceConfig config;
  patch_device(json_body(request), true, config, errors);
  refuse_if_any(errors);
  const auto device = accepted(s.devices.add(std::move(config)));
  s.audit(request, "device.create " + to_string(device.config.id) + " " + device.config.address);
  Response response = answer(201, device);
  response.header("Location", "/api/v1/devices/" + to_string(device.config.id));
  return response;
}

Response patch(DeviceApi& s, const Request& request) {
  const auto before = value_or_problem(s.devices.device(path_uuid(request)));
  require_match(request, etag(before));
  std::vector<FieldError> errors;
  auto config = before.config;
  patch_device(json_body(request), false, config, errors);
  refuse_if_any(errors);
  const auto device = accepted(s.devices.change(std::move(config), before.config.version));
  s.audit(request, "device.change " + to_string(device.config.id));
  return answer(200, device);
}

Response remove(DeviceApi& s, const Request& request) {
  const auto device = value_or_problem(s.devices.device(path_uuid(request)));
  require_match(request, etag(device));
  if (const auto holder = s.stream.holder(); holder && device.config.enabled)
    throw_problem(409, "conflict",
                  device.config.name + " is in use: " + holder->name +
                      " is recording with it; finish that mission first, or switch the device off");
  value_or_problem(s.devices.remove(device.config.id, device.config.version));
  s.audit(request, "device.delete " + to_string(device.config.id));
  Response response;
  response.status = 204;
  return response;
}

/// The request is sound; it is the device that cannot, does not answer, or answers rubbish.
bool of_the_device(const Error& error) {
  return error.code == Errc::unsupported || error.code == Errc::link_lost || error.code == Errc::bad_frame ||
         error.code == Errc::checksum_mismatch;
}

Response act(DeviceApi& s, const Request& request) {
  const auto device = value_or_problem(s.devices.device(path_uuid(request)));
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto action = fields.text("action", 40, true);
  const auto* arguments = fields.child("arguments");
  if (arguments != nullptr && !arguments->is_object())
    fields.error("arguments", "wrong_type", "must be an object");
  fields.finish();
  refuse_if_any(errors);
  const auto result =
      s.devices.act(device.config.id, *action, arguments == nullptr ? "{}" : to_wire(*arguments));
  s.audit(request, "device.action " + to_string(device.config.id) + " " + *action, result ? "ok" : "failed");
  if (!result && of_the_device(result.error())) throw_problem(422, "state", result.error().message);
  auto json = Ordered::parse(accepted(result), nullptr, false);
  return json_response(
      200, {{"action", *action}, {"result", json.is_discarded() ? Ordered(nullptr) : std::move(json)}});
}

/// What the device says to a question; its state is the client's 422.
Json ask(DeviceApi& s, const Uuid& id, std::string_view action, const std::string& arguments) {
  const auto result = s.devices.act(id, action, arguments);
  if (!result && of_the_device(result.error())) throw_problem(422, "state", result.error().message);
  auto json = Json::parse(accepted(result), nullptr, false);
  return json.is_discarded() ? Json() : json;
}

/// Of the settings themselves: whoever changes them at the device changes it as well.
std::string settings_etag(const Json& settings) { return content_tag(to_wire(settings), "u-"); }

Response uwb_answer(const Json& settings, const Json& devices) {
  Ordered body;
  for (const char* key : {"channel", "rate_kbps", "prf_mhz", "preamble_symbols", "gain_db"})
    body[key] = settings.contains(key) ? Ordered(settings[key]) : Ordered(nullptr);
  if (devices.is_array()) body["devices"] = devices;
  Response response = json_response(200, body);
  response.header("ETag", settings_etag(settings));
  return response;
}

Response get_uwb(DeviceApi& s, const Request& request) {
  check_query(request, {"devices"});
  const auto device = value_or_problem(s.devices.device(path_uuid(request)));
  const bool others = query_flag(request, "devices");
  // Asking them stops ranging for seconds: not for those who only look.
  if (others && !request.principal.has(Role::op) && !request.principal.has(Role::admin))
    throw_problem(403, "forbidden",
                  "reading the settings of the anchors interrupts ranging; this needs the role operator");
  const Json settings = ask(s, device.config.id, "get_uwb", others ? R"({"devices":true})" : "{}");
  return uwb_answer(settings, others ? settings.value("devices", Json::array()) : Json());
}

/// Everywhere or nowhere: the tag and every device in its list, verified, else all back.
Response put_uwb(DeviceApi& s, const Request& request) {
  const auto device = value_or_problem(s.devices.device(path_uuid(request)));
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  for (const char* key : {"channel", "rate_kbps", "prf_mhz", "preamble_symbols"})
    fields.number(key, 0, 10'000, true);
  fields.number("gain_db", 0, 33.5);
  if (const auto* devices = fields.child("devices"); devices != nullptr && !devices->is_array())
    fields.error("devices", "wrong_type", "must be a list of network ids");
  fields.finish();
  refuse_if_any(errors);
  require_match(request, settings_etag(ask(s, device.config.id, "get_uwb", "{}")));
  const auto done = ask(s, device.config.id, "set_uwb", to_wire(body));
  const bool all = done.value("all", false);
  s.audit(request, "device.uwb " + to_string(device.config.id) + " " + to_wire(body), all ? "ok" : "failed");
  if (!all) {
    std::string why;
    for (const auto& one : done.value("devices", Json::array())) {
      if (!one.value("why", "").empty())
        why += "; " + one.value("network_id", "") + " " + one.value("why", "");
    }
    throw_problem(
        422, "state",
        done.value("rolled_back", false)
            ? "not every device accepted the settings, so all have the old ones again" + why
            : "not every device accepted the settings, and not all could be set back to the old ones" + why);
  }
  return uwb_answer(ask(s, device.config.id, "get_uwb", "{}"), done.value("devices", Json::array()));
}

/// What the last discovery found.
Response found_answer(DeviceControl& devices) {
  Ordered items = Ordered::array();
  for (const auto& device : devices.discovered()) items.push_back(discovered_json(device));
  return json_response(200, {{"items", std::move(items)}});
}

Response discover(DeviceApi& s, const Request& request) {
  std::vector<FieldError> errors;
  const auto body = json_body(request, true);
  Fields fields(body, "", errors);
  fields.finish();
  refuse_if_any(errors);
  auto& devices = s.devices;
  auto job =
      value_or_problem(s.jobs.submit("discovery", "{}", [&devices](JobContext& context) -> Result<JobEnd> {
        context.progress(0, "listening", "every port that is not in use");
        const auto n = devices.discover().size();
        return JobEnd{"/api/v1/discovery", std::to_string(n) + " ports"};
      }));
  s.audit(request, "device.discovery");
  return job_outcome(s.jobs, request, std::move(job),
                     [&devices](const Job&) { return found_answer(devices); });
}

}  // namespace

void add_device_routes(Router& router, DeviceApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto operators = Access::any_of({Role::op});
  router.add({Method::get, "/api/v1/devices", readers(), on(list)});
  router.add({Method::post, "/api/v1/devices", operators, on(create)});
  router.add({Method::get, "/api/v1/devices/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return answer(200, value_or_problem(s.devices.device(path_uuid(request))));
              }});
  router.add({Method::patch, "/api/v1/devices/{id}", operators, on(patch), 1 << 20, false, true});
  router.add({Method::del, "/api/v1/devices/{id}", operators, on(remove), 1 << 20, false, true});
  router.add({Method::post, "/api/v1/devices/{id}/actions", operators, on(act)});
  router.add({Method::get, "/api/v1/devices/{id}/uwb-settings", readers(), on(get_uwb)});
  router.add(
      {Method::put, "/api/v1/devices/{id}/uwb-settings", operators, on(put_uwb), 1 << 20, false, true});
  router.add({Method::post, "/api/v1/discovery", operators, on(discover)});
  router.add({Method::get, "/api/v1/discovery", readers(), [&s](const Request& request) {
                check_query(request, {});
                return found_answer(s.devices);
              }});
}

}  // namespace anchord::api
