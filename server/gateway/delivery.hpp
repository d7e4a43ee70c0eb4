#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "server/gateway/answer.hpp"
#include "server/gateway/outbox.hpp"
#include "server/gateway/rejected_file.hpp"
#include "server/http/http_client.hpp"

namespace anchord::gateway {

/// Brings batches to the server and takes out of the outbox what it has answered for. A row leaves the outbox
/// after the server said what became of it, never before: a repeated one counts there as a duplicate. One
/// thread.
class Delivery {
 public:
  /// POST of a body; errors: link_lost.
  using Post = std::function<Result<server::ClientResponse>(const std::string& target, std::string_view type,
                                                            const std::string& body)>;
  Delivery(Outbox& outbox, RejectedFile& rejected, const Clock& clock, Post post)
      : outbox_(outbox), rejected_(rejected), clock_(clock), post_(std::move(post)) {}

  /// Of one mission and one way of writing. settled: they have left the outbox.
  Assessment send(std::span<const Batch> batches);

 private:
  struct Tally;
  Assessment send_rows(const Batch& of, std::span<const std::string_view> rows, Tally& tally);

  Outbox& outbox_;
  RejectedFile& rejected_;
  const Clock& clock_;
  Post post_;
};

/// Batches of one mission and one way of writing stand together, fixes before ranges, else in their order.
std::vector<std::vector<Batch>> grouped(std::vector<Batch> batches);

}  // namespace anchord::gateway
