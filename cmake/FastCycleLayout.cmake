# One layout for the build tree and for the installed tree, so that every program finds its libraries
# by the same relative path:
#
#   bin/                   programs
#   lib/                   libfastcycle.so and the message libraries
#   lib/fastcycle/         component libraries; those of the ADS and of the examples in ads/ and examples/ below it
#   libexec/fastcycle/     helper programs
#   share/fastcycle/       schema, .proto files
#
# Both trees run without LD_LIBRARY_PATH. In packages, whose prefix is /usr, the libraries are where the
# distribution has those of a machine: lib/x86_64-linux-gnu.
if(FASTCYCLE_PACKAGES)
  set(CMAKE_INSTALL_LIBDIR lib/${CMAKE_LIBRARY_ARCHITECTURE})
  set(CMAKE_SKIP_INSTALL_RPATH ON)
elseif(NOT DEFINED CMAKE_INSTALL_LIBDIR)
  set(CMAKE_INSTALL_LIBDIR lib CACHE STRING "Folder of the libraries, below the prefix")
endif()
include(GNUInstallDirs)

set(FASTCYCLE_PROGRAM_DIR ${CMAKE_INSTALL_BINDIR})
set(FASTCYCLE_LIBRARY_DIR ${CMAKE_INSTALL_LIBDIR})
set(FASTCYCLE_COMPONENT_DIR ${CMAKE_INSTALL_LIBDIR}/fastcycle)
set(FASTCYCLE_HELPER_DIR ${CMAKE_INSTALL_LIBEXECDIR}/fastcycle)
set(FASTCYCLE_SHARE_DIR ${CMAKE_INSTALL_DATADIR}/fastcycle)
set(FASTCYCLE_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/FastCycle)
set(FASTCYCLE_MESSAGE_INCLUDE_DIR ${CMAKE_INSTALL_INCLUDEDIR}/fastcycle-messages)

set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/${FASTCYCLE_LIBRARY_DIR})
set(CMAKE_BUILD_RPATH_USE_ORIGIN ON)

# What is installed belongs to a part: `library`, `development`, `tools` or `examples`. A package holds one.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME tools)

# The folder `to` as seen from the folder `from`, as a run path. Both are relative to the prefix.
function(fastcycle_run_path result from to)
  file(RELATIVE_PATH relative /prefix/${from} /prefix/${to})
  string(REGEX REPLACE "/$" "" relative "${relative}")
  if(relative)
    set(${result} "$ORIGIN/${relative}" PARENT_SCOPE)
  else()
    set(${result} "$ORIGIN" PARENT_SCOPE)
  endif()
endfunction()

# Adds a folder that has a CMakeLists.txt; the others are left out.
macro(fastcycle_add_folder folder)
  if(EXISTS ${PROJECT_SOURCE_DIR}/${folder}/CMakeLists.txt)
    add_subdirectory(${folder})
  endif()
endmacro()
