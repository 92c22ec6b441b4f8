#pragma once

#include <cstddef>
#include <cstdint>

#include "benchmark/payload.pb.h"
#include "fastcycle/publisher.h"
#include "measure/clock.h"
#include "measure/payload.h"

namespace fastcycle::benchmark {

/// The prototype that sizes a publisher's pool.
[[nodiscard]] inline Payload prototype(std::size_t size) {
  Payload payload;
  payload.mutable_data()->assign(size, '\0');
  return payload;
}

/// A payload filled as by a driver that copies a frame, stamped before it is filled.
[[nodiscard]] inline Loan<Payload> make_payload(Publisher<Payload>& publisher, std::size_t size,
                                                std::int64_t number) {
  const std::int64_t made_ns = measure::now_ns();
  auto payload = publisher.loan_uncleared();
  payload->mutable_data()->resize(size);
  measure::fill(payload->mutable_data()->data(), size, number);
  payload->set_number(number);
  payload->set_made_ns(made_ns);
  return payload;
}

[[nodiscard]] inline bool is_whole(const Payload& payload) {
  return measure::is_filled(payload.data().data(), payload.data().size(), payload.number());
}

}  // namespace fastcycle::benchmark
