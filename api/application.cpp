#include "api/application.hpp"

#include "api/application_state.hpp"
#include "api/learning/promotion_events.hpp"
#include "api/learning/sign_kept_models.hpp"
#include "api/omlox/omlox_conversation.hpp"
#include "api/stream/conversation.hpp"
#include "core/ports/broker.hpp"

namespace anchord::api {

Application::Application(Deps deps) : state_(std::make_unique<State>(std::move(deps))) {}
Application::~Application() { stop(); }

Router& Application::router() { return state_->router; }
Hub& Application::hub() { return state_->hub; }
DeviceRows& Application::device_rows() { return state_->device_ingest; }

std::optional<Response> Application::at_hand(const Route& route, const Request& request) const {
  if (route.pattern != k_anchor_pattern || !request.principal.sites.all()) return std::nullopt;
  return state_->anchor_answers.find(request);
}

WsHandlerFactory Application::ws_factory() {
  return [this](const Principal& who, std::function<bool()> holds) {
    return std::make_unique<Conversation>(state_->hub, who, std::move(holds));
  };
}

TokenWsFactory Application::omlox_ws_factory() {
  return [this](Listener first, TokenDoor door) {
    return std::make_unique<OmloxConversation>(state_->hub, state_->omlox_locations, std::move(first),
                                               std::move(door));
  };
}

void Application::start() {
  if (std::exchange(state_->started, true)) return;
  // Whatever is kept, the server starts: what cannot be taken up again is told.
  (void)guarded("models and events at start", [this] {
    if (state_->deps.model_key_is_new) {
      if (const auto n = sign_kept_models(state_->stores.models, state_->signer); n > 0)
        state_->events.add(EventLevel::info, "model.signed",
                           std::to_string(n) + " older models are signed with this server's new key " +
                               state_->signer.key_id());
    }
    const auto loaded = state_->models.reload();
    if (const auto& fault = state_->models.active()->fault; !fault.empty())
      state_->events.add(EventLevel::warning, "model.refused", fault);
    if (!loaded) state_->deps.log_fault("", loaded.error().message);
    const auto before = promotion_events(state_->stores.models);
    if (before)
      state_->events.restore(before.value());
    else
      state_->deps.log_fault("", before.error().message);
  });
  (void)guarded("missions at start", [this] { state_->missions.resume(); });
  (void)guarded("devices of the flight at start", [this] { state_->stream.resume(); });
  (void)guarded("webhooks at start", [this] { state_->webhooks.changed(); });
  if (state_->deps.broker != nullptr) state_->deps.broker->start(state_->publisher);
  state_->flights.start();
  state_->jobs.start();
  if (state_->desk) state_->desk->start();
  state_->housekeeping.start();
  state_->heart = Thread("anchord-beat", [this] { state_->beat(); });
}

void Application::stream_round() { state_->hub.tick(); }

void Application::fly() { state_->flights.step(); }

void Application::housekeeping_round() { state_->housekeeping.round(); }

void Application::halt() { state_->flights.stop(); }

void Application::stop() {
  if (state_->stopping.exchange(true)) return;
  state_->stop_told.notify_all();
  if (state_->heart.joinable()) state_->heart.join();
  if (state_->deps.broker != nullptr) state_->deps.broker->stop();
  state_->housekeeping.stop();
  state_->demonstration.stop();
  state_->flights.stop();
  state_->hub.shut_down();
  if (state_->desk) state_->desk->stop();
  state_->jobs.stop();
  state_->missions.stop();
  state_->webhooks.stop();
  state_->late.stop();
}

}  // namespace anchord::api
