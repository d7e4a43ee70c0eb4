#include "api/anchors/anchor_answers.hpp"

#include "api/anchors/contradiction_watch.hpp"
#include "api/kit/content_tag.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_kept = 5000;  // some 3 kB each

}  // namespace

std::optional<AnchorAnswers::State> AnchorAnswers::state() const {
  const auto stored = revisions_.changes();
  const auto contradicted = contradictions_.settled();
  if (!stored || !contradicted) return std::nullopt;
  return State{*stored, *contradicted};
}

void AnchorAnswers::keep(const std::string& id, const std::optional<State>& of, Answer answer) {
  if (!of) return;
  auto made = std::make_shared<const Answer>(std::move(answer));
  auto kept = kept_.lock();
  if (kept->of != *of || kept->by_id.size() >= k_most_kept) kept->by_id.clear();
  kept->of = *of;
  kept->by_id.insert_or_assign(id, std::move(made));
}

std::optional<Response> AnchorAnswers::find(const Request& request) const {
  if ((request.method != Method::get && request.method != Method::head) || !request.query.empty())
    return std::nullopt;
  const auto id = request.params.find("id");
  const auto now = state();
  if (!now || id == request.params.end()) return std::nullopt;
  std::shared_ptr<const Answer> answer;
  {
    const auto kept = kept_.lock();
    const auto found = kept->of == *now ? kept->by_id.find(id->second) : kept->by_id.end();
    if (found == kept->by_id.end()) return std::nullopt;
    answer = found->second;
  }
  Response response;
  response.header("Content-Type", "application/geo+json");
  response.header("ETag", answer->etag);
  if (!etag_listed(request.header("if-none-match"), answer->etag)) response.body = answer->body;
  return response;
}

}  // namespace anchord::api
