#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord {
class Ed25519Key;
}

namespace anchord::api {

/// What this server can say of a stored artifact.
enum class ModelStanding : std::uint8_t {
  made,     ///< trained here, and not a byte is another since
  vouched,  ///< from elsewhere; promoted here, and not a byte is another since
  foreign,  ///< nobody here has said anything about it yet
  changed,  ///< signed here, and edited afterwards: never used
};
inline constexpr auto k_standing_words = enum_table<ModelStanding>({{"made", ModelStanding::made},
                                                                    {"vouched", ModelStanding::vouched},
                                                                    {"foreign", ModelStanding::foreign},
                                                                    {"changed", ModelStanding::changed}});
constexpr std::string_view to_string(ModelStanding standing) { return k_standing_words.word(standing); }

/// Signs artifacts with the server's own Ed25519 key (RFC 8032), over "anchord-model-1 made\n" (or
/// "vouched\n") and the artifact's canonical bytes, which are what write_model_artifact gives. A signature is
/// the text "made:<key id>:<128 hex digits>". Pure; safe to call from any thread.
class ModelSigner {
 public:
  using Seed = std::array<std::uint8_t, 32>;
  static Seed random_seed();
  /// Of 64 hex digits, as the key file has it. errors: invalid_argument
  static Result<Seed> parse_seed(std::string_view text);
  static std::string to_text(const Seed& seed);

  explicit ModelSigner(const Seed& seed);
  ~ModelSigner();
  ModelSigner(ModelSigner&&) noexcept;

  /// Of the public key: the first 16 hex digits of its SHA-256.
  const std::string& key_id() const { return key_id_; }
  /// The server's key itself. What it signs elsewhere must not begin with "anchord-model-".
  const Ed25519Key& key() const;
  std::string sign(ModelStanding purpose, std::string_view artifact) const;
  /// foreign without a signature, or with one of another key.
  ModelStanding standing(std::string_view artifact, std::string_view signature) const;

 private:
  struct Key;
  std::unique_ptr<Key> key_;
  std::string key_id_;
};

/// Models as they may be used: nothing that was edited after it was signed leaves here.
class ModelSource {
 public:
  ModelSource(ModelStore& store, const ModelSigner& signer) : store_(&store), signer_(&signer) {}
  struct Artifact {
    StoredModel stored;
    std::string text;
    ModelStanding standing{ModelStanding::foreign};
  };
  /// errors: those of the store; conflict when it was changed after it was signed
  Result<Artifact> artifact(const ModelId& id) const;
  ModelStore& store() const { return *store_; }
  const ModelSigner& signer() const { return *signer_; }

 private:
  ModelStore* store_;
  const ModelSigner* signer_;
};

/// The artifact as it leaves the server: with its signature as last member, where it has one.
std::string exported_artifact(std::string_view artifact, std::string_view signature);
/// The signature of an exported one; empty where it has none.
std::string signature_in(std::string_view exported);

}  // namespace anchord::api
