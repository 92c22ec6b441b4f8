# The Debian packages, one for each part of what is installed (docs/decisions/0030-packages-by-cpack.md):
#
#   libfastcycle0.1      library       libfastcycle.so and the message packages
#   libfastcycle-dev     development   headers, .proto files, what CMake and pkg-config find
#   fastcycle            tools         the program, its pages and completion, the components that come with it
#   fastcycle-examples   examples      the ADS with its data, and the examples
#   fastcycle-dds        dds           the gateway to DDS and ROS 2, if a DDS was there
#   python3-fastcycle    python        the Python package and components in Python, if python3-dev and pybind11-dev are there
#
# `./dev packages` makes them.
find_program(GZIP gzip REQUIRED)

# A package that holds a library has the library's binary interface in its name.
set(abi ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(package_of_library libfastcycle${abi})
set(package_of_development libfastcycle-dev)
set(package_of_tools fastcycle)
set(package_of_examples fastcycle-examples)
set(package_of_dds fastcycle-dds)
set(package_of_python python3-fastcycle)
set(parts library development tools examples)
if(TARGET dds_gateway)
  list(APPEND parts dds)
endif()
if(TARGET fastcycle_python)
  list(APPEND parts python)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_COMPONENTS_ALL ${parts})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_PACKAGE_NAME fastcycle)
set(CPACK_PACKAGE_VENDOR FastCycle)
set(CPACK_PACKAGE_CONTACT "FastCycle maintainers <maintainers@fastcycle.dev>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")   # Each package has its own, its first line.
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE https://fastcycle.dev)

# What the libraries of other packages are needed for is read from the files; what lies in our own, said here.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/${FASTCYCLE_LIBRARY_DIR})
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/cmake/debian/triggers)
set(same "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

set(about "FastCycle runs the modules of an automated driving system as components
inside one process, and hands messages from one to the next by pointer.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_DESCRIPTION "components of automated driving in one process (libraries)
${about}
.
This package has the library, and the message packages that come with it.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libfastcycle${abi} ${same}, fastcycle ${same}, libprotobuf-dev, protobuf-compiler, libfmt-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS "cmake (>= 3.25), g++ (>= 4:12), libgmock-dev, make")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "components of automated driving in one process (development)
${about}
.
This package has what a component of one's own is built with: its headers,
the .proto files, and what CMake and pkg-config find. \"fastcycle new app NAME\"
begins one.")

set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION utils)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "libfastcycle${abi} ${same}")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "fastcycle-examples, graphviz, libfastcycle-dev")
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "components of automated driving in one process (tools)
${about}
.
This package has the command line, which runs applications, looks into
them while they run, and records, replays and examines what they said; and
the recorder as a component.")

set(CPACK_DEBIAN_EXAMPLES_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_EXAMPLES_PACKAGE_DEPENDS "libfastcycle${abi} ${same}, fastcycle ${same}")
set(CPACK_DEBIAN_EXAMPLES_PACKAGE_SUGGESTS "python3-fastcycle")
set(CPACK_DEBIAN_EXAMPLES_DESCRIPTION "components of automated driving in one process (examples)
${about}
.
This package has an automated driving system of twelve modules, with
recorded traffic to drive through, one minute of a real drive, and a course
of examples.")

set(CPACK_DEBIAN_DDS_PACKAGE_SECTION net)
set(CPACK_DEBIAN_DDS_PACKAGE_DEPENDS "libfastcycle${abi} ${same}, fastcycle ${same}")
set(CPACK_DEBIAN_DDS_DESCRIPTION "components of automated driving in one process (DDS)
${about}
.
This package has the component dds_gateway, which lets topics of an
application cross to ROS 2 nodes and back, by DDS.")

# The module is for one version of Python, which its name says.
get_property(python_version GLOBAL PROPERTY FASTCYCLE_PYTHON_VERSION)
get_property(next_python_version GLOBAL PROPERTY FASTCYCLE_NEXT_PYTHON_VERSION)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "libfastcycle${abi} ${same}, python3 (>= ${python_version}~), \
python3 (<< ${next_python_version}~), python3-protobuf")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "python3-numpy, python3-pandas")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "fastcycle, python3-matplotlib, python3-pytest")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
    ${PROJECT_SOURCE_DIR}/cmake/debian/python/postinst ${PROJECT_SOURCE_DIR}/cmake/debian/python/prerm)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "components of automated driving in one process (Python)
${about}
.
This package has the Python package fastcycle: recordings as NumPy arrays and
tables of pandas, connections to running applications, and tests of
components; and the library that runs components which are written in
Python.")

# What Debian wants to be beside every package.
string(TIMESTAMP FASTCYCLE_PACKAGE_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)   # SOURCE_DATE_EPOCH, if there is one.
set(debian ${PROJECT_BINARY_DIR}/debian)
configure_file(cmake/debian/changelog.in ${debian}/changelog @ONLY)
configure_file(CHANGELOG.md ${debian}/upstream COPYONLY)
execute_process(COMMAND ${GZIP} -9nf ${debian}/changelog ${debian}/upstream COMMAND_ERROR_IS_FATAL ANY)

foreach(part ${parts})
  set(package ${package_of_${part}})
  string(TOUPPER ${part} PART)
  set(CPACK_DEBIAN_${PART}_PACKAGE_NAME ${package})
  set(documents ${CMAKE_INSTALL_DATADIR}/doc/${package})
  install(FILES cmake/debian/copyright DESTINATION ${documents} COMPONENT ${part})
  install(FILES ${debian}/changelog.gz DESTINATION ${documents} COMPONENT ${part} RENAME changelog.Debian.gz)
  install(FILES ${debian}/upstream.gz DESTINATION ${documents} COMPONENT ${part} RENAME changelog.gz)
  configure_file(cmake/debian/${part}.lintian-overrides ${debian}/${package}.lintian-overrides @ONLY)
  install(FILES ${debian}/${package}.lintian-overrides DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides
          RENAME ${package} COMPONENT ${part})
endforeach()

include(CPack)
