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

ConnectionBook::Entry ConnectionBook::admit(State& state, const std::string& address, bool many) const {
  Entry entry;
  auto& own = state.addresses[address];
  if (!many && own.sockets >= per_address_) {
    entry.evict = oldest_of(state, address);
    if (!entry.evict) {
      entry.why = "all " + std::to_string(per_address_) + " connections of one address are in use";
      return entry;
    }
  } else if (state.sockets >= all_) {
    // Of the address that has most, so that one who takes all cannot push out those who take one.
    const std::string* most = nullptr;
    std::size_t sockets = 0;
    for (const auto& [name, at] : state.addresses) {
      if (at.idle > 0 && at.sockets > sockets) {
        most = &name;
        sockets = at.sockets;
      }
    }
    if (most != nullptr) entry.evict = oldest_of(state, std::string(*most));
    if (!entry.evict) {
      if (own.sockets == 0) state.addresses.erase(address);
      entry.why = "all " + std::to_string(all_) + " connections are in use";
      return entry;
    }
  }
  ++own.sockets;
  ++state.sockets;
  return entry;
}

ConnectionBook::Entry ConnectionBook::enter(const std::string& address, bool many) {
  Entry entry;
  {
    auto state = state_->lock();
    entry = admit(*state, address, many);
  }
  if (!entry.why.empty()) return entry;
  // Not null, whatever it points to: null says that there is no place. Not under the lock: without memory for
  // it the place is given back at once.
  entry.place = std::shared_ptr<void>(state_.get(), [all = state_, address](void*) {
    auto state = all->lock();
    --state->sockets;
    const auto at = state->addresses.find(address);
    if (--at->second.sockets == 0 && at->second.idle == 0) state->addresses.erase(at);
  });
  return entry;
}

void ConnectionBook::idle(const std::string& address, const Connection* key,
                          std::weak_ptr<Connection> connection) {
  auto state = state_->lock();
  const auto at = state->idle.insert(state->idle.end(), {key, address, std::move(connection)});
  if (!state->index.emplace(key, at).second) {
    state->idle.erase(at);
    return;
  }
  ++state->addresses[address].idle;
}

void ConnectionBook::busy(const Connection* key) {
  auto state = state_->lock();
  const auto at = state->index.find(key);
  if (at == state->index.end()) return;
  const std::string address = at->second->address;
  forget(*state, at->second);
  const auto known = state->addresses.find(address);
  if (known->second.sockets == 0 && known->second.idle == 0) state->addresses.erase(known);
}

std::size_t ConnectionBook::size() const {
  const auto state = state_->lock();
  return state->sockets;
}

}  // namespace anchord::server
