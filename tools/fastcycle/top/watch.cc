#include "top/watch.h"

#include <algorithm>
#include <utility>

#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

namespace fastcycle::tool::top {
namespace {

using inspect::protocol::Error;

constexpr const char* kChains = "chains";

/// None if the answer does not come: the application may hang, or be stopped by a debugger.
std::optional<Snapshot> try_snapshot_of(inspect::Client& client) {
  try {
    return snapshot_of(client);
  } catch (const inspect::ClientError& error) {
    if (error.kind() == Error::KIND_LATE) {
      return std::nullopt;
    }
    throw;
  }
}

}  // namespace

Snapshot snapshot_of(inspect::Client& client) {
  Snapshot snapshot;
  inspect::protocol::Request request;
  request.mutable_overview();
  snapshot.overview = std::move(*client.ask(std::move(request)).mutable_overview());
  const auto& documents = snapshot.overview.documents();
  if (std::find(documents.begin(), documents.end(), kChains) != documents.end()) {
    inspect::protocol::Request chains;
    chains.mutable_document()->set_name(kChains);
    snapshot.chains = std::move(*client.ask(std::move(chains)).mutable_document()->mutable_json());
  }
  return snapshot;
}

Watch::Watch(std::unique_ptr<inspect::Client> client, std::chrono::milliseconds interval)
    : client_(std::move(client)),
      interval_(interval),
      news_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      thread_([this] { run(); }) {}

Watch::~Watch() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
    changed_.notify_all();
  }
  shutdown(client_->descriptor(), SHUT_RDWR);  // Ends a pending wait for an answer.
  thread_.join();
  close(news_);
}

Watch::News Watch::take() {
  std::uint64_t count = 0;
  const ssize_t size = ::read(news_, &count, sizeof(count));
  static_cast<void>(size);  // Nothing is there if nothing is new.
  const std::lock_guard lock(mutex_);
  return std::exchange(untaken_, {});
}

Watch::Clock::time_point Watch::last_update() const {
  const std::lock_guard lock(mutex_);
  return last_update_;
}

void Watch::post(News news) {
  {
    const std::lock_guard lock(mutex_);
    if (news.snapshot) {
      untaken_.snapshot = std::move(news.snapshot);
      last_update_ = Clock::now();
    }
    if (news.end) {
      untaken_.end = std::move(news.end);
    }
  }
  const std::uint64_t one = 1;
  const ssize_t size = ::write(news_, &one, sizeof(one));
  static_cast<void>(size);  // It is readable already if it does not fit.
}

void Watch::run() {
  try {
    std::unique_lock lock(mutex_);
    while (!is_over_) {
      const Clock::time_point next = Clock::now() + interval_;
      lock.unlock();
      if (auto snapshot = try_snapshot_of(*client_)) {
        post({std::move(snapshot), {}});
      }
      lock.lock();
      changed_.wait_until(lock, next, [this] { return is_over_; });
    }
  } catch (const inspect::ClientError& error) {
    post({{}, error.kind() == Error::KIND_UNKNOWN ? "" : error.what()});
  } catch (const std::exception& error) {
    post({{}, error.what()});
  }
}

}  // namespace fastcycle::tool::top
