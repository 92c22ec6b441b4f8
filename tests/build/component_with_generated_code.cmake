include(${CMAKE_CURRENT_LIST_DIR}/../../cmake/FastCycleMessages.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/../../cmake/FastCycleComponent.cmake)
fastcycle_component(NAME limiter SOURCES limiter.cc gen/demo/speed.pb.cc)
