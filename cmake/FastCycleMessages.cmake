# fastcycle_messages(NAME <target> PROTOS <file.proto> ... [DEPENDS <target> ...] [PROTO_ROOT <folder>])
#
# One message package: a SHARED library of all PROTOS. Components link to it and never compile a .proto
# themselves, because two libraries with the same .proto in one process end it (protobuf keeps one
# registry of files).
#
#   fastcycle_messages(NAME demo_messages PROTOS demo/speed.proto)
#
# lets a component that links demo_messages write #include "demo/speed.pb.h". The names of the files
# count from PROTO_ROOT, which is the current folder unless given. DEPENDS names the packages whose
# .proto files these import.
function(fastcycle_messages)
  cmake_parse_arguments(PARSE_ARGV 0 MSG "" "NAME;PROTO_ROOT" "PROTOS;DEPENDS")
  if(MSG_UNPARSED_ARGUMENTS OR NOT MSG_NAME OR NOT MSG_PROTOS)
    message(FATAL_ERROR "fastcycle_messages(NAME <target> PROTOS <file.proto> ...): NAME and PROTOS "
                        "are needed; cannot read '${MSG_UNPARSED_ARGUMENTS}'.")
  endif()
  if(NOT MSG_PROTO_ROOT)
    set(MSG_PROTO_ROOT .)
  endif()
  cmake_path(ABSOLUTE_PATH MSG_PROTO_ROOT BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
  string(REGEX REPLACE "/$" "" MSG_PROTO_ROOT "${MSG_PROTO_ROOT}")
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${MSG_NAME}.generated)

  # Where protoc looks for imports: here, in the packages below (and what is below them), in FastCycle.
  set(roots ${MSG_PROTO_ROOT})
  set(depends "")
  foreach(dependency ${MSG_DEPENDS})
    fastcycle_find_messages(found ${dependency} "fastcycle_messages(NAME ${MSG_NAME})")
    list(APPEND depends ${found})
    get_target_property(below ${found} FASTCYCLE_PROTO_ROOTS)
    if(below)
      list(APPEND roots ${below})
    endif()
  endforeach()
  if(DEFINED FastCycle_PROTO_DIR AND IS_DIRECTORY ${FastCycle_PROTO_DIR})
    list(APPEND roots ${FastCycle_PROTO_DIR})
  endif()
  list(REMOVE_DUPLICATES roots)
  list(TRANSFORM roots PREPEND "--proto_path=" OUTPUT_VARIABLE proto_paths)

  list(TRANSFORM MSG_PROTOS PREPEND ${MSG_PROTO_ROOT}/ OUTPUT_VARIABLE proto_files)
  set(sources "")
  set(headers "")
  foreach(proto ${MSG_PROTOS})
    string(REGEX REPLACE "\\.proto$" "" stem ${proto})
    if(NOT EXISTS ${MSG_PROTO_ROOT}/${proto})
      message(FATAL_ERROR "fastcycle_messages(NAME ${MSG_NAME}): there is no file ${MSG_PROTO_ROOT}/${proto}.")
    endif()
    cmake_path(GET proto PARENT_PATH folder)
    file(MAKE_DIRECTORY ${generated}/${folder})
    add_custom_command(
      OUTPUT ${generated}/${stem}.pb.cc ${generated}/${stem}.pb.h
      COMMAND protobuf::protoc --cpp_out=${generated} ${proto_paths} ${MSG_PROTO_ROOT}/${proto}
      DEPENDS ${proto_files} ${depends}
      COMMENT "Generating ${stem}.pb.h" VERBATIM)
    list(APPEND sources ${generated}/${stem}.pb.cc)
    list(APPEND headers ${generated}/${stem}.pb.h)
    if(FASTCYCLE_IN_PROJECT AND NOT FASTCYCLE_NOT_INSTALLED)
      install(FILES ${MSG_PROTO_ROOT}/${proto} DESTINATION ${FASTCYCLE_SHARE_DIR}/proto/${folder}
              COMPONENT development)
      install(FILES ${generated}/${stem}.pb.h DESTINATION ${FASTCYCLE_MESSAGE_INCLUDE_DIR}/${folder}
              COMPONENT development)
    endif()
  endforeach()

  add_library(${MSG_NAME} SHARED ${sources} ${headers})
  target_compile_features(${MSG_NAME} PUBLIC cxx_std_20)
  target_compile_options(${MSG_NAME} PRIVATE -w -fno-semantic-interposition)
  target_include_directories(${MSG_NAME} SYSTEM PUBLIC $<BUILD_INTERFACE:${generated}>)
  target_link_libraries(${MSG_NAME} PUBLIC protobuf::libprotobuf Threads::Threads ${depends})
  target_link_options(${MSG_NAME} PRIVATE -Wl,-Bsymbolic-functions)
  fastcycle_refuse_undefined(${MSG_NAME})
  set_target_properties(${MSG_NAME} PROPERTIES
    FASTCYCLE_PROTO_ROOTS "${roots}" FASTCYCLE_IS_MESSAGES TRUE
    CXX_VISIBILITY_PRESET default INTERPROCEDURAL_OPTIMIZATION OFF)

  if(FASTCYCLE_UNITY)
    fastcycle_join_messages(${MSG_NAME} ${proto_files})
  endif()

  if(FASTCYCLE_IN_PROJECT)
    add_library(FastCycle::${MSG_NAME} ALIAS ${MSG_NAME})
    target_include_directories(${MSG_NAME} SYSTEM PUBLIC
      $<INSTALL_INTERFACE:${FASTCYCLE_MESSAGE_INCLUDE_DIR}>)
    set_target_properties(${MSG_NAME} PROPERTIES
      # Among the libraries of a whole system it has to say whose it is, and which version.
      OUTPUT_NAME fastcycle_${MSG_NAME}
      VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
      INSTALL_RPATH "$ORIGIN" EXPORT_PROPERTIES FASTCYCLE_IS_MESSAGES)
    if(NOT FASTCYCLE_NOT_INSTALLED)
      fastcycle_install_library(${MSG_NAME})
    endif()
  else()
    set_target_properties(${MSG_NAME} PROPERTIES
      LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR} BUILD_RPATH_USE_ORIGIN ON INSTALL_RPATH "$ORIGIN")
    install(TARGETS ${MSG_NAME} LIBRARY DESTINATION ${FASTCYCLE_LIBRARY_DIR})
  endif()
endfunction()

# Compiles the generated files of a package in a few large pieces: protobuf's headers take nearly all of the time of each.
# Two names that protoc gives to a static array of every file are made different ones; a package that uses them itself
# is compiled file by file.
function(fastcycle_join_messages target)
  set(names schemas file_default_instances)
  foreach(proto ${ARGN})
    list(JOIN names "|" any)
    file(STRINGS ${proto} uses REGEX "(^|[^a-z_])(${any})([^a-z_]|$)")
    if(uses)
      return()
    endif()
  endforeach()
  set(before "#define FASTCYCLE_JOIN_(a, b) a##b\n#define FASTCYCLE_JOIN(a, b) FASTCYCLE_JOIN_(a, b)\n")
  set(after "")
  foreach(name ${names})
    string(APPEND before "#define ${name} FASTCYCLE_JOIN(${name}_, FASTCYCLE_UNITY_ID)\n")
    string(APPEND after "#undef ${name}\n")
  endforeach()
  set_target_properties(${target} PROPERTIES
    UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12 UNITY_BUILD_UNIQUE_ID FASTCYCLE_UNITY_ID
    UNITY_BUILD_CODE_BEFORE_INCLUDE "${before}" UNITY_BUILD_CODE_AFTER_INCLUDE "${after}")
endfunction()

# The target of a message package that may be named with or without FastCycle::. `user` is who asks.
function(fastcycle_find_messages result name user)
  foreach(candidate ${name} FastCycle::${name})
    if(TARGET ${candidate})
      get_target_property(is_messages ${candidate} FASTCYCLE_IS_MESSAGES)
      if(NOT is_messages)
        message(FATAL_ERROR "${user}: ${name} is no message package. Declare it with "
                            "fastcycle_messages(), or name it under LINK if it is an ordinary library.")
      endif()
      set(${result} ${candidate} PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "${user}: there is no message package ${name}. "
                      "fastcycle_messages(NAME ${name} ...) has to come first.")
endfunction()

# A symbol that nobody defines is an error of the link, not of the start. Clang's sanitizers define
# theirs in the program, so they cannot have it.
function(fastcycle_refuse_undefined target)
  if(NOT (CMAKE_CXX_COMPILER_ID MATCHES "Clang" AND CMAKE_CXX_FLAGS MATCHES "-fsanitize="))
    target_link_options(${target} PRIVATE -Wl,-z,defs)
  endif()
endfunction()
