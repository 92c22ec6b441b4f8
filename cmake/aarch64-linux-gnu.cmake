# Builds for 64-bit ARM on another machine: Debian's g++-aarch64-linux-gnu, and the libraries of the foreign
# architecture arm64. What is built runs under qemu-user, the tests too.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64)
set(ENV{PKG_CONFIG_LIBDIR} /usr/lib/aarch64-linux-gnu/pkgconfig:/usr/share/pkgconfig)
# Programs that run while building are this machine's.
find_program(Protobuf_PROTOC_EXECUTABLE protoc REQUIRED)
