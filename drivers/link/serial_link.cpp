#include <boost/asio/posix/stream_descriptor.hpp>

#include "drivers/link/serial_port.hpp"
#include "drivers/link/stream_link.hpp"

namespace anchord::link {
namespace {

using Descriptor = asio::posix::stream_descriptor;

class SerialLink final : public ByteLink {
 public:
  SerialLink(asio::io_context& io, Address address, const LinkOptions& options)
      : io_(io), address_(std::move(address)), shared_(std::make_shared<Shared>()) {
    shared_->options = options;
  }
  ~SerialLink() override { SerialLink::close(); }

  void open(LinkHandlers handlers) override {
    shared_->handlers = std::move(handlers);
    // open(2) of a tty with O_NONBLOCK returns at once; only the report waits for the loop.
    auto fd = open_serial(address_.path, address_.baud);
    if (!fd) {
      asio::post(io_, [shared = shared_, why = fd.error()] { shared->lost(why); });
      return;
    }
    pump_ = std::make_shared<Pump<Descriptor>>(
        Descriptor(io_, fd.value()), shared_,
        [shared = shared_, address = address_](const ErrorCode& error, bool late) {
          shared->lost(ended(address, error, late));
        });
    asio::post(io_, [shared = shared_, pump = pump_] {
      if (shared->closed) return;
      shared->opened();
      if (!shared->closed) pump->start();
    });
  }

  Result<void> write(std::string_view bytes) override {
    if (!shared_->open || !pump_) return make_error(Errc::link_lost, "the port is not open");
    return pump_->write(bytes);
  }

  void close() override {
    shared_->closed = true;
    shared_->open = false;
    if (const auto pump = std::exchange(pump_, nullptr)) pump->stop();
  }
  bool is_open() const override { return shared_->open; }
  LinkCounters counters() const override { return shared_->counters; }
  std::uint16_t port() const override { return 0; }

 private:
  asio::io_context& io_;
  Address address_;
  std::shared_ptr<Shared> shared_;
  std::shared_ptr<Pump<Descriptor>> pump_;
};

}  // namespace

std::unique_ptr<ByteLink> make_serial_link(asio::io_context& io, const Address& address,
                                           const LinkOptions& options) {
  return std::make_unique<SerialLink>(io, address, options);
}

}  // namespace anchord::link
