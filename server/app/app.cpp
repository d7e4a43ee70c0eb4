#include "server/app/app.hpp"

#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "api/application.hpp"
#include "api/stream/hub.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "server/app/authenticator.hpp"
#include "server/app/metrics.hpp"
#include "server/app/model_key.hpp"
#include "server/app/standby.hpp"
#include "server/app/startup.hpp"
#include "server/config/listeners.hpp"
#include "server/flight/demonstration_flight.hpp"
#include "server/flight/drone_link.hpp"
#include "server/http/http_server.hpp"
#include "server/http/request_check.hpp"
#include "server/http/text.hpp"
#include "server/http/web_post.hpp"
#include "server/mqtt/mqtt_broker.hpp"
#include "server/runtime/backup_keeper.hpp"
#include "server/runtime/chromium_pdf.hpp"
#include "server/runtime/database_worker.hpp"
#include "server/runtime/device_manager.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/private_file.hpp"
#include "server/runtime/worker_pool.hpp"
#include "server/runtime/worker_process.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/geopackage.hpp"
#include "server/storage/postgres_database.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::server {
namespace {

namespace fs = std::filesystem;

HostPolicy host_policy(const Config& config, const std::vector<Listener>& listeners) {
  HostPolicy policy{{"localhost", "127.0.0.1", "[::1]"}, {}};
  for (const auto& one : listeners) policy.hosts.push_back(host_name(one.address));
  for (const auto& host : config.list("allowed_hosts")) policy.hosts.push_back(lower(host));
  for (const auto& origin : config.list("allowed_origins")) policy.origins.push_back(lower(origin));
  return policy;
}

/// Every setting with its value and where that comes from; files are named, never read.
std::string settings_text(const Config& config) {
  std::string out;
  for (const auto& option : options()) {
    const auto& value = config.values.find(option.key)->second;
    out.append(option.key).append(" = \"").append(value.text).append("\"  # ");
    out.append(to_string(value.origin)).append("\n");
  }
  return out;
}

/// Backup, calibration, discovery, training, pictures of plans, the archive of impulse responses, what of
/// calibrations runs here although workers may, and room for one more.
constexpr std::size_t k_kinds_of_jobs = 8;

/// For the commands of this machine: a plain address if there is one, and never one that is only for
/// listening.
std::string local_address(const std::vector<std::string>& urls) {
  const auto plain = std::ranges::find_if(urls, [](const auto& url) { return url.starts_with("http://"); });
  std::string url = plain == urls.end() ? urls.front() : *plain;
  // A certificate has names; "any address" is none.
  for (const auto& [any, own] :
       {std::pair{"https://0.0.0.0:", "https://127.0.0.1:"}, std::pair{"https://[::]:", "https://[::1]:"}}) {
    if (url.starts_with(any)) url.replace(0, std::string_view(any).size(), own);
  }
  return url;
}

/// As many descriptors as the system lets us have: connections, database and models need them.
std::size_t raise_descriptor_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1024;
  limit.rlim_cur = limit.rlim_max == RLIM_INFINITY ? 65'536 : std::min<rlim_t>(limit.rlim_max, 65'536);
  setrlimit(RLIMIT_NOFILE, &limit);
  getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<std::size_t>(limit.rlim_cur);
}

}  // namespace

struct App::State {
  Config config;
  std::function<std::string()> doctor;
  SystemClock clock;
  struct Commanding {
    api::Application* application{nullptr};
    bool taken_over{false};
  };
  Locked<Commanding> commanding;  ///< outlives the lease in the database, which may end it
  std::unique_ptr<Database> database;
  std::unique_ptr<Backups> backups;
  std::unique_ptr<Metrics> metrics;
  std::unique_ptr<api::AccessService> access;
  std::unique_ptr<WorkerPool> pool, stream_pool, command_pool, flight_pool, heavy_pool;  ///< of handlers
  std::unique_ptr<WorkerPool> live_pool, joint_pool, plan_pool, job_pool;  ///< of what no request waits for
  std::unique_ptr<DeviceManager> devices;
  ModelKey model_key;
  std::unique_ptr<flight::DroneLink> drone;
  std::unique_ptr<WebPost> web_post;
  std::unique_ptr<Broker> broker;
  std::unique_ptr<api::Application> application;
  std::unique_ptr<Authenticator> door;
  std::unique_ptr<HttpServer> http;
  std::vector<std::string> urls;
  fs::path data_dir;
  TrustedProxies proxies;
  std::vector<Listener> listeners;
  std::shared_ptr<TlsKeeper> tls;  ///< null: no TLS
  bool stopped{false};

  Result<void> open_rows(const Waiting& waiting);
  void abandon(std::string_view why);
  Result<void> first_token();
  Result<void> open_devices();
  Result<void> open_drone();
  Result<void> open_broker();
  std::unique_ptr<Backups> make_backups() const;
  std::vector<api::AlarmCondition> alarms() const;
  void compose();
  void open_door();
  Result<void> listen();
};

namespace {

api::StorageStatus status_of(Database& database) {
  const StorageHealth health = database.health();
  api::StorageStatus status;
  status.writable = health.writable();
  status.reason = health.reason;
  status.stalled = health.level == StorageLevel::stalled;
  status.db_bytes = health.db_bytes + health.wal_bytes;
  status.disk_free_bytes = health.disk_free_bytes;
  status.queue_depth = health.queued_rows;
  status.synchronous = to_string(health.synchronous);
  status.stood_by = health.stood_by;
  return status;
}

}  // namespace

Result<void> App::State::open_rows(const Waiting& waiting) {
  StorageOptions options;
  options.data_dir = data_dir;
  // One for each thread that reads, so that a command never waits for somebody else's to be free.
  options.readers = config.count("http.workers") + config.count("http.heavy_workers") +
                    config.count("http.upload_workers") + 10;
  BOOST_OUTCOME_TRY(options.synchronous,
                    k_synchronous_words.parse("storage.synchronous", config.text("storage.synchronous")));
  const auto& address = config.text("database");
  LeaseWish wish;
  wish.server = worker_name();
  wish.standby = config.flag("standby");
  wish.url = config.text("standby_url");
  wish.stopping = waiting.stopping;
  BOOST_OUTCOME_TRY(const auto standby, Standby::make(config, listeners, proxies));
  wish.waits = [&standby, ready = waiting.ready](std::string_view other, std::string_view url) {
    standby->wait_for(other, url);
    if (ready) ready();
  };
  wish.cannot = [](std::string_view why) {
    log(LogLevel::warning, "standing by, but the database cannot be asked; it is tried again",
        {{"why", std::string(why)}});
  };
  wish.lost = [this](std::string_view why) { abandon(why); };
  BOOST_OUTCOME_TRY(database, open_store(address, options, std::move(wish)));
  if (!address.empty())
    log(LogLevel::info, "rows are in PostgreSQL", {{"database", sql::shown_address(address)}});
  return boost::outcome_v2::success();
}

/// The other server may command the aircraft by now.
void App::State::abandon(std::string_view why) {
  log(LogLevel::error, "ending: another server has the database, or takes it", {{"why", why}});
  {
    auto c = commanding.lock();
    c->taken_over = true;
    if (c->application != nullptr) c->application->halt();
  }
  ::kill(::getpid(), SIGTERM);
}

Result<void> App::State::first_token() {
  if (config.text("auth") == "off" || access->has_tokens()) return boost::outcome_v2::success();
  const api::Principal first_run{"first-run", "first run", {}};
  BOOST_OUTCOME_TRY(const auto made,
                    access->create_token("first run", {"admin"}, std::nullopt, first_run, "local"));
  const fs::path file = data_dir / k_admin_token_file;
  BOOST_OUTCOME_TRYV(write_private(file, made.text + "\n"));
  log(LogLevel::info, "created the first admin token", {{"file", file.string()}});
  // Only to a person: a redirected stderr is a log.
  if (isatty(STDERR_FILENO) == 1) {
    std::fprintf(stderr, "\nFirst start. The admin token, shown once (also in %s):\n\n  %s\n\n", file.c_str(),
                 made.text.c_str());
  }
  return boost::outcome_v2::success();
}

Result<void> App::State::listen() {
  HttpServerOptions options;
  options.limits = http_limits(config);
  options.ws_limits = ws_limits(config);
  options.hosts = host_policy(config, listeners);
  options.io_threads = config.count("http.io_threads");
  options.tls = tls;
  options.is_proxy = [this](std::string_view address) { return proxies.trusts(address); };
  const std::size_t descriptors = raise_descriptor_limit();
  options.limits.max_connections =
      std::min(options.limits.max_connections, descriptors - std::min<std::size_t>(descriptors / 2, 128));
  http = std::make_unique<HttpServer>(
      options, *door, Executors{*pool, *stream_pool, *command_pool, *flight_pool, *heavy_pool});
  http->every(std::chrono::milliseconds(50), "live stream", [this] { application->stream_round(); });
  for (const auto& [address, secure] : listeners) {
    BOOST_OUTCOME_TRY(const auto port, http->listen(address, secure));
    urls.push_back((secure ? "https://" : "http://") + address.substr(0, address.rfind(':')) + ":" +
                   std::to_string(port));
  }
  if (tls) {
    metrics->gauge("anchord_tls_certificate_expiry_seconds",
                   "Unix time at which the served certificate expires",
                   [this] { return tls->facts().not_after.seconds(); });
    metrics->gauge("anchord_tls_handshakes_failed", "Connections whose TLS handshake failed or took too long",
                   [this] { return static_cast<double>(http->failed_handshakes()); });
  }
  metrics->gauge("anchord_http_connections", "Sockets open",
                 [this] { return static_cast<double>(http->connections()); });
  metrics->gauge("anchord_ws_clients", "WebSocket clients",
                 [this] { return static_cast<double>(http->websockets()); });
  metrics->gauge("anchord_log_lost_lines",
                 "Lines of the log that were dropped because standard error was not read in time",
                 [] { return static_cast<double>(lost_log_lines()); });
  metrics->gauge("anchord_command_queue", "Commands that are waiting for their executor",
                 [this] { return static_cast<double>(command_pool->queued()); });
  metrics->gauge("anchord_heavy_queue", "Computations that are waiting for their executor",
                 [this] { return static_cast<double>(heavy_pool->queued()); });
  metrics->gauge("anchord_worker_queue", "Requests that are waiting for a handler",
                 [this] { return static_cast<double>(pool->queued()); });
  http->start();
  BOOST_OUTCOME_TRYV(write_private(data_dir / k_address_file, local_address(urls) + "\n"));
  for (const auto& url : urls) log(LogLevel::info, "listening", {{"url", url}});
  return boost::outcome_v2::success();
}

Result<void> App::State::open_devices() {
  DeviceManagerOptions options;
  options.data_dir = data_dir;
  options.from_config = config.list("devices");
  options.max_waiting_rows = config.count("storage.device_queue");
  options.log = [](const std::string& text) { log(LogLevel::info, "device", {{"what", text}}); };
  BOOST_OUTCOME_TRY(devices, DeviceManager::open(std::move(options)));
  return boost::outcome_v2::success();
}

Result<void> App::State::open_drone() {
  BOOST_OUTCOME_TRY(const auto end, drone_end(config));
  if (!end) return boost::outcome_v2::success();
  auto opened = flight::DroneLink::open(
      end->address,
      [](std::string_view what) {
        log(LogLevel::warning, "drone", {{"what", what}});
      },
      end->key);
  if (!opened) return make_error(opened.error().code, "drone.address: " + opened.error().message);
  drone = std::move(opened).value();
  return boost::outcome_v2::success();
}

Result<void> App::State::open_broker() {
  BOOST_OUTCOME_TRY(auto options, mqtt_options(config));
  if (!options) return boost::outcome_v2::success();
  auto opened = make_mqtt_broker(*std::move(options));
  if (!opened) return make_error(Errc::invalid_argument, "mqtt.ca_file: " + opened.error().message);
  broker = std::move(opened).value();
  return boost::outcome_v2::success();
}

namespace {

/// Where bundles are made and uploads wait, without what requests left that a stop cut off.
/// As the alarm disk.low.
constexpr std::uint64_t k_low_disk_bytes = std::uint64_t{2} << 30;

fs::path emptied_spool(const fs::path& data_dir) {
  std::error_code none;
  fs::remove_all(data_dir / "spool", none);
  return data_dir / "spool";
}

}  // namespace

std::unique_ptr<Backups> App::State::make_backups() const {
  if (!config.text("database").empty()) return std::make_unique<NoBackups>(k_postgres_backups);
  BackupKeeper::Options keep;
  keep.dir = config.text("backup.dir").empty() ? data_dir / "backups" : fs::path(config.text("backup.dir"));
  keep.keep = config.count("backup.keep");
  keep.every_h = config.count("backup.every_h");
  keep.scheduled = config.text("backup.schedule") == "on";
  return std::make_unique<BackupKeeper>(*database, clock, std::move(keep));
}

/// What only the program knows: rows that left memory before they were stored, certificates that end.
std::vector<api::AlarmCondition> App::State::alarms() const {
  std::vector<api::AlarmCondition> out;
  if (const auto lost = devices->rows_lost(); lost > 0)
    out.push_back({"rows.lost", api::AlarmPriority::critical,
                   std::to_string(lost) +
                       " measurements of devices have not been stored since the server started; they are in "
                       "the raw recordings in " +
                       to_utf8((data_dir / "recordings").string()) +
                       ": anchord replay RECORDING --url URL sends them to the server, without storing any "
                       "of them twice",
                   std::nullopt});
  if (auto ids = devices->too_many_ids(); !ids.empty())
    out.push_back({"devices.ids", api::AlarmPriority::warning, std::move(ids), std::nullopt});
  if (auto unused = devices->unused_sources(); !unused.empty())
    out.push_back(
        {"devices.unused", api::AlarmPriority::warning, std::move(unused), devices->recording_into()});
  if (auto moved = devices->moved_bases(); !moved.empty())
    out.push_back({"rtk.base", api::AlarmPriority::warning, std::move(moved), devices->recording_into()});
  std::error_code unknown;
  const auto space = fs::space(data_dir, unknown);
  if (!unknown && space.available < k_low_disk_bytes)
    if (const auto recordings = devices->recordings_on_disk(); !recordings.empty())
      out.push_back(
          {"disk.recordings", api::AlarmPriority::warning,
           "the disk of the data is low: " + recordings +
               "; switch off a device that sends noise, and move recordings of old flights elsewhere",
           std::nullopt});
  if (!tls) return out;
  for (auto& warning : tls_warnings(tls->facts(), tls->failure(), clock.now()))
    out.push_back({std::move(warning.id),
                   warning.critical ? api::AlarmPriority::critical : api::AlarmPriority::warning,
                   std::move(warning.text), std::nullopt});
  return out;
}

void App::State::compose() {
  pool =
      std::make_unique<WorkerPool>("anchord-work", config.count("http.workers"), config.count("http.queue"));
  stream_pool = std::make_unique<WorkerPool>("anchord-upload", config.count("http.upload_workers"), 64);
  // Commands compute nothing and wait for nothing, so few threads do; what else belongs to flying may wait
  // for the disk, and must not make them wait.
  command_pool = std::make_unique<WorkerPool>("anchord-command", 4, 256);
  flight_pool = std::make_unique<WorkerPool>("anchord-flight", 4, 64);
  heavy_pool = std::make_unique<WorkerPool>("anchord-heavy", config.count("http.heavy_workers"),
                                            config.count("http.heavy_queue"), 10);
  // Apart from the handlers, so that a flight that is being solved never makes a page wait.
  live_pool = std::make_unique<WorkerPool>("anchord-live", 2, 4096);
  joint_pool = std::make_unique<WorkerPool>("anchord-joint", 1, 1);
  plan_pool = std::make_unique<WorkerPool>("anchord-plan", 1, 16);
  job_pool = std::make_unique<WorkerPool>("anchord-job", k_kinds_of_jobs, k_kinds_of_jobs);
  backups = make_backups();
  api::Application::Deps deps{.stores = database->stores(),
                              .work = {*live_pool, *joint_pool, *plan_pool, *job_pool},
                              .clock = clock,
                              .access = *access,
                              .backups = *backups,
                              .devices = *devices,
                              .model_key = model_key.text};
  deps.build = {ANCHORD_VERSION, ANCHORD_GIT, ANCHORD_BUILD_TYPE, __VERSION__,
                database->health().schema_version};
  deps.drone = drone.get();
  deps.goal = {config.metres("goal.h95_m"), config.metres("goal.v95_m")};
  deps.site_outline = config.text("solve.site_outline") == "on";
  deps.demonstration = flight::demonstration_flight;
  deps.calibrate_landed = config.text("solve.after_landing") == "on";
  deps.track.max_correction_age_s =
      std::chrono::duration<double>(config.seconds("solve.max_correction_age_s")).count();
  deps.storage_status = [this] { return status_of(*database); };
  deps.metrics_text = [this] { return metrics->text() + devices->metrics(); };
  deps.support_files = [this] {
    return std::vector<std::pair<std::string, std::string>>{{"settings.txt", settings_text(config)},
                                                            {"log.jsonl", recent_log()},
                                                            {"doctor.json", doctor ? doctor() : ""}};
  };
  deps.log_fault = [](std::string_view request_id, std::string_view what) {
    log(LogLevel::error, "fault in a handler", {{"request_id", request_id}, {"what", what}});
  };
  deps.server_alarms = [this] { return alarms(); };
  deps.geopackage = geopackage;
  deps.feature_file = make_geopackage_file;
  deps.print_pdf = print_with_chromium;
  deps.geoid_dir = config.text("geoid.dir");
  deps.spool_dir = emptied_spool(data_dir);
  web_post = make_web_post(config.flag("webhooks.allow_private"), config.text("webhooks.ca_file"));
  deps.web_post = web_post.get();
  deps.broker = broker.get();
  deps.mqtt_prefix = config.text("mqtt.prefix");
  deps.run_plan_work = deps.run_work = work_in_process();
  deps.work_store = database->work();
  deps.run_jobs_here = config.text("jobs.run_here") == "on";
  deps.job_lease = config.seconds("jobs.lease_s");
  deps.worker_name = "server " + worker_name();
  deps.model_key_is_new = model_key.fresh;
  deps.cir_archive = &database->cir_archive();
  if (const auto days = config.count("missions.keep_cir_days"); days > 0)  // "off" is no number
    deps.keep_cir_days = static_cast<std::int64_t>(days);
  deps.keep_deleted_ns =
      static_cast<std::int64_t>(config.count("missions.keep_deleted_days")) * 86'400 * 1'000'000'000;
  application = std::make_unique<api::Application>(std::move(deps));
  application->start();
  {
    auto c = commanding.lock();
    c->application = application.get();
  }
  if (drone) drone->start();  // after a flight that goes on has said which aircraft is its own
  devices->start(application->device_rows());
}

void App::State::open_door() {
  AuthenticatorOptions options;
  options.hosts = host_policy(config, listeners);
  options.rate_per_s = static_cast<double>(config.count("rate.per_s"));
  options.rate_burst = static_cast<double>(config.count("rate.burst"));
  options.places = {config.count("ws.max_connections"), config.count("ws.per_token"),
                    config.count("ws.reserved")};
  options.proxies = proxies;
  options.at_hand = [this](const api::Route& route, const api::Request& request) {
    return application->at_hand(route, request);
  };
  options.slow_s = static_cast<double>(config.count("log_slow_ms")) / 1000;
  door = std::make_unique<Authenticator>(application->router(), application->ws_factory(),
                                         application->omlox_ws_factory(), *access, *metrics, options);
}

App::App(std::unique_ptr<State> state) : state_(std::move(state)) {}
App::~App() { stop(); }
const api::Router& App::router() const { return state_->application->router(); }
const std::vector<std::string>& App::urls() const { return state_->urls; }

Result<std::unique_ptr<App>> App::start(const Config& config, std::function<std::string()> doctor,
                                        const Waiting& waiting) {
  BOOST_OUTCOME_TRYV(check_startup(config));  // before anything is made
  BOOST_OUTCOME_TRY(auto listeners, listeners_of(config));
  auto state = std::make_unique<State>();
  auto& s = *state;
  s.config = config;
  s.listeners = std::move(listeners);
  if (!config.text("tls.certificate").empty()) {
    BOOST_OUTCOME_TRY(s.tls, TlsKeeper::open({config.text("tls.certificate"), config.text("tls.key")}));
  }
  s.doctor = std::move(doctor);
  s.data_dir = config.text("data_dir");
  BOOST_OUTCOME_TRY(s.proxies, TrustedProxies::parse(config.list("trusted_proxies")));
  BOOST_OUTCOME_TRYV(s.open_rows(waiting));
  s.metrics = std::make_unique<Metrics>(ANCHORD_VERSION);
  api::AccessOptions access_options;
  access_options.auth_off = config.text("auth") == "off";
  s.access = std::make_unique<api::AccessService>(s.database->stores(), s.clock, access_options);
  BOOST_OUTCOME_TRYV(s.access->load());
  BOOST_OUTCOME_TRYV(s.first_token());
  BOOST_OUTCOME_TRY(s.model_key, read_or_make_model_key(s.data_dir));
  BOOST_OUTCOME_TRYV(s.open_devices());
  BOOST_OUTCOME_TRYV(s.open_drone());
  BOOST_OUTCOME_TRYV(s.open_broker());
  s.compose();
  s.open_door();
  auto app = std::unique_ptr<App>(new App(std::move(state)));
  BOOST_OUTCOME_TRYV(app->state_->listen());
  return app;
}

void App::reload() {
  auto& s = *state_;
  if (!s.tls) {
    log(LogLevel::info, "nothing to reload", {{"why", "tls.certificate is not set"}});
    return;
  }
  const auto reloaded = s.tls->reload(s.clock.now());
  if (!reloaded) {
    log(LogLevel::error, "the new certificate was rejected, the previous one is still served",
        {{"why", reloaded.error().message}});
    return;
  }
  const auto facts = s.tls->facts();
  log(LogLevel::info, "reloaded the certificate",
      {{"until", to_rfc3339(facts.not_after)}, {"sha256", facts.sha256}});
}

bool App::taken_over() const { return state_->commanding.copy().taken_over; }

void App::stop() {
  auto& s = *state_;
  if (s.stopped) return;
  s.stopped = true;
  auto last = std::chrono::steady_clock::now();
  const auto step = [&last](std::string_view name) {
    const auto now = std::chrono::steady_clock::now();
    log(LogLevel::info, "stop step",
        {{"step", name},
         {"ms", std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(now - last).count())}});
    last = now;
  };
  if (s.door) s.door->close();
  if (s.application) s.application->hub().shut_down();  // WebSockets: bye and 4010
  if (s.http) s.http->stop(std::chrono::seconds(4));
  step("connections");
  if (s.devices) s.devices->stop();  // what waits goes to the database while it is open
  step("devices");
  if (s.application) s.application->stop();  // first, so that nobody waits in a handler for a job
  step("application");
  for (auto* workers :
       {s.command_pool.get(), s.flight_pool.get(), s.pool.get(), s.heavy_pool.get(), s.stream_pool.get(),
        s.live_pool.get(), s.joint_pool.get(), s.plan_pool.get(), s.job_pool.get()}) {
    if (workers != nullptr) workers->stop();
  }
  step("workers");
  s.http.reset();
  s.door.reset();
  {
    auto c = s.commanding.lock();
    c->application = nullptr;
  }
  s.application.reset();
  s.devices.reset();
  s.drone.reset();
  s.access.reset();
  s.database.reset();  // finishes queued writes, checkpoints, closes
  step("database");
  std::error_code ignored;
  if (!s.urls.empty()) fs::remove(s.data_dir / k_address_file, ignored);
}

}  // namespace anchord::server
