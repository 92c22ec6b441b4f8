# Says in FASTCYCLE_HAS_PYTHON whether what belongs to Python is built, and finds what that needs.
option(FASTCYCLE_PYTHON "Build the Python package, also without tests" "${FASTCYCLE_PACKAGES}")
set(FASTCYCLE_HAS_PYTHON FALSE)
if(NOT (BUILD_TESTING OR FASTCYCLE_PYTHON))
  return()
endif()
# A sanitizer wants to be in the program, and here that is Python.
if(CMAKE_CROSSCOMPILING OR CMAKE_CXX_FLAGS MATCHES "-fsanitize")
  return()
endif()

# The distribution's Python, whose headers, pybind11 and NumPy belong together; another one by -DPython_EXECUTABLE.
if(NOT DEFINED Python_EXECUTABLE AND EXISTS /usr/bin/python3)
  set(Python_EXECUTABLE /usr/bin/python3)
endif()
set(PYBIND11_FINDPYTHON ON)
find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module Development.Embed)
find_package(pybind11 2.10 QUIET CONFIG)
if(Python_FOUND AND pybind11_FOUND)
  set(FASTCYCLE_HAS_PYTHON TRUE)
else()
  message(STATUS "Without python3-dev and pybind11-dev the Python package is left out")
endif()
