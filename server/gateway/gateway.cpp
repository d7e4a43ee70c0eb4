#include "server/gateway/gateway.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "api/kit/problem.hpp"
#include "core/base/locked.hpp"
#include "core/base/steady.hpp"
#include "server/gateway/row_lines.hpp"
#include "server/gateway/sender.hpp"
#include "server/gateway/status.hpp"
#include "server/http/http_server.hpp"
#include "server/runtime/device_manager.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/private_file.hpp"
#include "server/runtime/worker_pool.hpp"

namespace anchord::gateway {
namespace {

namespace fs = std::filesystem;
using server::LogLevel;

constexpr const char* k_address_file = "address";  // as a server's: healthcheck finds it there
constexpr std::size_t k_status_queue = 32;

/// Rows of the devices into the outbox.
class KeptRows final : public DeviceRows {
 public:
  KeptRows(Outbox& outbox, Sender& sender) : outbox_(outbox), sender_(sender) {}
  void live(const DeviceBatch&) override {}  // no flight is followed here
  Result<void> store(const DeviceBatch& batch) override {
    auto batches = batches_of(batch);
    auto kept = outbox_.keep(batches);
    // The server can have them all the same.
    if (!kept && outbox_.hold(std::move(batches))) kept = boost::outcome_v2::success();
    if (kept) sender_.rows_came();
    return kept;
  }

 private:
  Outbox& outbox_;
  Sender& sender_;
};

/// The oldest parts of recordings go until the folder has room again; never the newest, which is being
/// written.
void prune_recordings(const fs::path& folder, std::uint64_t max_bytes) {
  std::error_code error;
  std::vector<std::pair<fs::path, std::uint64_t>> parts;
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() != ".anrec") continue;
    const auto size = entry.file_size(error);
    if (error) continue;
    parts.emplace_back(entry.path(), size);
    bytes += size;
  }
  std::ranges::sort(parts);
  for (std::size_t i = 0; i + 1 < parts.size() && bytes > max_bytes; ++i) {
    if (!fs::remove(parts[i].first, error)) continue;
    bytes -= parts[i].second;
    server::log(LogLevel::warning, "removed the oldest recording",
                {{"file", parts[i].first.string()}, {"limit_mib", std::to_string(max_bytes >> 20)}});
  }
}

api::Response answer(int status, std::string type, std::string body) {
  api::Response response;
  response.status = status;
  response.header("Content-Type", std::move(type)).header("Cache-Control", "no-store");
  response.body = std::move(body);
  return response;
}

/// What the gateway answers on its loopback address: nothing can be changed by it.
class StatusPages final : public server::Gateway {
 public:
  StatusPages(std::function<Status()> status, std::function<std::string()> device_metrics)
      : status_(std::move(status)), device_metrics_(std::move(device_metrics)) {}

  server::Admission admit(api::Request& request, std::string_view, bool) override {
    server::Admission admission;
    admission.route = known(request.path) ? request.path : "none";
    if (request.method != api::Method::get)
      admission.refusal = problem(405, "method", "only GET is supported here").header("Allow", "GET");
    else if (!known(request.path))
      admission.refusal =
          problem(404, "not-found", "the addresses are /status, /healthz, /readyz and /metrics");
    else
      admission.run = [this](const api::Request& r) { return page(r.path); };
    return admission;
  }
  api::Response problem(int status, std::string_view type, std::string detail) override {
    return api::problem(status, type, std::move(detail));
  }
  void answered(const api::Request&, std::string_view, int, double, std::size_t) override {}

 private:
  static bool known(std::string_view path) {
    return path == "/status" || path == "/healthz" || path == "/readyz" || path == "/metrics";
  }
  api::Response page(std::string_view path) const {
    if (path == "/healthz") return answer(200, "application/json", R"({"status":"ok"})");
    const auto status = status_();
    if (path == "/metrics")
      return answer(200, "text/plain; version=0.0.4", metrics_text(status) + device_metrics_());
    if (path == "/status") return answer(200, "application/json", status_json(status));
    return answer(status.outbox.trouble.empty() ? 200 : 503, "application/json", ready_json(status));
  }
  std::function<Status()> status_;
  std::function<std::string()> device_metrics_;
};

}  // namespace

struct FieldGateway::State {
  GatewayOptions options;
  SystemClock clock;
  SteadyTime began{system_steady_clock().now()};
  std::unique_ptr<Outbox> outbox;
  std::unique_ptr<server::DeviceManager> devices;
  std::unique_ptr<Sender> sender;
  std::unique_ptr<KeptRows> rows;
  std::unique_ptr<StatusPages> pages;
  std::unique_ptr<server::WorkerPool> pool;
  std::unique_ptr<server::HttpServer> http;
  std::string url;
  bool stopped{false};

  Status status() const {
    Status out;
    out.version = options.version;
    out.to = options.to;
    const auto steady = system_steady_clock().now();
    out.uptime_s = seconds_between(began, steady);
    out.now = clock.now();
    out.sender = sender->status();
    out.link_s = seconds_between(out.sender.link == Link::unknown ? began : out.sender.since, steady);
    out.outbox = outbox->state();
    out.oldest_waiting = outbox->oldest_waiting();
    std::error_code error;
    const auto space = fs::space(options.data_dir, error);
    out.disk_free_bytes = error ? 0 : space.available;
    out.devices = devices->devices();
    out.recorder_failure = devices->recorder_failure();
    out.not_started = devices->not_started();
    out.clock_skew = devices->clock().skew;
    out.rows_dropped = devices->rows_lost();
    out.rejected_file = (options.data_dir / "rejected.ndjson").string();
    return out;
  }

  Result<void> make();
  Result<void> listen();
};

Result<void> FieldGateway::State::make() {
  BOOST_OUTCOME_TRY(outbox, Outbox::open(options.data_dir, options.max_bytes, options.new_outbox));
  server::DeviceManagerOptions device_options;
  device_options.data_dir = options.data_dir;
  device_options.from_config = options.devices;
  device_options.log = [](const std::string& text) { server::log(LogLevel::info, text); };
  BOOST_OUTCOME_TRY(devices, server::DeviceManager::open(device_options));
  SenderOptions send;
  send.url = options.to;
  send.token_file = options.token_file;
  send.data_dir = options.data_dir;
  send.mission = options.mission;
  send.record_into = [this](const auto& mission) { devices->record_into(mission); };
  send.log = [](const std::string& text) { server::log(LogLevel::info, text); };
  BOOST_OUTCOME_TRY(sender, Sender::make(*outbox, std::move(send)));
  rows = std::make_unique<KeptRows>(*outbox, *sender);
  return boost::outcome_v2::success();
}

Result<void> FieldGateway::State::listen() {
  BOOST_OUTCOME_TRY(const bool loopback, server::is_loopback(options.listen));
  if (!loopback) {
    return make_error(
        Errc::invalid_argument,
        "--listen " + options.listen + ": the status is served to this machine only: give 127.0.0.1:PORT");
  }
  pages = std::make_unique<StatusPages>([this] { return status(); }, [this] { return devices->metrics(); });
  pool = std::make_unique<server::WorkerPool>("anchord-status", 1, k_status_queue);
  server::HttpServerOptions http_options;
  http_options.hosts.hosts = {"localhost", "127.0.0.1", "[::1]"};
  http = std::make_unique<server::HttpServer>(http_options, *pages,
                                              server::Executors{*pool, *pool, *pool, *pool, *pool});
  BOOST_OUTCOME_TRY(const auto port, http->listen(options.listen));
  url = "http://" + options.listen.substr(0, options.listen.rfind(':')) + ":" + std::to_string(port);
  http->every(std::chrono::seconds(30), "recordings",
              [this] { prune_recordings(options.data_dir / "recordings", options.max_recording_bytes); });
  return server::write_private(options.data_dir / k_address_file, url + "\n");
}

FieldGateway::FieldGateway(std::unique_ptr<State> state) : state_(std::move(state)) {}
FieldGateway::~FieldGateway() { stop(); }
const std::string& FieldGateway::url() const { return state_->url; }

Result<std::unique_ptr<FieldGateway>> FieldGateway::start(const GatewayOptions& options) {
  auto state = std::make_unique<State>();
  state->options = options;
  BOOST_OUTCOME_TRYV(state->make());
  BOOST_OUTCOME_TRYV(state->listen());
  auto gateway = std::unique_ptr<FieldGateway>(new FieldGateway(std::move(state)));
  auto& s = *gateway->state_;
  s.sender->start();  // says which mission records, before the first row
  s.devices->start(*s.rows);
  s.http->start();
  server::log(LogLevel::info, "gateway runs", {{"to", options.to}, {"status", s.url + "/status"}});
  return gateway;
}

void FieldGateway::stop() {
  auto& s = *state_;
  if (std::exchange(s.stopped, true)) return;
  if (s.http) s.http->stop(std::chrono::seconds(1));
  if (s.sender) s.sender->stop();
  if (s.devices) s.devices->stop();  // what waits goes to the outbox while it is open
  if (s.outbox && !s.outbox->try_disk())
    server::log(
        LogLevel::error, "rows were in memory alone and are lost; 'anchord replay' restores them",
        {{"rows", std::to_string(s.outbox->state().rows_in_memory)}, {"why", s.outbox->state().trouble}});
  if (s.pool) s.pool->stop();
  s.http.reset();
  std::error_code ignored;
  if (!s.url.empty()) fs::remove(s.options.data_dir / k_address_file, ignored);
}

}  // namespace anchord::gateway
