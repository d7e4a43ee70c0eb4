#include "server/cli/job_answer.hpp"

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "api/measurements/flight_requests.hpp"

namespace anchord::cli {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr auto k_look_every = std::chrono::seconds(1);

std::string word(const Ordered& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

}  // namespace

Result<Ordered> answer_of_job(server::HttpClient& client, const std::string& target,
                              const std::string& body) {
  BOOST_OUTCOME_TRY(auto answer,
                    client.call("POST", target, body, "application/json", {{"Prefer", "wait=600"}}));
  const bool begun = answer.status == 202;
  for (;;) {
    auto json = Ordered::parse(answer.body, nullptr, false);
    if (answer.status >= 400 || !json.is_object())
      return make_error(Errc::unsupported, api::problem_text(answer.body));
    if (!begun) return json;
    const std::string state = word(json, "state");
    if (state == "succeeded") return Ordered(nullptr);
    if (state != "queued" && state != "running") {
      const auto problem = json.find("problem");
      const std::string why = problem != json.end() && problem->is_object() ? word(*problem, "detail") : "";
      return make_error(Errc::unsupported, why.empty() ? "the job has ended: " + state : why);
    }
    std::this_thread::sleep_for(k_look_every);
    BOOST_OUTCOME_TRY(answer, client.call("GET", "/api/v1/jobs/" + word(json, "id")));
  }
}

}  // namespace anchord::cli
