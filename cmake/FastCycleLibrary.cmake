# Helpers for the libraries and programs of this project.

# Declares libfastcycle.so. fastcycle_library() fills it.
function(fastcycle_core_library)
  # CMake wants one source of its own; all others come from src/.
  file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/core.cc CONTENT "")
  add_library(fastcycle SHARED ${PROJECT_BINARY_DIR}/core.cc)
  add_library(FastCycle::fastcycle ALIAS fastcycle)
  target_compile_features(fastcycle PUBLIC cxx_std_20)
  target_include_directories(fastcycle PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(fastcycle PUBLIC protobuf::libprotobuf fmt::fmt Threads::Threads
                                  PRIVATE ${CMAKE_DL_LIBS})
  target_link_options(fastcycle PRIVATE -Wl,-Bsymbolic-functions)
  fastcycle_refuse_undefined(fastcycle)
  fastcycle_run_path(run_path ${FASTCYCLE_LIBRARY_DIR} ${FASTCYCLE_LIBRARY_DIR})
  set_target_properties(fastcycle PROPERTIES INTERPROCEDURAL_OPTIMIZATION "${FASTCYCLE_LTO}"
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
    INSTALL_RPATH ${run_path})
  fastcycle_install_library(fastcycle)
endfunction()

# What others link to: the library itself, and the name that the linker looks for.
function(fastcycle_install_library target)
  install(TARGETS ${target} EXPORT FastCycleTargets LIBRARY DESTINATION ${FASTCYCLE_LIBRARY_DIR}
          COMPONENT library NAMELINK_COMPONENT development)
endfunction()

# fastcycle_library(<name> SOURCES ... [NOT_IN_FIRST_DRIVE <source> ...] [DEPENDS ...] [LINK ...] [DEFINE <macro> ...]
#                   [PRECOMPILE <header> ...] [TESTS ... [TEST_DEPENDS ...] [TEST_LINK ...]])
#
# Makes src/<name> a part of libfastcycle.so, and its tests the program fastcycle_<name>_test. DEPENDS
# names the libraries of src/ whose headers it may include (scripts/check_includes.py sees to it), LINK
# the targets of other projects it needs, PRECOMPILE large headers that most of its files include. Its
# tests may need more: TEST_DEPENDS names libraries of src/ that may come after it, TEST_LINK targets.
function(fastcycle_library name)
  cmake_parse_arguments(PARSE_ARGV 1 LIB "" "" "SOURCES;NOT_IN_FIRST_DRIVE;DEPENDS;LINK;DEFINE;PRECOMPILE;TESTS;TEST_DEPENDS;TEST_LINK")
  if(LIB_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "fastcycle_library(${name}): cannot read '${LIB_UNPARSED_ARGUMENTS}'.")
  endif()
  foreach(dependency ${LIB_DEPENDS})
    if(NOT TARGET fastcycle_${dependency})
      message(FATAL_ERROR "fastcycle_library(${name}): DEPENDS ${dependency} names no library of src/ "
                          "that comes before ${name} in the order of the top CMakeLists.txt.")
    endif()
  endforeach()

  if(NOT FASTCYCLE_FIRST_DRIVE)
    list(APPEND LIB_SOURCES ${LIB_NOT_IN_FIRST_DRIVE})
  endif()
  target_link_libraries(fastcycle PRIVATE ${LIB_LINK})
  if(FASTCYCLE_FIRST_DRIVE AND FASTCYCLE_${name}_IS_COMPILED_WITH)
    set(carrier fastcycle_${FASTCYCLE_${name}_IS_COMPILED_WITH})
    target_sources(${carrier} PRIVATE ${LIB_SOURCES})
    target_link_libraries(${carrier} PRIVATE ${LIB_LINK})
    target_compile_definitions(${carrier} PRIVATE ${LIB_DEFINE})
    add_library(fastcycle_${name} INTERFACE)
    return()
  endif()

  add_library(fastcycle_${name} OBJECT ${LIB_SOURCES})
  set_target_properties(fastcycle_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON
    INTERPROCEDURAL_OPTIMIZATION "${FASTCYCLE_LTO}")
  target_compile_options(fastcycle_${name} PRIVATE ${FASTCYCLE_WARNINGS} -fno-semantic-interposition)
  target_compile_definitions(fastcycle_${name} PRIVATE ${LIB_DEFINE})
  fastcycle_join(fastcycle_${name})
  target_include_directories(fastcycle_${name} PRIVATE
    ${PROJECT_SOURCE_DIR}/include ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(fastcycle_${name} PRIVATE
    protobuf::libprotobuf fmt::fmt Threads::Threads ${LIB_LINK})
  fastcycle_precompile(fastcycle_${name} library "${FASTCYCLE_PRECOMPILED_LIBRARY}" "${LIB_PRECOMPILE}")

  target_sources(fastcycle PRIVATE $<TARGET_OBJECTS:fastcycle_${name}>)

  if(LIB_TESTS AND BUILD_TESTING)
    fastcycle_test(fastcycle_${name}_test SOURCES ${LIB_TESTS} LINK ${LIB_LINK} ${LIB_TEST_LINK}
                   PRECOMPILE ${LIB_PRECOMPILE} PREFIX ${name}. LABELS unit)
  endif()
endfunction()

# fastcycle_test(<target> SOURCES ... [LINK ...] [PRECOMPILE ...] [PREFIX <text>] [LABELS ...])
#
# A GoogleTest program over libfastcycle.so, with the headers of src/ in reach.
function(fastcycle_test target)
  cmake_parse_arguments(PARSE_ARGV 1 TEST "" "PREFIX" "SOURCES;LINK;PRECOMPILE;LABELS")
  add_executable(${target} ${TEST_SOURCES})
  target_compile_options(${target} PRIVATE ${FASTCYCLE_WARNINGS} ${FASTCYCLE_TEST_OPTIONS})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${target} PRIVATE fastcycle GTest::gmock GTest::gtest_main ${TEST_LINK})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests
                                             INTERPROCEDURAL_OPTIMIZATION OFF)
  fastcycle_precompile(${target} test "${FASTCYCLE_PRECOMPILED_TEST}" "${TEST_PRECOMPILE}")
  fastcycle_join_tests(${target} ${TEST_SOURCES})
  fastcycle_discover_tests(${target} "${TEST_PREFIX}" "${TEST_LABELS}")
endfunction()

# With FASTCYCLE_UNITY, compiles the files of a test program in a few large pieces: the headers that they all include take
# most of the time of each. Other files of the program are compiled alone.
function(fastcycle_join_tests target)
  if(FASTCYCLE_UNITY)
    set(others ${ARGN})
    list(FILTER others EXCLUDE REGEX "_test\\.cc$")
    fastcycle_compile_alone(${others})
  endif()
  fastcycle_join(${target})
endfunction()

# The same for the files of any target.
function(fastcycle_join target)
  if(FASTCYCLE_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE "${FASTCYCLE_UNITY_FILES}")
    # What a file keeps for itself looks like something of a header there.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
endfunction()

# fastcycle_compile_alone(<file> ...): files whose own names collide with those of others, and which are no part of a
# larger piece.
function(fastcycle_compile_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# fastcycle_program(<name> SOURCES ... [LINK ...] [HELPER])
#
# A program over libfastcycle.so, installed to bin/, or as a HELPER to libexec/fastcycle/; where
# FASTCYCLE_NOT_INSTALLED is set, it stays in the build tree.
function(fastcycle_program name)
  cmake_parse_arguments(PARSE_ARGV 1 PROGRAM "HELPER" "" "SOURCES;LINK")
  set(target ${name})
  if(name STREQUAL "fastcycle")   # the library has this name already
    set(target fastcycle_program)
  endif()
  set(folder ${FASTCYCLE_PROGRAM_DIR})
  if(PROGRAM_HELPER)
    set(folder ${FASTCYCLE_HELPER_DIR})
  endif()
  fastcycle_run_path(run_path ${folder} ${FASTCYCLE_LIBRARY_DIR})

  add_executable(${target} ${PROGRAM_SOURCES})
  target_compile_options(${target} PRIVATE ${FASTCYCLE_WARNINGS})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${target} PRIVATE fastcycle ${PROGRAM_LINK})
  # The loader ignores $ORIGIN in a program that has capabilities of its file (setcap), and takes the second one.
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name}
                        INSTALL_RPATH "${run_path};${CMAKE_INSTALL_PREFIX}/${FASTCYCLE_LIBRARY_DIR}"
                        BUILD_RPATH "${run_path};${PROJECT_BINARY_DIR}/${FASTCYCLE_LIBRARY_DIR}"
                        RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/${folder})
  if(NOT FASTCYCLE_NOT_INSTALLED)
    # Not readable for others: where root installs it, the kernel protects its memory from the first instruction on
    # (SECURITY.md, "The window at start-up").
    install(TARGETS ${target} RUNTIME DESTINATION ${folder}
            PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_EXECUTE WORLD_EXECUTE)
  endif()
endfunction()

# Targets that are compiled alike share one precompiled header, made by the target fastcycle_pch_<kind>.
# One that asks for `more` headers has its own.
function(fastcycle_precompile target kind headers more)
  if(CMAKE_DISABLE_PRECOMPILE_HEADERS)
    return()
  endif()
  if(more)
    target_precompile_headers(${target} PRIVATE ${headers} ${more})
    return()
  endif()
  set(carrier fastcycle_pch_${kind})
  if(NOT TARGET ${carrier})
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/${carrier}.cc CONTENT "")
    if(kind STREQUAL "test")
      add_library(${carrier} OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/${carrier}.cc)
      target_link_libraries(${carrier} PRIVATE GTest::gmock GTest::gtest_main)
    else()
      add_library(${carrier} OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/${carrier}.cc)
      set_target_properties(${carrier} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    endif()
    # Flags that differ would make the compiler refuse it.
    get_target_property(visibility ${target} CXX_VISIBILITY_PRESET)
    get_target_property(options ${target} COMPILE_OPTIONS)
    if(visibility)
      set_target_properties(${carrier} PROPERTIES CXX_VISIBILITY_PRESET ${visibility}
                                                  VISIBILITY_INLINES_HIDDEN ON)
    endif()
    target_compile_options(${carrier} PRIVATE ${options})
    target_link_libraries(${carrier} PRIVATE protobuf::libprotobuf fmt::fmt Threads::Threads)
    if(FASTCYCLE_FIRST_DRIVE AND kind STREQUAL "component")
      target_include_directories(${carrier} PRIVATE ${PROJECT_SOURCE_DIR}/include)
      target_link_libraries(${carrier} PRIVATE Eigen3::Eigen)
    endif()
    target_precompile_headers(${carrier} PRIVATE ${headers})
  endif()
  target_precompile_headers(${target} REUSE_FROM ${carrier})
  # As a macro that the headers look at would.
  target_compile_definitions(${target} PRIVATE $<TARGET_PROPERTY:fmt::fmt,INTERFACE_COMPILE_DEFINITIONS>)
endfunction()
