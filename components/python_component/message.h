#pragma once

#include <cstdint>
#include <memory>

#include <pybind11/pybind11.h>

#include "fastcycle/publisher.h"
#include "fastcycle/sample.h"

namespace fastcycle::python {

/// Whether the object of a component is there that made a loan: it must not be published, nor given
/// back, once that is gone. With the GIL.
struct Link {
  bool is_there = true;
};

/// One message that Python sees: a received one, or a loan. All that is made of it (a part, a
/// memoryview, an array) shares this, and keeps the message.
///
/// @threads  With the GIL.
struct Shared {
  long count = 1;
  detail::Envelope* envelope = nullptr;  ///< Of a loan: null once it was published.
  detail::Holder holder = detail::kNobody;
  bool is_kept = false;  ///< Beyond its callback: then it counts for `holder`.
  detail::PublisherCore* publisher = nullptr;  ///< Who lent it; null: it was received.
  std::shared_ptr<Link> link;                  ///< Of a loan.
  std::uint64_t generation = 0;  ///< Of a loan: counts what may have freed parts of it.
};

/// Makes the Python types of messages, once. @pre The GIL is held.
void make_message_types();

/// A received message, for the time of its callback: what is still there of it when this ends is
/// kept, as a copied `Sample` is.
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

/// What became of `message`, which Python wants `publisher` to publish.
enum class Handed : std::uint8_t {
  kLoan,      ///< It is a loan of this publisher, and spent now: `envelope` is the caller's.
  kReceived,  ///< It is a whole received message; `envelope` stays its own.
  kOther,     ///< Something that a loan can be filled with.
};
struct HandedMessage {
  Handed kind = Handed::kOther;
  detail::Envelope* envelope = nullptr;
  detail::Holder holder = detail::kNobody;
};
/// @errors  pybind11::error_already_set for a loan of another publisher, or one that was published.
[[nodiscard]] HandedMessage hand_over(const pybind11::handle& message,
                                      const detail::PublisherCore& publisher,
                                      const google::protobuf::Descriptor& type);

/// What is known of a received message.
///
/// @errors  pybind11::error_already_set if it is none.
[[nodiscard]] const MessageInfo& message_info(const pybind11::handle& message);

/// Writes `value` (a dict by field, or a message of the same type) into the loan `message`.
///
/// @errors  pybind11::error_already_set that names the field.
void fill(const pybind11::object& message, const pybind11::handle& value);

/// Has what messages of `type` need imported now, and not in a callback.
void prepare_for(const google::protobuf::Descriptor& type);

}  // namespace fastcycle::python
