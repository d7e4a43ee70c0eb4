#include "api/learning/sign_kept_models.hpp"

#include <optional>
#include <set>

namespace anchord::api {
namespace {

constexpr std::size_t k_most_promotions = 100'000, k_page = 100;

}  // namespace

std::size_t sign_kept_models(ModelStore& store, const ModelSigner& signer) {
  std::set<ModelId> promoted;
  if (const auto all = store.promotions("", k_most_promotions)) {
    for (const auto& one : all.value())
      if (one.model) promoted.insert(*one.model);
  }
  std::optional<ModelId> after;
  std::size_t n = 0;
  while (true) {
    const auto page = store.models(k_page, after);
    if (!page || page.value().empty()) return n;
    for (const auto& model : page.value()) {
      after = model.id;
      if (!model.signature.empty() || (!model.run && !promoted.contains(model.id))) continue;
      const auto text = store.artifact(model.id);
      if (!text) continue;
      const auto purpose = model.run ? ModelStanding::made : ModelStanding::vouched;
      if (store.sign(model.id, signer.sign(purpose, text.value()))) ++n;
    }
  }
}

}  // namespace anchord::api
