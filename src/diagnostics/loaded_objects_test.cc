#include "diagnostics/loaded_objects.h"

#include <array>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnostics/stack.h"

namespace fastcycle::diagnostics {

/// Of a name that is looked for below.
struct Looked {
  static std::string where_it_stands();
};

[[gnu::noinline]] std::string Looked::where_it_stands() {
  RawStack stack;
  read_stack(nullptr, stack);
  std::array<Frame, kMaxFrames> frames;
  const std::size_t count = to_frames(stack, frames);
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    std::array<char, 512> line{};
    TextBuffer buffer(line);
    buffer << frames[i];
    text += std::string(buffer.text()) + "\n";
  }
  return text;
}

namespace {

std::string demangled(std::string_view symbol) {
  std::array<char, 256> memory{};
  TextBuffer text(memory);
  demangle(symbol, text);
  return std::string(text.text());
}

TEST(LoadedObjects, AStackNamesFunctionsAndObjects) {
  note_loaded_objects();
  EXPECT_THAT(Looked::where_it_stands(),
              testing::ContainsRegex("Looked::where_it_stands\\+0x[0-9a-f]+ \\(fastcycle_diagnos"));
}

TEST(LoadedObjects, AnAddressInNoObjectIsANumber) {
  note_loaded_objects();
  Frame frame{.address = 0x10};
  name_frames({&frame, 1});
  std::array<char, 64> memory{};
  TextBuffer text(memory);
  text << frame;
  EXPECT_EQ(text.text(), "0x10");
}

TEST(LoadedObjects, TheProgramHasABuildIdOrNone) {
  note_loaded_objects();
  const LoadedObject* const object =
      find_object(reinterpret_cast<std::uintptr_t>(&Looked::where_it_stands));
  ASSERT_NE(object, nullptr);
  EXPECT_TRUE(object->is_program);
  EXPECT_EQ(object->name, "fastcycle_diagnostics_test");
  EXPECT_THAT(object->build_id, testing::MatchesRegex("[0-9a-f]*"));
}

TEST(LoadedObjects, SymbolsAreNamedWithoutArguments) {
  EXPECT_EQ(demangled("main"), "main");
  EXPECT_EQ(demangled("_Z3foov"), "foo");
  EXPECT_EQ(demangled("_ZN4demo7Planner4planERKNS_4GoalE"), "demo::Planner::plan");
  EXPECT_EQ(demangled("_ZN4demo7PlannerC2ERN9fastcycle7ContextE"), "demo::Planner::Planner");
  EXPECT_EQ(demangled("_ZN4demo7PlannerD0Ev"), "demo::Planner::~Planner");
  EXPECT_EQ(demangled("_ZNK4demo7Planner4sizeEv"), "demo::Planner::size");
  EXPECT_EQ(demangled("_ZNSt6vectorIiSaIiEE2atEm"), "std::vector::at");
  EXPECT_EQ(demangled("_ZN12_GLOBAL__N_17Planner4planEv"), "(anonymous)::Planner::plan");
  EXPECT_EQ(demangled("_ZN9fastcycle8ParamsOfI3FooLi3EE3getEv"), "fastcycle::ParamsOf::get");
  EXPECT_EQ(demangled("_ZZN4demo7PlannerC4ERN9fastcycle7ContextEENKUlRKT_E_clIiEEDaS5_"),
            "demo::Planner::Planner::{lambda}");
  EXPECT_EQ(demangled("_ZSt9terminatev"), "std::terminate");
}

TEST(LoadedObjects, ABrokenSymbolIsCutAndNothingElse) {
  const std::string symbol = "_ZN9fastcycle8ParamsOfI3FooLi3ESt4pairIiS0_EE3getEv";
  for (std::size_t size = 0; size <= symbol.size(); ++size) {
    demangled(symbol.substr(0, size));
  }
  demangled("_ZN99999999999999999999foo");
  demangled("_ZNS");
  demangled("_ZNIT");
}

TEST(TextBuffer, WhatDoesNotFitIsLeftOut) {
  std::array<char, 8> memory{};
  TextBuffer text(memory);
  text << "abc" << 12345 << "more";
  EXPECT_EQ(text.text(), "abc12345");
}

TEST(TextBuffer, NumbersAndTimesAreWritten) {
  std::array<char, 200> memory{};
  TextBuffer text(memory);
  text << -3 << " " << INT64_MIN << " " << UINT64_MAX << " " << Hex{255} << " " << Span{1'250'000}
       << " " << Span{12'340'000'000} << " " << Span{-2'000'000} << " " << Foreign{"a\x1b[0m"};
  EXPECT_EQ(text.text(),
            "-3 -9223372036854775808 18446744073709551615 0xff 1.2 ms 12.3 s -2.0 ms a?[0m");
}

}  // namespace
}  // namespace fastcycle::diagnostics
