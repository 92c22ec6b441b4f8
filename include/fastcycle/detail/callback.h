#pragma once

#include <concepts>
#include <type_traits>

#include <google/protobuf/message.h>

namespace fastcycle::detail {

/// Whether a parameter is a message, and not a reference to one: each call would copy it.
template <typename... P>
using AnyIsMessage = std::bool_constant<(std::derived_from<P, google::protobuf::Message> || ...)>;

template <typename R, typename... P>
AnyIsMessage<P...> parameters_of(R (*)(P...));
template <typename R, typename C, typename... P>
AnyIsMessage<P...> parameters_of(R (C::*)(P...));
template <typename R, typename C, typename... P>
AnyIsMessage<P...> parameters_of(R (C::*)(P...) const);

/// Whether `F` takes a message by value. False for a callable with several signatures, such as a
/// generic lambda, for which this cannot be determined.
template <typename F>
consteval bool takes_message_by_value() {
  if constexpr (requires { parameters_of(&F::operator()); }) {
    return decltype(parameters_of(&F::operator()))::value;
  } else if constexpr (std::is_pointer_v<F>) {
    return decltype(parameters_of(static_cast<F>(nullptr)))::value;
  } else {
    return false;
  }
}

}  // namespace fastcycle::detail

/// Rejects a callback that copies its message.
#define FASTCYCLE_REFUSE_COPIED_MESSAGE(F)                                                      \
  static_assert(!::fastcycle::detail::takes_message_by_value<F>(),                              \
                "the callback takes a message by value, which copies it in each call: take it " \
                "as `const T&`, or as `const Sample<T>&` to see its info or to keep it")
