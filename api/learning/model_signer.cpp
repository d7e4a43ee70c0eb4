#include "api/learning/model_signer.hpp"

#include <openssl/rand.h>

#include <nlohmann/json.hpp>

#include "core/base/ed25519.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

std::string hex(std::string_view bytes) {
  std::string out;
  for (const char c : bytes) {
    const auto byte = static_cast<std::uint8_t>(c);
    out += "0123456789abcdef"[byte >> 4];
    out += "0123456789abcdef"[byte & 15];
  }
  return out;
}

std::optional<std::string> from_hex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  const auto digit = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
  };
  std::string out;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const int high = digit(text[i]), low = digit(text[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    out += static_cast<char>(16 * high + low);
  }
  return out;
}

/// What the signature is of. The purpose is part of it: "vouched" is not turned into "made".
std::string message(std::string_view purpose, std::string_view artifact) {
  return "anchord-model-1 " + std::string(purpose) + '\n' + std::string(artifact);
}

struct Parts {
  std::string_view purpose, key, value;
};
std::optional<Parts> parts_of(std::string_view signature) {
  const auto first = signature.find(':');
  const auto second = first == std::string_view::npos ? first : signature.find(':', first + 1);
  if (second == std::string_view::npos) return std::nullopt;
  return Parts{signature.substr(0, first), signature.substr(first + 1, second - first - 1),
               signature.substr(second + 1)};
}

}  // namespace

struct ModelSigner::Key {
  Ed25519Key key;
};

ModelSigner::Seed ModelSigner::random_seed() {
  Seed seed{};
  if (RAND_bytes(seed.data(), static_cast<int>(seed.size())) != 1)
    throw std::runtime_error("the system provides no random bytes for the key of the models");
  return seed;
}

Result<ModelSigner::Seed> ModelSigner::parse_seed(std::string_view text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r' || text.back() == ' '))
    text.remove_suffix(1);
  const auto bytes = from_hex(text);
  Seed seed{};
  if (!bytes || bytes->size() != seed.size())
    return make_error(Errc::invalid_argument, "the key of the models is not 64 hex digits");
  std::ranges::transform(*bytes, seed.begin(), [](char c) { return static_cast<std::uint8_t>(c); });
  return seed;
}

std::string ModelSigner::to_text(const Seed& seed) {
  return hex(std::string_view(reinterpret_cast<const char*>(seed.data()), seed.size()));
}

ModelSigner::ModelSigner(const Seed& seed)
    : key_(std::make_unique<Key>(Key{Ed25519Key(seed)})), key_id_(key_->key.open_half().id()) {}

ModelSigner::~ModelSigner() = default;
ModelSigner::ModelSigner(ModelSigner&&) noexcept = default;

std::string ModelSigner::sign(ModelStanding purpose, std::string_view artifact) const {
  return std::string(to_string(purpose)) + ':' + key_id_ + ':' +
         hex(key_->key.sign(message(to_string(purpose), artifact)));
}

const Ed25519Key& ModelSigner::key() const { return key_->key; }

ModelStanding ModelSigner::standing(std::string_view artifact, std::string_view signature) const {
  const auto parts = parts_of(signature);
  if (!parts || parts->key != key_id_) return ModelStanding::foreign;
  const bool made = parts->purpose == to_string(ModelStanding::made);
  if (!made && parts->purpose != to_string(ModelStanding::vouched)) return ModelStanding::changed;
  const auto value = from_hex(parts->value);
  if (!value || !key_->key.open_half().verifies(message(parts->purpose, artifact), *value))
    return ModelStanding::changed;
  return made ? ModelStanding::made : ModelStanding::vouched;
}

Result<ModelSource::Artifact> ModelSource::artifact(const ModelId& id) const {
  Artifact out;
  BOOST_OUTCOME_TRY(out.stored, store_->model(id));
  BOOST_OUTCOME_TRY(out.text, store_->artifact(id));
  out.standing = signer_->standing(out.text, out.stored.signature);
  if (out.standing == ModelStanding::changed)
    return make_error(Errc::conflict, "model " + anchord::to_string(id) +
                                          " does not match the signature of this server: its artifact was "
                                          "changed. Train it again, or upload the original artifact");
  return out;
}

std::string exported_artifact(std::string_view artifact, std::string_view signature) {
  const auto end = artifact.rfind('}');
  if (signature.empty() || end == std::string_view::npos) return std::string(artifact);
  return std::string(artifact.substr(0, end)) + ",\"signature\":" + json_text(signature) + "}\n";
}

std::string signature_in(std::string_view exported) {
  const auto root = nlohmann::json::parse(exported, nullptr, false);
  const auto at = root.is_object() ? root.find("signature") : root.end();
  return at != root.end() && at->is_string() ? at->get<std::string>() : std::string{};
}

}  // namespace anchord::api
