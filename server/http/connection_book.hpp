#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>

#include "core/base/locked.hpp"

namespace anchord::server {

class Connection;

/// Every socket by its address, and those that wait for a request, oldest first: who comes when all places
/// are taken gets the place of one that asks for nothing. Thread-safe.
class ConnectionBook {
 public:
  ConnectionBook(std::size_t all, std::size_t per_address) : all_(all), per_address_(per_address) {}

  struct Entry {
    std::shared_ptr<void> place;        ///< null: there is none, and `why` says so
    std::shared_ptr<Connection> evict;  ///< null: nobody has to go
    std::string why;
  };
  /// `many`: a proxy, behind which many ask; the limit of one address does not hold for it.
  Entry enter(const std::string& address, bool many);
  /// It waits for a request head.
  void idle(const std::string& address, const Connection* key, std::weak_ptr<Connection> connection);
  /// It does not any more, or has ended.
  void busy(const Connection* key);
  std::size_t size() const;

 private:
  struct Waiting {
    const Connection* key;
    std::string address;
    std::weak_ptr<Connection> connection;
  };
  struct Address {
    std::size_t sockets{0}, idle{0};
  };
  struct State {
    std::size_t sockets{0};
    std::map<std::string, Address> addresses;
    std::list<Waiting> idle;  ///< oldest first
    std::unordered_map<const Connection*, std::list<Waiting>::iterator> index;
  };
  /// Whom to evict, or why there is no place; a place is counted.
  Entry admit(State& state, const std::string& address, bool many) const;
  static void forget(State& state, std::list<Waiting>::iterator at);
  static std::shared_ptr<Connection> oldest_of(State& state, const std::string& address);

  const std::size_t all_, per_address_;
  const std::shared_ptr<Locked<State>> state_ = std::make_shared<Locked<State>>();
};

}  // namespace anchord::server
