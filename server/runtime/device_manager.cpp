#include "server/runtime/device_manager.hpp"

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <future>
#include <mutex>
#include <random>
#include <thread>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/retry.hpp"
#include "core/base/steady.hpp"
#include "core/base/text.hpp"
#include "drivers/device/device_loop.hpp"
#include "drivers/device/discover.hpp"
#include "drivers/link/address.hpp"
#include "drivers/record/recorder.hpp"
#include "server/runtime/device_alarms.hpp"
#include "server/runtime/device_file.hpp"
#include "server/runtime/device_metrics.hpp"
#include "server/runtime/device_news.hpp"
#include "server/runtime/device_secrets.hpp"
#include "server/runtime/row_queue.hpp"

namespace anchord::server {
namespace {

constexpr auto k_answer_time =
    std::chrono::seconds(25);  ///< settings of six anchors by radio take half of it

/// Rows wait so long for others to go with: an estimate for each single one would cost more than it tells.
constexpr std::chrono::milliseconds k_live_batch{20}, k_store_batch{100};
constexpr std::size_t k_live_rows = 200;

DeviceReport report_of(const DeviceConfig& config, const device::DeviceState& s) {
  DeviceReport out;
  out.config = config;
  out.state = std::string(to_string(s.phase));
  out.reason = s.reason;
  out.conflict = s.conflict;
  out.in_state_s = s.in_phase_s;
  out.last_seen = s.last_seen;
  out.model = s.identity.model;
  out.firmware = s.identity.firmware;
  out.serial = s.identity.serial;
  out.network_id = s.identity.network_id;
  out.bytes_in = s.bytes_in;
  out.bytes_out = s.bytes_out;
  out.frames = s.frames;
  out.fixes = s.fixes;
  out.ranges = s.ranges;
  out.opened = s.opened;
  out.lost = s.lost;
  out.rows_per_s = s.rows_per_s;
  out.dropped = s.dropped;
  if (s.rover) {
    out.rover = DeviceReport::Rover{s.rover->time,  s.rover->fix,       s.rover->satellites,
                                    s.rover->age_s, s.rover->sigma_h_m, s.rover->sigma_v_m};
  }
  if (s.clock)
    out.clock = DeviceReport::Clock{s.clock->drift_ppm, s.clock->sigma_s, s.clock->settled, s.clock->skewed};
  out.base = s.base;
  return out;
}

}  // namespace

Result<DeviceConfig> parse_device_setting(const std::string& text) {
  const auto equals = text.find('=');
  if (!is_utf8(text))
    return make_error(Errc::invalid_argument, "devices: \"" + to_utf8(text) + "\" is not UTF-8");
  if (equals == std::string::npos)
    return make_error(Errc::invalid_argument, "devices: \"" + text + "\" is not kind=address");
  DeviceConfig config;
  config.kind = text.substr(0, equals);
  config.address = text.substr(equals + 1);
  config.name = config.kind;
  if (const auto address = link::parse_address(config.address); !address)
    return make_error(address.error().code, "devices: " + address.error().message);
  return config;
}

class DeviceManager::Impl final : public device::DeviceListener {
 public:
  explicit Impl(DeviceManagerOptions options)
      : options_(std::move(options)),
        secrets_(options_.data_dir),
        work_(io_.get_executor()),
        unstored_(options_.max_waiting_rows, k_store_batch) {
    device::LoopOptions loop;
    loop.seed = std::random_device{}();
    loop_ = std::make_unique<device::DeviceLoop>(io_, nullptr, *this, loop);
    io_thread_ = Thread("anchord-devices", [this] { run_guarded("devices", io_); });
  }
  ~Impl() override { stop(); }

  Result<void> load() {
    auto kept = read_devices(file());
    auto& devices = kept.devices;
    for (const auto& text : options_.from_config) {
      BOOST_OUTCOME_TRY(auto config, parse_device_setting(text));
      const bool known = std::any_of(devices.begin(), devices.end(),
                                     [&](const auto& d) { return d.config.address == config.address; });
      if (known) continue;
      config.id = make_uuid_v7(SystemClock{}.now());
      devices.push_back({std::move(config), {}, {}});
    }
    for (auto& device : devices) {
      if (!DeviceSecrets::drop_password_file(device.config) || !device.problem.empty()) continue;
      device.problem =
          "password_file is no longer used, because it could be set over REST; send the password itself "
          "(options.password, or anchord devices settings DEVICE password_file=FILE)";
    }
    auto now = kept_.lock();
    now->spoilt = !kept.problem.empty() || std::any_of(devices.begin(), devices.end(),
                                                       [](const auto& d) { return !d.problem.empty(); });
    now->file_problem = std::move(kept.problem);
    now->devices = std::move(devices);
    return boost::outcome_v2::success();
  }

  void start(DeviceRows& rows) {
    rows_ = &rows;
    writer_ = Thread("anchord-store", [this] { write_rows(); });
    auto devices = kept_devices();
    // A device that cannot be started is one device less, never a server less.
    for (auto& device : devices) {
      if (device.problem.empty() && device.config.enabled) {
        if (const auto begun = on_io([&] { return begin(device.config); }); !begun)
          device.problem = begun.error().message;
      }
      if (!device.problem.empty()) set_problem(device.config.id, device.problem);
    }
    if (const auto trouble = not_started(); !trouble.empty()) note(trouble);
  }

  void set_problem(const Uuid& id, const std::string& problem) {
    auto kept = kept_.lock();
    for (auto& device : kept->devices) {
      if (device.config.id == id) device.problem = problem;
    }
  }
  std::vector<KeptDevice> kept_devices() {
    const auto kept = kept_.lock();
    return kept->devices;
  }

  /// What is kept and does not run, with what to do; empty: nothing.
  std::string not_started() {
    const auto kept = kept_.lock();
    if (!kept->file_problem.empty()) {
      return "the stored devices cannot be read: " + kept->file_problem +
             "; repair the file and restart the server, or set up the devices again (a copy of the file is "
             "then kept)";
    }
    std::string out;
    for (const auto& [config, problem, entry] : kept->devices) {
      if (problem.empty()) continue;
      out += (out.empty() ? "not started: device \"" : "; device \"") + config.name + "\" (" + problem + ')';
    }
    return out.empty() ? out : out + "; correct their settings or remove them";
  }

  /// The file as the devices are now; what could not be read in the old one is kept beside it. What is
  /// written last is the newest, whoever changed what.
  Result<void> save() {
    const std::scoped_lock one_at_a_time(saving_);
    std::vector<KeptDevice> all;
    bool spoilt = false;
    {
      const auto kept = kept_.lock();
      all = kept->devices;
      spoilt = kept->spoilt;
    }
    if (spoilt) {
      BOOST_OUTCOME_TRYV(keep_unreadable(file()));
    }
    BOOST_OUTCOME_TRYV(write_devices(file(), all));
    auto kept = kept_.lock();
    kept->spoilt = false;
    kept->file_problem.clear();
    return boost::outcome_v2::success();
  }

  void stop() {
    {
      // Held until the thread is gone: whoever asks meanwhile waits, and then finds no loop.
      auto stopped = stopped_.lock();
      if (std::exchange(*stopped, true)) return;
      // The last task: what was posted before it runs before it, and nothing comes after.
      boost::asio::post(io_, [this] {
        loop_.reset();
        recorder_.reset();
        hand_on_rows();
        io_.stop();
      });
      io_thread_.join();
    }
    unstored_.stop();
    if (writer_.joinable()) writer_.join();
    for (auto& [id, promise] : answers_.exchange({}).waiting)
      promise.set_value(make_error(Errc::canceled, "the server is stopping"));
  }

  /// Runs a function on the io thread and gives back what it says.
  template <class F>
  auto on_io(F function) -> decltype(function()) {
    std::packaged_task<decltype(function())()> task(std::move(function));
    auto result = task.get_future();
    bool alone = false;
    {
      const auto stopped = stopped_.lock();
      alone = *stopped;
      if (!alone) boost::asio::post(io_, [&task] { task(); });
    }
    if (alone) task();  // the io thread is gone, and with it the loop
    return result.get();
  }

  // --- io thread -------------------------------------------------------------------------------------------
  void fix(const std::string&, const Fix& row) override { arrived(arrived_.fixes, row); }
  void range(const std::string&, const Range& row) override { arrived(arrived_.ranges, row); }
  void changed(const std::string& id) override {
    const auto state = loop_ ? loop_->device(id) : std::nullopt;
    if (!state) {
      told_.erase(id);
      return;
    }
    const auto text = "device \"" + state->settings.name + "\" is " + std::string(to_string(state->phase)) +
                      (state->reason.empty() ? "" : ": " + state->reason);
    // It also comes when the device says who it is: the same news twice is none.
    const bool works = state->phase == device::Phase::talking;
    if (const auto line = told_[id].line(text, works, system_steady_clock().now())) note(*line);
  }
  void answer(const std::string&, std::uint64_t command, const Result<std::string>& json) override {
    auto answers = answers_.lock();
    const auto found = answers->waiting.find(command);
    if (found == answers->waiting.end()) return;  // nobody waits any more
    found->second.set_value(json);
    answers->waiting.erase(found);
  }

  device::Settings settings_of(const DeviceConfig& config) {
    return {to_string(config.id), config.kind, config.name, config.address, secrets_.driver_options(config)};
  }

  /// What is switched off is started one day, without whoever set it up: it is refused now or never.
  Result<void> check(const DeviceConfig& config) {
    Result<void> sound = boost::outcome_v2::success();
    const auto ran = guarded("check of device \"" + config.name + '"',
                             [&] { sound = device::check_settings(settings_of(config)); });
    return ran ? sound : make_error(Errc::invalid_argument, "its settings cannot be used: " + ran.what);
  }

  Result<void> begin(const DeviceConfig& config) {
    if (!loop_) return make_error(Errc::canceled, "the server is stopping");
    Result<void> begun = boost::outcome_v2::success();
    const auto ran = guarded("start of device \"" + config.name + '"', [&] {
      if (!recorder_) open_recorder();
      begun = loop_->add(settings_of(config));
    });
    return ran ? begun : make_error(Errc::internal, "its settings cannot be used: " + ran.what);
  }

  /// Made with the first device: a server without devices leaves no empty recordings.
  void open_recorder() {
    record::RecorderOptions recording;
    recording.removed = [this](const std::filesystem::path& part) {
      note("the disk is nearly full: removed the oldest raw recording without a flight, " + part.string());
    };
    auto made = record::Recorder::open(recordings(), SystemClock{}.now(), recording);
    if (made) {
      recorder_ = std::move(made).value();
      loop_->record_to(recorder_.get());
    } else {
      {
        auto kept = kept_.lock();
        kept->recorder_failure = made.error().message;
      }
      note("raw bytes are not recorded: " + made.error().message);
    }
  }

  template <class Row>
  void arrived(std::vector<Row>& rows, const Row& row) {
    rows.push_back(row);
    if (arrived_.size() >= k_live_rows) return hand_on_rows();
    if (arrived_.size() > 1) return;  // the timer runs
    hand_on_.expires_after(k_live_batch);
    hand_on_.async_wait([this](boost::system::error_code error) {
      if (!error) hand_on_rows();
    });
  }
  /// To the live flights, which only queue them, and to whoever stores them.
  void hand_on_rows() {
    if (arrived_.empty()) return;
    (void)guarded("live rows of devices", [&] { rows_->live(arrived_); });
    unstored_.push(std::exchange(arrived_, {}));
  }

  // --- writer thread ---------------------------------------------------------------------------------------
  void write_rows() {
    DeviceBatch batch;
    while (unstored_.take(batch)) {
      if (batch.empty()) continue;
      for (int attempt = 1;; ++attempt) {
        Result<void> done = make_error(Errc::internal, "the rows could not be accepted");
        (void)guarded("rows of devices", [&] { done = rows_->store(batch); });
        if (done) break;
        if (attempt == 1) note("rows of devices are not stored: " + done.error().message);
        // A full disk may be helped, and a locked database comes back; meanwhile the queue holds what comes.
        if (unstored_.stopping() || (attempt >= 30 && !may_pass(done.error().code))) {
          unstored_.lost(batch.size());
          break;
        }
        std::this_thread::sleep_for(std::chrono::seconds(1));
      }
    }
  }

  void note(const std::string& text) const {
    if (options_.log) options_.log(text);
  }
  std::filesystem::path recordings() const { return options_.data_dir / "recordings"; }
  std::vector<device::DeviceState> states() {
    return on_io([&] { return loop_ ? loop_->devices() : std::vector<device::DeviceState>{}; });
  }
  std::filesystem::path file() const { return options_.data_dir / "devices.json"; }

  DeviceManagerOptions options_;
  const DeviceSecrets secrets_;
  boost::asio::io_context io_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  std::unique_ptr<record::Recorder> recorder_;
  std::unique_ptr<device::DeviceLoop> loop_;
  std::map<std::string, DeviceNews> told_;  ///< in the log, by device
  DeviceBatch arrived_;                     ///< of the io thread
  boost::asio::steady_timer hand_on_{io_};
  Thread io_thread_, writer_;
  RowQueue unstored_;
  DeviceRows* rows_{nullptr};

  struct Kept {
    std::vector<KeptDevice> devices{};
    std::vector<DiscoveredDevice> discovered{};
    std::string file_problem{};
    bool spoilt{false};  ///< the file holds what could not be read: it is copied before it is replaced
    std::optional<MissionId> mission{};
    std::string recorder_failure{};
  };
  std::mutex saving_;  ///< one write of the file at a time
  Locked<Kept> kept_;

  struct Answers {
    std::map<std::uint64_t, std::promise<Result<std::string>>> waiting{};
    std::uint64_t next_command{1};
  };
  Locked<Answers> answers_;
  Locked<bool> stopped_{false};
};

DeviceManager::DeviceManager(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DeviceManager::~DeviceManager() = default;

Result<std::unique_ptr<DeviceManager>> DeviceManager::open(DeviceManagerOptions options) {
  auto impl = std::make_unique<Impl>(std::move(options));
  BOOST_OUTCOME_TRYV(impl->load());
  return std::unique_ptr<DeviceManager>(new DeviceManager(std::move(impl)));
}

void DeviceManager::start(DeviceRows& rows) { impl_->start(rows); }
void DeviceManager::stop() { impl_->stop(); }

std::vector<DeviceReport> DeviceManager::devices() {
  const auto kept = impl_->kept_devices();
  if (kept.empty()) return {};
  const auto states = impl_->states();
  std::vector<DeviceReport> out;
  for (const auto& [config, problem, entry] : kept) {
    const auto id = to_string(config.id);
    const auto state =
        std::find_if(states.begin(), states.end(), [&](const auto& s) { return s.settings.id == id; });
    if (state != states.end()) {
      out.push_back(report_of(config, *state));
    } else {
      DeviceReport off;
      off.config = config;
      off.reason = problem.empty() ? config.enabled ? "not started yet" : "switched off"
                                   : "not started: " + problem + "; correct its settings or remove it";
      out.push_back(std::move(off));
    }
  }
  return out;
}

Result<DeviceReport> DeviceManager::device(const Uuid& id) {
  for (auto& report : devices()) {
    if (report.config.id == id) return std::move(report);
  }
  return make_error(Errc::not_found, "there is no device " + to_string(id));
}

Result<DeviceReport> DeviceManager::add(DeviceConfig config) {
  config.id = make_uuid_v7(SystemClock{}.now());
  config.version = 1;
  BOOST_OUTCOME_TRY(const auto secret, DeviceSecrets::split(std::move(config), nullptr));
  config = secret.config;
  BOOST_OUTCOME_TRYV(impl_->secrets_.store(secret));
  if (const auto sound = impl_->check(config); !sound) {
    impl_->secrets_.forget(config.id);
    return sound.error();
  }
  {
    auto kept = impl_->kept_.lock();
    kept->devices.push_back({config, {}, {}});
  }
  // Kept first: what runs is there after a restart too.
  auto done = impl_->save();
  if (done && config.enabled) done = impl_->on_io([&] { return impl_->begin(config); });
  if (done) return device(config.id);
  {
    auto kept = impl_->kept_.lock();
    std::erase_if(kept->devices, [&](const auto& d) { return d.config.id == config.id; });
  }
  impl_->secrets_.forget(config.id);
  (void)impl_->save().has_value();  // what went wrong is told already
  return done.error();
}

Result<DeviceReport> DeviceManager::change(DeviceConfig config, std::uint64_t expected_version) {
  KeptDevice kept;
  DeviceSecrets::Change secret;
  const auto of_id = [id = config.id](const auto& c) { return c.config.id == id; };
  {
    auto all = impl_->kept_.lock();
    const auto found = std::find_if(all->devices.begin(), all->devices.end(), of_id);
    if (found == all->devices.end())
      return make_error(Errc::not_found, "there is no device " + to_string(config.id));
    if (found->config.version != expected_version)
      return make_error(Errc::conflict, "the device was changed in the meantime");
    kept = *found;
    BOOST_OUTCOME_TRY(secret, DeviceSecrets::split(std::move(config), &kept.config));
    config = secret.config;
    config.version = expected_version + 1;
    *found = {config, {}, {}};
  }
  const auto& before = kept.config;
  const auto password = impl_->secrets_.kept(before.id);
  const auto stored = impl_->secrets_.store(secret);
  const bool same_settings = !secret.given && before.kind == config.kind &&
                             before.address == config.address && before.options == config.options,
             same_link = same_settings && kept.problem.empty() && before.name == config.name &&
                         before.enabled == config.enabled;
  if (!same_link) {
    const auto changed = impl_->on_io([&]() -> Result<void> {
      if (!stored) return stored.error();
      // What is wrong since long may still be switched off.
      if (config.enabled || !same_settings) {
        BOOST_OUTCOME_TRYV(impl_->check(config));
      }
      if (!impl_->loop_) return make_error(Errc::canceled, "the server is stopping");
      (void)impl_->loop_->remove(to_string(config.id));
      if (!config.enabled) return boost::outcome_v2::success();
      auto begun = impl_->begin(config);
      if (begun || !before.enabled || !kept.problem.empty()) return begun;
      if (secret.given) impl_->secrets_.put_back(before.id, password);
      (void)impl_->begin(before).has_value();
      return begun;
    });
    if (!changed) {
      if (secret.given) impl_->secrets_.put_back(before.id, password);
      auto all = impl_->kept_.lock();
      const auto found = std::find_if(all->devices.begin(), all->devices.end(), of_id);
      if (found != all->devices.end()) *found = kept;
      return changed.error();
    }
  }
  BOOST_OUTCOME_TRYV(impl_->save());
  return device(config.id);
}

Result<void> DeviceManager::remove(const Uuid& id, std::uint64_t expected_version) {
  {
    auto kept = impl_->kept_.lock();
    const auto found = std::find_if(kept->devices.begin(), kept->devices.end(),
                                    [&](const auto& c) { return c.config.id == id; });
    if (found == kept->devices.end())
      return make_error(Errc::not_found, "there is no device " + to_string(id));
    if (found->config.version != expected_version)
      return make_error(Errc::conflict, "the device was changed in the meantime");
    kept->devices.erase(found);
  }
  impl_->on_io([&] {
    if (impl_->loop_) (void)impl_->loop_->remove(to_string(id));
    return 0;
  });
  impl_->secrets_.forget(id);
  return impl_->save();
}

Result<std::string> DeviceManager::act(const Uuid& id, std::string_view action,
                                       std::string_view arguments_json) {
  std::future<Result<std::string>> answer;
  std::uint64_t number = 0;
  {
    auto answers = impl_->answers_.lock();
    number = answers->next_command++;
    answer = answers->waiting[number].get_future();
  }
  const auto forget = [&] {
    auto answers = impl_->answers_.lock();
    answers->waiting.erase(number);
  };
  const auto begun = impl_->on_io([&]() -> Result<void> {
    if (!impl_->loop_) return make_error(Errc::canceled, "the server is stopping");
    return impl_->loop_->command(to_string(id), {number, std::string(action), std::string(arguments_json)});
  });
  if (!begun) {
    forget();
    return begun.error();
  }
  if (answer.wait_for(k_answer_time) != std::future_status::ready) {
    forget();
    return make_error(Errc::link_lost, "the device did not answer within 25 s");
  }
  return answer.get();
}

std::vector<DiscoveredDevice> DeviceManager::discover() {
  std::vector<std::string> ours;
  for (const auto& kept : impl_->kept_devices()) ours.push_back(kept.config.address);
  std::vector<DiscoveredDevice> out;
  for (auto& found : device::discover(ours)) {
    out.push_back(
        {std::move(found.address), std::move(found.kind), std::move(found.evidence), found.configured});
  }
  auto kept = impl_->kept_.lock();
  kept->discovered = out;
  return out;
}

std::vector<DiscoveredDevice> DeviceManager::discovered() {
  const auto kept = impl_->kept_.lock();
  return kept->discovered;
}

DeviceClock DeviceManager::clock() {
  const auto state =
      impl_->on_io([&] { return impl_->loop_ ? impl_->loop_->clock() : device::ClockState{}; });
  return {state.from_receiver, state.system_offset_s, state.sigma_s, state.skew};
}

void DeviceManager::record_into(const std::optional<MissionId>& mission) {
  {
    auto kept = impl_->kept_.lock();
    kept->mission = mission;
  }
  impl_->on_io([&] {
    if (impl_->loop_) impl_->loop_->record_into(mission);
    return 0;
  });
}

std::optional<MissionId> DeviceManager::recording_into() {
  const auto kept = impl_->kept_.lock();
  return kept->mission;
}

std::string DeviceManager::recorder_failure() {
  {
    const auto kept = impl_->kept_.lock();
    if (!kept->recorder_failure.empty()) return kept->recorder_failure;
  }
  return impl_->on_io([&] { return impl_->recorder_ ? impl_->recorder_->failed() : std::string(); });
}

std::string DeviceManager::not_started() { return impl_->not_started(); }

std::uint64_t DeviceManager::rows_lost() { return impl_->unstored_.dropped(); }

std::string DeviceManager::unused_sources() { return server::unused_sources(impl_->states()); }
std::string DeviceManager::too_many_ids() { return server::too_many_ids(impl_->states()); }
std::string DeviceManager::moved_bases() { return server::moved_bases(impl_->states()); }
std::string DeviceManager::recordings_on_disk() {
  return server::recordings_on_disk(impl_->recordings(), impl_->states());
}

std::string DeviceManager::metrics() { return device_metrics(devices(), rows_lost()); }

}  // namespace anchord::server
