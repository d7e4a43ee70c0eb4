#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "app_fixture.hpp"

namespace anchord::test {

/// How a firm's token is bound.
enum class Bound : std::uint8_t {
  to_sites,         ///< to its site, which was there before
  to_organization,  ///< to its organization; the site is of later, made with the token
};
inline std::string bound_name(const ::testing::TestParamInfo<Bound>& info) {
  return info.param == Bound::to_sites ? "ToSites" : "ToOrganization";
}

/// Two firms on one server: each has a site, a token bound to it with every role, and of everything that can
/// be made of a site one, made with that token. What is of the first carries "alfa" in its names ("alpha"
/// stands in every style of a map), what is of the second "bravo".
class SiteTokens : public AppFixture, public ::testing::WithParamInterface<Bound> {
 protected:
  using Method = api::Method;

  struct Firm {
    std::string word;                        ///< in every name of theirs
    api::Principal who;                      ///< the token
    std::map<std::string, std::string> ids;  ///< by what it is of
    std::vector<std::string> network_ids;
    std::string id(const std::string& of) const { return ids.at(of); }
  };

  void SetUp() override {
    AppFixture::SetUp();
    alpha_ = firm("alfa", 0xa1a1);
    bravo_ = firm("bravo", 0xb2b2);
  }

  struct Ask {
    std::string body{};
    std::map<std::string, std::string> query{};
    std::string type{"application/json"};
  };
  api::Response as(const api::Principal& who, Method method, const std::string& path) {
    return as(who, method, path, Ask{});
  }
  api::Response as(const api::Principal& who, Method method, const std::string& path, const Ask& ask) {
    api::Request request;
    request.method = method;
    request.path = path;
    request.query = ask.query;
    request.body = ask.body;
    if (!ask.body.empty()) request.headers["content-type"] = ask.type;
    request.headers["if-match"] = "\"none\"";
    request.principal = who;
    request.request_id = "test-1";
    request.remote = "127.0.0.1";
    TextReader stream(ask.body);
    const auto found = app_->router().resolve(method, path);
    if (found.route != nullptr && found.route->streams_body) request.body_stream = &stream;
    return app_->router().handle(request);
  }
  api::Response get_as(const Firm& firm, const std::string& path,
                       std::map<std::string, std::string> query = {}) {
    return as(firm.who, Method::get, path, {"", std::move(query)});
  }
  api::Response post_as(const Firm& firm, const std::string& path, const Json& body,
                        std::map<std::string, std::string> query = {}) {
    return as(firm.who, Method::post, path, {body.dump(), std::move(query)});
  }

  /// What an answer, an export or a frame for somebody else must not hold of a firm.
  static std::string betrayed(const Firm& firm, const std::string& answer) {
    if (answer.find(firm.word) != std::string::npos) return firm.word;
    for (const auto& [of, id] : firm.ids)
      if (id.size() > 8 && answer.find(id) != std::string::npos) return of + ' ' + id;
    for (const auto& id : firm.network_ids)
      if (answer.find(id) != std::string::npos) return id;
    return {};
  }

  Firm alpha_, bravo_;

 private:
  struct TextReader final : api::BodyReader {
    explicit TextReader(std::string_view t) : text(t) {}
    std::size_t read(std::span<char> buffer) override {
      const std::size_t n = text.copy(buffer.data(), buffer.size());
      text.remove_prefix(n);
      return n;
    }
    std::string_view text;
  };

  std::string made(const Firm& firm, const std::string& path, const Json& body) {
    const auto answer = as(firm.who, Method::post, path, {body.dump()});
    EXPECT_EQ(answer.status, 201) << path << ' ' << answer.body;
    return answer.status == 201 ? json(answer).value("id", "") : "";
  }

  Firm firm(const std::string& word, std::uint32_t anchor) {
    Firm out;
    out.word = word;
    auto& ids = out.ids;
    const auto organization = post("/api/v1/organizations", Json{{"name", word + " group"}}.dump());
    EXPECT_EQ(organization.status, 201) << organization.body;
    ids["organization"] = json(organization)["id"];
    const Json works{{"name", word + " works"}, {"origin", {{"lon", 3.713}, {"lat", 51.023}, {"h_m", 55}}}};
    Json token{{"name", word + " crew"}, {"roles", {"admin"}}};
    if (GetParam() == Bound::to_organization) {
      token["organization"] = ids["organization"];
    } else {
      ids["site"] = made({"", api::local_principal(), {}, {}}, "/api/v1/sites", works);
      token["sites"] = {ids["site"]};
    }
    const auto bound = post("/api/v1/tokens", token.dump());
    EXPECT_EQ(bound.status, 201) << bound.body;
    out.who = access_->verify(json(bound)["token"].get<std::string>()).value();
    if (GetParam() == Bound::to_organization) ids["site"] = made(out, "/api/v1/sites", works);
    const Json mission{{"name", word + " flight"},
                       {"site", ids["site"]},
                       {"frame", "wgs84"},
                       {"track_point", "tag_antenna"}};
    ids["mission"] = made(out, "/api/v1/missions", mission);
    ids["plan"] = made(out, "/api/v1/plans", plan(word, ids["site"]));
    ids["building"] = made(out, "/api/v1/buildings", {{"name", word + " hall"}, {"site", ids["site"]}});
    ids["floor"] = made(out, "/api/v1/floors",
                        {{"name", word + " ground"}, {"level", 0}, {"building", ids["building"]}});
    ids["frame"] = made(out, "/api/v1/frames", {{"name", word + "-frame"}, {"site", ids["site"]}});
    out.network_ids = {to_string(NetworkId{anchor}), to_string(NetworkId{anchor + 1})};
    fly(out, ids["mission"], 1);
    ids["range"] = std::to_string(json(as(out.who, Method::get, "/api/v1/ranges",
                                          {"", {{"mission", ids["mission"]}}}))["items"][0]["id"]
                                      .get<std::int64_t>());
    std::uint32_t next = anchor;
    ids["calibration"] = stored_calibration([&](Estimate& e) { e.anchor = {next++}; }, ids["mission"]);
    const auto published =
        as(out.who, Method::post, "/api/v1/calibrations/" + ids["calibration"] + "/publish", {"{}"});
    EXPECT_EQ(published.status, 201) << published.body;
    ids["number"] = std::to_string(json(published).value("revision", 0));
    ids["anchor"] = json(as(out.who, Method::get, "/api/v1/anchors/" + out.network_ids[0]))["id"];
    const auto named = as_match(out, Method::patch, "/api/v1/anchors/" + out.network_ids[0],
                                Json{{"name", word + " lobby"}}.dump());
    EXPECT_EQ(named.status, 200) << named.body;
    const Json excluded{{"kind", "ranges"},
                        {"anchor", out.network_ids[0]},
                        {"since", 1'777'889'473'900'000},
                        {"reason", word}};
    const auto exclusion =
        as(out.who, Method::post, "/api/v1/missions/" + ids["mission"] + "/exclusions", {excluded.dump()});
    EXPECT_EQ(exclusion.status, 201) << exclusion.body;
    ids["exclusion"] = json(exclusion).value("id", "");
    ids["provider"] = json(as(out.who, Method::get, "/omlox/v2/providers"))[0];
    ids["trackable"] = json(as(out.who, Method::get, "/omlox/v2/trackables"))[0];
    const auto job =
        as(out.who, Method::post, "/api/v1/calibrations", {Json{{"missions", {ids["mission"]}}}.dump()});
    EXPECT_EQ(job.status, 202) << job.body;
    ids["job"] = json(job).value("id", "");
    return out;
  }

  static Json plan(const std::string& word, const std::string& site) {
    Json out = Json::parse(R"({"building_height_m":8,"outline":{"type":"Polygon","coordinates":
      [[[3.7131,51.0231],[3.7135275,51.0231],[3.7135275,51.0232799],[3.7131,51.0232799],[3.7131,51.0231]]]},
      "waypoints":[{"lon":3.713,"lat":51.02305,"height_above_ground_m":4},
                   {"lon":3.71362,"lat":51.02305,"height_above_ground_m":9}]})");
    out["name"] = word + " plan";
    out["site"] = site;
    return out;
  }

 protected:
  /// Rows of this mission, of which all but the first are `n` of the next second.
  void fly(const Firm& of, const std::string& mission, int second) {
    std::string fixes, ranges;
    for (int i = 0; i < 10; ++i) {
      const auto t_us = 1'777'889'472'000'000 + second * 1'000'000 + i * 100'000;
      fixes +=
          Json{{"t_us", t_us}, {"lon", 3.7131 + i * 1e-6}, {"lat", 51.0231}, {"h_m", 61.4}, {"fix", "fixed"}}
              .dump() +
          '\n';
      ranges +=
          Json{{"t_us", t_us + 1000}, {"tag", "0x6e01"}, {"anchor", of.network_ids[0]}, {"distance_m", 7.5}}
              .dump() +
          '\n';
    }
    for (const auto& [path, body] : {std::pair{"/api/v1/fixes", fixes}, {"/api/v1/ranges", ranges}}) {
      const auto sent =
          as(of.who, Method::post, path, {body, {{"mission", mission}}, "application/x-ndjson"});
      EXPECT_EQ(sent.status, 200) << sent.body;
      EXPECT_EQ(json(sent).value("accepted", 0), 10) << sent.body;
    }
  }
  /// With the ETag that it has.
  api::Response as_match(const Firm& firm, Method method, const std::string& path, const std::string& body) {
    api::Request request;
    request.method = method;
    request.path = path;
    request.body = body;
    request.headers["content-type"] = "application/json";
    request.headers["if-match"] = header(get_as(firm, path), "ETag");
    request.principal = firm.who;
    request.remote = "127.0.0.1";
    return app_->router().handle(request);
  }
};

}  // namespace anchord::test
