// What npm's reader has to read: npm_test.py computes the same values by itself.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "npm_test/everything.pb.h"

namespace {

using npm_test::Everything;
using npm_test::Image;

/// The `index`-th value of message `number`: a 64-bit mix that is easy to repeat elsewhere.
std::uint64_t value_of(std::uint64_t number, std::uint64_t index) {
  std::uint64_t value = number * 64 + index;
  value = (value ^ (value >> 30U)) * 0xBF58476D1CE4E5B9U;
  value = (value ^ (value >> 27U)) * 0x94D049BB133111EBU;
  return value ^ (value >> 31U);
}

std::int64_t signed_of(std::uint64_t number, std::uint64_t index) {
  return static_cast<std::int64_t>(value_of(number, index));
}

void fill_bytes(std::string& bytes, std::size_t size, std::uint64_t number) {
  bytes.resize(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<char>((number * 7 + i * 13) & 0xFFU);
  }
}

void fill_numbers(Everything& message, std::uint64_t number) {
  message.set_a_double(static_cast<double>(signed_of(number, 1)) / 1000.0);
  message.set_a_float(static_cast<float>(static_cast<std::int32_t>(value_of(number, 2))) / 8.0F);
  message.set_an_int32(static_cast<std::int32_t>(value_of(number, 3)));
  message.set_an_int64(signed_of(number, 4));
  message.set_a_uint32(static_cast<std::uint32_t>(value_of(number, 5)));
  message.set_a_uint64(value_of(number, 6));
  message.set_a_sint32(static_cast<std::int32_t>(value_of(number, 7)));
  message.set_a_sint64(signed_of(number, 8));
  message.set_a_fixed32(static_cast<std::uint32_t>(value_of(number, 9)));
  message.set_a_fixed64(value_of(number, 10));
  message.set_an_sfixed32(static_cast<std::int32_t>(value_of(number, 11)));
  message.set_an_sfixed64(signed_of(number, 12));
  message.set_a_bool(number % 2 == 1);
}

void fill_the_rest(Everything& message, std::uint64_t number) {
  message.set_a_string("Nummer " + std::to_string(number) + " äöü €");
  fill_bytes(*message.mutable_some_bytes(), number % 3000, number);
  message.set_kind(number % 3 == 0   ? npm_test::KIND_NONE
                   : number % 3 == 1 ? npm_test::KIND_ONE
                                     : npm_test::KIND_FAR);
  message.mutable_part()->set_number(signed_of(number, 13));
  message.mutable_part()->set_name("part");
  message.mutable_part()->add_parts()->set_name("part of it");
  for (std::uint64_t i = 0; i < number % 4; ++i) {
    message.add_parts()->set_number(static_cast<std::int64_t>(i) - 1);
    message.add_doubles(static_cast<double>(i) + 0.1);
    message.add_longs(signed_of(number, 20 + i));
    (*message.mutable_by_name())["key " + std::to_string(i)] = signed_of(number, 30 + i);
  }
  if (number % 2 == 0) {
    message.set_word("even");
  } else {
    message.set_number(value_of(number, 40));
  }
  if (number % 5 == 0) {
    message.set_perhaps(0);
  }
  message.mutable_time()->set_seconds(signed_of(number, 41) % 1'000'000'000'000);
  message.mutable_time()->set_nanos(static_cast<std::int32_t>(number % 1'000'000'000));
}

/// Each millisecond a message on `everything`, in each fifth two of the same time, and in each
/// hundredth one of 200,000 bytes on `images`, until there were `count` milliseconds.
class Author final : public fastcycle::Component {
 public:
  explicit Author(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 1000, .min = 1}).get()),
        everything_(context.create_publisher<Everything>("everything")),
        images_(context.create_publisher<Image>("images")),
        source_(context.create_source()) {
    context.create_timer({.period = std::chrono::milliseconds(1)}, [this] { write(); });
  }

 private:
  void write() {
    if (ticks_ == count_) {
      source_.finish();
      return;
    }
    ++ticks_;
    publish_everything();
    if (ticks_ % 5 == 0) {
      publish_everything();
    }
    if (ticks_ % 100 == 0) {
      ++images_count_;
      auto image = images_.loan();
      image->set_width(static_cast<std::uint32_t>(images_count_));
      fill_bytes(*image->mutable_data(), 200'000, images_count_);
      images_.publish(std::move(image));
    }
  }

  void publish_everything() {
    ++everything_count_;
    auto message = everything_.loan();
    fill_numbers(*message, everything_count_);
    fill_the_rest(*message, everything_count_);
    everything_.publish(std::move(message));
  }

  const std::int64_t count_;
  fastcycle::Publisher<Everything> everything_;
  fastcycle::Publisher<Image> images_;
  fastcycle::Source source_;
  std::int64_t ticks_ = 0;
  std::uint64_t everything_count_ = 0;
  std::uint64_t images_count_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Author)
