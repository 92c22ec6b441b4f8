# How the code of this project is compiled, for every target alike.

set(FASTCYCLE_WARNINGS -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wnon-virtual-dtor
    -Woverloaded-virtual $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>)

# Of how many files FASTCYCLE_UNITY makes one. In a first drive, of all that a target has (0) and of several libraries
# (fastcycle_library), without warnings: templates that files have in common are then compiled once.
set(FASTCYCLE_UNITY_FILES 8)
if(FASTCYCLE_FIRST_DRIVE)
  set(FASTCYCLE_UNITY_FILES 0)
  set(FASTCYCLE_WARNINGS -w)
  foreach(library sandbox broker executor segment diagnostics)
    set(FASTCYCLE_${library}_IS_COMPILED_WITH base)
  endforeach()
  foreach(library archive record faults)
    set(FASTCYCLE_${library}_IS_COMPILED_WITH mcap)
  endforeach()
  foreach(library component calls modes replay standby)
    set(FASTCYCLE_${library}_IS_COMPILED_WITH params)
  endforeach()
  set(FASTCYCLE_loading_IS_COMPILED_WITH config)
  set(FASTCYCLE_processes_IS_COMPILED_WITH report)
endif()

# A second build takes what the first one compiled. The sloppiness is what precompiled headers need.
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER env
      CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CCACHE_PROGRAM})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    add_compile_options(-fpch-preprocess)
  endif()
endif()

# The garbage collector of GCC takes an eighth of the compile time. Here it starts at 500 MB of a process, not at 128 MB;
# for the large files of a first drive at 2 GB, if the machine has as much for each CPU.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(heap_kb 500000)
  cmake_host_system_information(RESULT memory_mb QUERY TOTAL_PHYSICAL_MEMORY)
  cmake_host_system_information(RESULT cpus QUERY NUMBER_OF_LOGICAL_CORES)
  math(EXPR mb_of_cpu "${memory_mb} / ${cpus}")
  if(FASTCYCLE_FIRST_DRIVE AND mb_of_cpu GREATER 2000)
    set(heap_kb 2000000)
  endif()
  add_compile_options("SHELL:--param ggc-min-heapsize=${heap_kb}")
endif()

# Optimizes a target that computes much in every build; a Release build says itself how far. Headers that were
# precompiled without -O2 do not fit such a target.
function(fastcycle_optimize target)
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Release")
    target_compile_options(${target} PRIVATE -O2)
    set_target_properties(${target} PROPERTIES DISABLE_PRECOMPILE_HEADERS ON)
  endif()
endfunction()

# Headers that are large and never change. The preset `clang` builds without them, so that an
# include which a file forgot does not stay hidden.
set(FASTCYCLE_PRECOMPILED <algorithm> <atomic> <chrono> <functional> <map> <memory> <optional> <string>
    <thread> <unordered_map> <vector> <fmt/format.h> <google/protobuf/message.h>)
set(FASTCYCLE_PRECOMPILED_LIBRARY ${FASTCYCLE_PRECOMPILED} <filesystem> <fstream> <nlohmann/json.hpp>)
set(FASTCYCLE_PRECOMPILED_TEST ${FASTCYCLE_PRECOMPILED} <gmock/gmock.h> <gtest/gtest.h>)
set(FASTCYCLE_PRECOMPILED_COMPONENT ${FASTCYCLE_PRECOMPILED})
if(FASTCYCLE_FIRST_DRIVE)   # Everything is compiled once.
  find_package(Eigen3 REQUIRED)
  list(APPEND FASTCYCLE_PRECOMPILED_COMPONENT <array> <cmath> <numbers> <span> <Eigen/Core> <Eigen/Geometry> <Eigen/LU>
    <fastcycle/fastcycle.h>)
endif()
set(FASTCYCLE_IN_PROJECT TRUE)
