#include "server/http/connection_book.hpp"

#include "server/http/session_context.hpp"

namespace anchord::server {

void ConnectionBook::forget(State& state, std::list<Waiting>::iterator at) {
  --state.addresses[at->address].idle;
  state.index.erase(at->key);
  state.idle.erase(at);
}

/// Taken off the list, so that the next one who comes does not choose it again.
std::shared_ptr<Connection> ConnectionBook::oldest_of(State& state, const std::string& address) {
  for (auto at = state.idle.begin(); at != state.idle.end();) {
    if (at->address != address) {
      ++at;
      continue;
    }
    auto connection = at->connection.lock();
    const auto gone = at++;
    forget(state, gone);
    if (connection) return connection;
  }
  return nullptr;
}

ConnectionBook::Entry ConnectionBook::enter(const std::string& address, bool many) {
  Entry entry;
  const std::lock_guard lock(state_->mutex);
  auto& own = state_->addresses[address];
  if (!many && own.sockets >= per_address_) {
    entry.evict = oldest_of(*state_, address);
    if (!entry.evict) {
      entry.why = "all " + std::to_string(per_address_) + " connections of one address are at work";
      return entry;
    }
  } else if (state_->sockets >= all_) {
    // Of the address that has most, so that one who takes all cannot push out those who take one.
    const std::string* most = nullptr;
    std::size_t sockets = 0;
    for (const auto& [name, at] : state_->addresses) {
      if (at.idle > 0 && at.sockets > sockets) {
        most = &name;
        sockets = at.sockets;
      }
    }
    if (most != nullptr) entry.evict = oldest_of(*state_, std::string(*most));
    if (!entry.evict) {
      if (own.sockets == 0) state_->addresses.erase(address);
      entry.why = "all " + std::to_string(all_) + " connections are at work";
      return entry;
    }
  }
  ++own.sockets;
  ++state_->sockets;
  // Not null, whatever it points to: null says that there is no place.
  entry.place = std::shared_ptr<void>(state_.get(), [state = state_, address](void*) {
    const std::lock_guard back(state->mutex);
    --state->sockets;
    const auto at = state->addresses.find(address);
    if (--at->second.sockets == 0 && at->second.idle == 0) state->addresses.erase(at);
  });
  return entry;
}

void ConnectionBook::idle(const std::string& address, const Connection* key,
                          std::weak_ptr<Connection> connection) {
  const std::lock_guard lock(state_->mutex);
  const auto at = state_->idle.insert(state_->idle.end(), {key, address, std::move(connection)});
  if (!state_->index.emplace(key, at).second) {
    state_->idle.erase(at);
    return;
  }
  ++state_->addresses[address].idle;
}

void ConnectionBook::busy(const Connection* key) {
  const std::lock_guard lock(state_->mutex);
  const auto at = state_->index.find(key);
  if (at == state_->index.end()) return;
  const std::string address = at->second->address;
  forget(*state_, at->second);
  const auto known = state_->addresses.find(address);
  if (known->second.sockets == 0 && known->second.idle == 0) state_->addresses.erase(known);
}

std::size_t ConnectionBook::size() const {
  const std::lock_guard lock(state_->mutex);
  return state_->sockets;
}

}  // namespace anchord::server
