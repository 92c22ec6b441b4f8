#pragma once

#include <cstdint>
#include <functional>
#include <thread>
#include <utility>

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "peers/common/run.h"
#include "peers/common/thread.h"
#include "peers/fastdds/plain_type.h"

namespace fastcycle::peers {

namespace dds = eprosima::fastdds::dds;
using Take = std::function<void(const PlainBytes& message, std::int64_t arrived_ns)>;

/// Takes all available messages, by loan: "the application gets the received samples as a reference
/// to the receive queue itself" (Zero-Copy communication).
inline void take_all(dds::DataReader& reader, const Take& take) {
  PlainSequence messages;
  dds::SampleInfoSeq infos;
  while (reader.take(messages, infos) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    const std::int64_t arrived_ns = now_ns();
    for (dds::LoanableCollection::size_type i = 0; i < messages.length(); ++i) {
      if (infos[i].valid_data) {
        take(messages[i], arrived_ns);
      }
    }
    reader.return_loan(messages, infos);
  }
}

/// Runs in the thread in which Fast DDS calls it: within a process, the publisher's.
class Listener final : public dds::DataReaderListener {
 public:
  explicit Listener(Take take) : take_(std::move(take)) {}
  void on_data_available(dds::DataReader* reader) override { take_all(*reader, take_); }

 private:
  const Take take_;
};

/// Receives in a separate thread, woken by a wait set.
inline std::jthread start_waiting(const Run& run, dds::DataReader& reader, Take take) {
  return start_thread([&run, &reader, called = std::move(take)] {
    dds::WaitSet waitset;
    auto& condition = reader.get_statuscondition();
    condition.set_enabled_statuses(dds::StatusMask::data_available());
    waitset.attach_condition(condition);
    while (!run.is_over()) {
      dds::ConditionSeq triggered;
      waitset.wait(triggered, {0, 100'000'000});
      take_all(reader, called);
    }
    waitset.detach_condition(condition);
  });
}

}  // namespace fastcycle::peers
