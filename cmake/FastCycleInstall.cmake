# What find_package(FastCycle) and pkg-config find: headers, targets, the helpers for messages and components.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
include(CMakePackageConfigHelpers)

# The schemas of the files that people write; editors read them.
file(GLOB schemas CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/schema/*.json)
foreach(schema ${schemas})
  cmake_path(GET schema FILENAME name)
  configure_file(${schema} ${PROJECT_BINARY_DIR}/${FASTCYCLE_SHARE_DIR}/${name} COPYONLY)
endforeach()
install(FILES ${schemas} DESTINATION ${FASTCYCLE_SHARE_DIR} COMPONENT tools)

install(DIRECTORY include/fastcycle transforms/include/fastcycle DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")

install(EXPORT FastCycleTargets NAMESPACE FastCycle:: DESTINATION ${FASTCYCLE_CMAKE_DIR})

# Not where find_package() looks: it would find the build's own bin in PATH, and what is there is not installed.
configure_package_config_file(cmake/FastCycleConfig.cmake.in for_install/FastCycleConfig.cmake
  INSTALL_DESTINATION ${FASTCYCLE_CMAKE_DIR}
  PATH_VARS FASTCYCLE_SHARE_DIR FASTCYCLE_PROGRAM_DIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/for_install/FastCycleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/for_install/FastCycleConfig.cmake
              ${PROJECT_BINARY_DIR}/for_install/FastCycleConfigVersion.cmake
              cmake/FastCycleMessages.cmake cmake/FastCycleComponent.cmake cmake/FastCycleRepeats.cmake
        DESTINATION ${FASTCYCLE_CMAKE_DIR})

if(EXISTS ${PROJECT_SOURCE_DIR}/examples)
  install(DIRECTORY examples DESTINATION ${FASTCYCLE_SHARE_DIR} COMPONENT examples
          PATTERN "check_example.py" EXCLUDE PATTERN "__pycache__" EXCLUDE)
endif()

fastcycle_run_path(to_prefix ${FASTCYCLE_LIBRARY_DIR}/pkgconfig .)
string(REPLACE "$ORIGIN" "\${pcfiledir}" FASTCYCLE_PC_PREFIX "${to_prefix}")
configure_file(cmake/fastcycle.pc.in fastcycle.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/fastcycle.pc DESTINATION ${FASTCYCLE_LIBRARY_DIR}/pkgconfig)

if(FASTCYCLE_PACKAGES)
  include(FastCyclePackages)
else()
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tools)
endif()
