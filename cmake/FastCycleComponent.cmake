# fastcycle_component(NAME <name> SOURCES <file> ... [MESSAGES <package> ...] [LINK <target> ...]
#                     [TESTS <file> ...])
#
# A component library lib<name>.so: what an application file calls "library": "<name>". MESSAGES names
# message packages made by fastcycle_messages(). TESTS become the GoogleTest program <name>_test, which
# contains the SOURCES as well: it makes the component's objects itself and opens no library.
#
# Where the variable FASTCYCLE_COMPONENT_FOLDER names a folder, the library lies in that folder beside the others, and is
# called "<folder>/<name>": so that it answers to no name that somebody else may choose.
#
#   fastcycle_component(NAME speed_limiter SOURCES speed_limiter.cc MESSAGES demo_messages
#                       TESTS speed_limiter_test.cc)
function(fastcycle_component)
  cmake_parse_arguments(PARSE_ARGV 0 COMPONENT "" "NAME" "SOURCES;MESSAGES;LINK;TESTS")
  set(user "fastcycle_component(NAME ${COMPONENT_NAME})")
  if(COMPONENT_UNPARSED_ARGUMENTS OR NOT COMPONENT_NAME OR NOT COMPONENT_SOURCES)
    message(FATAL_ERROR "fastcycle_component(NAME <name> SOURCES <file> ...): NAME and SOURCES are "
                        "needed; cannot read '${COMPONENT_UNPARSED_ARGUMENTS}'.")
  endif()
  foreach(source ${COMPONENT_SOURCES} ${COMPONENT_TESTS})
    if(source MATCHES "\\.proto$|\\.pb\\.cc$")
      message(FATAL_ERROR "${user}: ${source} must not be compiled into a component, because two "
        "components with the same .proto end the process that loads both. Make a message package, "
        "fastcycle_messages(NAME my_messages PROTOS ...), and name it here: MESSAGES my_messages.")
    endif()
  endforeach()
  set(messages "")
  foreach(package ${COMPONENT_MESSAGES})
    fastcycle_find_messages(found ${package} "${user}")
    list(APPEND messages ${found})
  endforeach()

  add_library(${COMPONENT_NAME} MODULE ${COMPONENT_SOURCES})
  target_compile_options(${COMPONENT_NAME} PRIVATE ${FASTCYCLE_WARNINGS}
    # Two libraries that are loaded apart must not share the static of a template.
    $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  target_link_libraries(${COMPONENT_NAME} PRIVATE FastCycle::fastcycle ${messages} ${COMPONENT_LINK})
  fastcycle_refuse_undefined(${COMPONENT_NAME})
  set(folder "")
  set(to_libraries "$ORIGIN/..")
  if(FASTCYCLE_COMPONENT_FOLDER)
    set(folder /${FASTCYCLE_COMPONENT_FOLDER})
    set(to_libraries "$ORIGIN/../..")
  endif()
  set_target_properties(${COMPONENT_NAME} PROPERTIES
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
    DEFINE_SYMBOL "" BUILD_RPATH_USE_ORIGIN ON INSTALL_RPATH ${to_libraries})

  if(FASTCYCLE_IN_PROJECT)
    set_target_properties(${COMPONENT_NAME} PROPERTIES
      LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/${FASTCYCLE_COMPONENT_DIR}${folder})
    fastcycle_precompile(${COMPONENT_NAME} component "${FASTCYCLE_PRECOMPILED_COMPONENT}" "")
    fastcycle_join(${COMPONENT_NAME})
  else()
    set_target_properties(${COMPONENT_NAME} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}${folder})
  endif()
  if(NOT FASTCYCLE_NOT_INSTALLED)
    install(TARGETS ${COMPONENT_NAME} LIBRARY DESTINATION ${FASTCYCLE_COMPONENT_DIR}${folder})
  endif()

  if(COMPONENT_TESTS AND (BUILD_TESTING OR NOT DEFINED BUILD_TESTING))
    fastcycle_component_test(${COMPONENT_NAME}_test "${COMPONENT_NAME}"
      "${COMPONENT_TESTS}" "${messages};${COMPONENT_LINK}")
  endif()
endfunction()

set(FASTCYCLE_CMAKE_SCRIPTS ${CMAKE_CURRENT_LIST_DIR})

# fastcycle_application(<file.json> ...)
#
# Application files, copied beside the libraries, where `fastcycle run <build folder>/<file.json>` finds them; the
# schema, for editors, comes along. Each is checked by a test, <file>.is_right.
function(fastcycle_application)
  foreach(file ${ARGN})
    cmake_path(GET file FILENAME name)
    cmake_path(GET file STEM stem)
    configure_file(${file} ${CMAKE_BINARY_DIR}/${name} COPYONLY)
    add_test(NAME ${stem}.is_right COMMAND ${FastCycle_PROGRAM_DIR}/fastcycle check ${CMAKE_BINARY_DIR}/${name})
  endforeach()
  configure_file(${FastCycle_SHARE_DIR}/application.schema.json ${CMAKE_BINARY_DIR}/application.schema.json COPYONLY)
endfunction()

# fastcycle_determinism_test(<file.json> [FOR <time>])
#
# A test, <file>.repeats, that a live run of an application file of fastcycle_application() repeats: it is recorded for
# 2 s, or as long as FOR says, and executed again by `fastcycle verify`; a message that differs fails the test.
function(fastcycle_determinism_test file)
  cmake_parse_arguments(PARSE_ARGV 1 REPEATS "" "FOR" "")
  if(NOT REPEATS_FOR)
    set(REPEATS_FOR 2s)
  endif()
  cmake_path(GET file FILENAME name)
  cmake_path(GET file STEM stem)
  add_test(NAME ${stem}.repeats
    COMMAND ${CMAKE_COMMAND} -D FASTCYCLE=${FastCycle_PROGRAM_DIR}/fastcycle -D TIME=${REPEATS_FOR}
            -D APPLICATION=${CMAKE_BINARY_DIR}/${name} -D FOLDER=${CMAKE_BINARY_DIR}/${stem}.repeats
            -P ${FASTCYCLE_CMAKE_SCRIPTS}/FastCycleRepeats.cmake)
endfunction()

# The test program of one component: its tests, and the object files of its library.
function(fastcycle_component_test target component sources libraries)
  if(NOT TARGET GTest::gtest_main)
    find_package(GTest REQUIRED)
  endif()
  add_executable(${target} ${sources} $<TARGET_OBJECTS:${component}>)
  target_compile_options(${target} PRIVATE ${FASTCYCLE_WARNINGS})
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE FastCycle::fastcycle GTest::gmock GTest::gtest_main ${libraries})
  set_target_properties(${target} PROPERTIES INTERPROCEDURAL_OPTIMIZATION OFF)
  if(FASTCYCLE_IN_PROJECT)
    target_compile_options(${target} PRIVATE ${FASTCYCLE_TEST_OPTIONS})
    set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
    fastcycle_precompile(${target} test "${FASTCYCLE_PRECOMPILED_TEST}" "")
    fastcycle_join_tests(${target} ${sources})
  endif()
  fastcycle_discover_tests(${target} ${component}. component)
endfunction()

# One ctest entry per TEST() of the program, found when ctest runs.
function(fastcycle_discover_tests target prefix labels)
  include(GoogleTest)
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    TEST_PREFIX "${prefix}" PROPERTIES LABELS "${labels}" TIMEOUT 300)
endfunction()
