#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/config/config.hpp"

namespace anchord::api {
class Router;
}

namespace anchord::server {

/// The composition root: builds everything in the order it depends on each other, stops it in the reverse
/// order.
class App {
 public:
  /// Checks the addresses, opens and migrates the database, makes the first admin token, listens. Messages of
  /// errors are for the operator's terminal. Errors: invalid_argument (settings), conflict (address or folder
  /// in use), those of the database.
  /// `doctor`: what a look at folder, disk, database and clock finds, for a support bundle; empty: nobody
  /// looks.
  /// `waiting`: how a server that stands by waits; canceled where it was told to stop.
  struct Waiting {
    std::function<bool()> stopping;
    std::function<void()> ready;  ///< it stands by
  };
  static Result<std::unique_ptr<App>> start(const Config& config, std::function<std::string()> doctor = {},
                                            const Waiting& waiting = {});
  ~App();
  App(const App&) = delete;
  App& operator=(const App&) = delete;

  /// Every route with its access decision.
  const api::Router& router() const;
  /// Where it listens, "http://127.0.0.1:8420" or "https://...".
  const std::vector<std::string>& urls() const;
  /// Reads the certificate again; what cannot be served is logged and an alarm, and the former stays.
  void reload();
  /// Refuses new work, says goodbye to WebSockets, finishes what runs, flushes and closes the database. Logs
  /// how long each step took. Idempotent; within 10 s.
  void stop();
  /// Another server has taken over: what flew was told to hold, and the process was asked to end (SIGTERM).
  bool taken_over() const;

 private:
  struct State;
  explicit App(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Files of the data folder that other commands look for.
inline constexpr std::string_view k_admin_token_file = "admin.token";
inline constexpr std::string_view k_address_file = "address";

}  // namespace anchord::server
