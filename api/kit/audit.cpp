#include "api/kit/audit.hpp"

#include "api/kit/problem.hpp"
#include "core/base/time.hpp"
#include "core/ports/access_store.hpp"

namespace anchord::api {

void Audit::operator()(const Request& request, std::string what, std::string result) const {
  // Kept even when the store is in trouble is impossible; an answer that could not be audited is a 5xx.
  value_or_problem(store_.append_audit(
      {clock_.now(), request.principal.token_id, std::move(what), request.remote, std::move(result)}));
}

void Audit::soon(const Request& request, std::string what, std::string result) const {
  value_or_problem(prompt_.append_audit(
      {clock_.now(), request.principal.token_id, std::move(what), request.remote, std::move(result)}));
}

}  // namespace anchord::api
