// The contract and the code say the same: every documented operation has a route and every route is
// documented.
#include <filesystem>
#include <fstream>
#include <set>

#include "api/admin/access.hpp"
#include "api/kit/contract.hpp"
#include "app_fixture.hpp"
#include "core/ports/backups.hpp"
#include "tests/paths.hpp"

namespace anchord::test::contract_test {
namespace {

std::set<std::string> documented() {
  std::set<std::string> out;
  const Json document = Json::parse(api::openapi_json());
  for (const auto& [path, operations] : document["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      std::string name = method;
      for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      out.insert(name + ' ' + path);
    }
  }
  return out;
}

class Contract : public AppFixture {};

TEST_F(Contract, EveryOperationHasARouteAndEveryRouteAnOperation) {
  std::set<std::string> served;
  for (const auto& route : app_->router().routes())
    served.insert(std::string(to_string(route.method)) + ' ' + route.pattern);
  const auto promised = documented();
  for (const auto& one : promised)
    EXPECT_TRUE(served.count(one) > 0) << one << " is documented and not served";
  for (const auto& one : served)
    EXPECT_TRUE(promised.count(one) > 0) << one << " is served and not documented";
}

TEST_F(Contract, EveryOperationHasAnIdAndAProblemAnswer) {
  const Json document = Json::parse(api::openapi_json());
  std::set<std::string> ids;
  for (const auto& [path, operations] : document["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      EXPECT_TRUE(operation.contains("operationId")) << method << ' ' << path;
      EXPECT_TRUE(ids.insert(operation.value("operationId", "")).second)
          << "twice: " << operation["operationId"];
      const bool problem =
          std::any_of(operation["responses"].items().begin(), operation["responses"].items().end(),
                      [](const auto& item) { return item.key() >= "400"; });
      EXPECT_TRUE(problem) << method << ' ' << path;
    }
  }
}

// A generated client knows no answer that its operation does not list. Broken percent-encoding is one
// everywhere.
TEST_F(Contract, EveryOperationListsTheAnswerToARequestThatCannotBeRead) {
  const Json document = Json::parse(api::openapi_json());
  for (const auto& [path, operations] : document["paths"].items()) {
    for (const auto& [method, operation] : operations.items())
      EXPECT_TRUE(operation["responses"].contains("400")) << method << ' ' << path;
  }
}

TEST_F(Contract, RequestExamplesOfTheDashboardAreAccepted) {
  const auto read = [](const std::string& name) {
    std::ifstream file(std::filesystem::path(ANCHORD_TEST_DATA) / "wire" / name);
    return Json::parse(file);
  };
  const auto made = post("/api/v1/missions", read("rest.mission.create.request.json").dump());
  ASSERT_EQ(made.status, 201) << made.body;
  // What the dashboard reads of a mission is there.
  const Json mission_keys = read("rest.mission.json"), version_keys = read("rest.version.json");
  for (const auto& [key, value] : mission_keys.items()) EXPECT_TRUE(json(made).contains(key)) << key;
  Json calibration = read("rest.calibration.request.json");
  calibration["missions"] = {json(made)["id"]};
  EXPECT_EQ(post("/api/v1/calibrations", calibration.dump()).status, 202);
  for (const auto& [key, value] : version_keys.items())
    EXPECT_TRUE(json(get("/version")).contains(key)) << key;
}

}  // namespace
}  // namespace anchord::test::contract_test
