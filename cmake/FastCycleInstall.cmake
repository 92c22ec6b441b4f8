# What find_package(FastCycle) finds: headers, targets, the helpers for messages and components.
include(CMakePackageConfigHelpers)

install(DIRECTORY include/fastcycle DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")

install(EXPORT FastCycleTargets NAMESPACE FastCycle:: DESTINATION ${FASTCYCLE_CMAKE_DIR})

configure_package_config_file(cmake/FastCycleConfig.cmake.in FastCycleConfig.cmake
  INSTALL_DESTINATION ${FASTCYCLE_CMAKE_DIR}
  PATH_VARS FASTCYCLE_SHARE_DIR FASTCYCLE_PROGRAM_DIR)
write_basic_package_version_file(FastCycleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/FastCycleConfig.cmake
              ${PROJECT_BINARY_DIR}/FastCycleConfigVersion.cmake
              cmake/FastCycleMessages.cmake cmake/FastCycleComponent.cmake
        DESTINATION ${FASTCYCLE_CMAKE_DIR})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
