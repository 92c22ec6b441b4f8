#pragma once

#include <cstdint>
#include <memory>

#include <pybind11/pybind11.h>

#include "fastcycle/publisher.h"
#include "fastcycle/sample.h"

namespace fastcycle::python {

/// Whether the component object that created a loan still exists: otherwise the loan must neither
/// be published nor returned. With the GIL.
struct Link {
  bool is_there = true;
};

/// One message seen by Python: a received one, or a loan. All objects derived from it (a part, a
/// memoryview, an array) share this, and keep the message alive.
///
/// @threads  With the GIL.
struct Shared {
  long count = 1;
  detail::Envelope* envelope = nullptr;  ///< Of a loan: null once it was published.
  detail::Holder holder = detail::kNobody;
  bool is_kept = false;  ///< Beyond its callback: then it counts for `holder`.
  detail::PublisherCore* publisher = nullptr;  ///< The lender; null for a received message.
  std::shared_ptr<Link> link;                  ///< Of a loan.
  std::uint64_t generation = 0;  ///< Of a loan: incremented when parts may have been freed.
};

/// Creates the Python types of messages, once. @pre The GIL is held.
void make_message_types();

/// A received message during its callback: objects that still refer to it afterwards keep it, as a
/// copied `Sample` does.
///
/// @threads  With the GIL.
class Lent {
 public:
  Lent(detail::Envelope& envelope, const google::protobuf::Message& payload, detail::Holder holder);
  Lent(const Lent&) = delete;
  Lent& operator=(const Lent&) = delete;
  ~Lent();

  [[nodiscard]] const pybind11::object& object() const { return object_; }

 private:
  Shared* shared_;
  pybind11::object object_;
};

/// An empty message of `publisher` to fill in.
[[nodiscard]] pybind11::object make_loan(detail::PublisherCore& publisher,
                                         const std::shared_ptr<Link>& link);

/// How `message`, which Python passes to `publisher`, is to be published.
enum class Handed : std::uint8_t {
  kLoan,      ///< A loan of this publisher, now spent: the caller owns `envelope`.
  kReceived,  ///< A complete received message, which keeps `envelope`.
  kOther,     ///< Something that can be written into a loan.
};
struct HandedMessage {
  Handed kind = Handed::kOther;
  detail::Envelope* envelope = nullptr;
  detail::Holder holder = detail::kNobody;
};
/// @errors  pybind11::error_already_set for a loan of another publisher, or one already published.
[[nodiscard]] HandedMessage hand_over(const pybind11::handle& message,
                                      const detail::PublisherCore& publisher,
                                      const google::protobuf::Descriptor& type);

/// Facts about a received message.
///
/// @errors  pybind11::error_already_set if it is not one.
[[nodiscard]] const MessageInfo& message_info(const pybind11::handle& message);

/// Writes `value` (a dict by field, or a message of the same type) into the loan `message`.
///
/// @errors  pybind11::error_already_set that names the field.
void fill(const pybind11::object& message, const pybind11::handle& value);

/// Performs the imports for messages of `type` now, and not in a callback.
void prepare_for(const google::protobuf::Descriptor& type);

}  // namespace fastcycle::python
