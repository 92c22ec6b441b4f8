#include "dds_gateway/doctor/host.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>

namespace fastcycle::dds_gateway {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::Pair;

/// Files of a kernel that is made up.
class MadeUpKernel : public ::testing::Test {
 protected:
  MadeUpKernel() {
    std::string name = ::testing::TempDir() + "kernel_XXXXXX";
    root_ = ::mkdtemp(name.data());
    fs::create_directories(root_ / "proc/net");
    fs::create_directories(root_ / "proc/sys/net/core");
  }
  ~MadeUpKernel() override { fs::remove_all(root_); }

  void write(const char* file, const std::string& text) const {
    std::ofstream(root_ / file) << text;
  }

  fs::path root_;
};

TEST_F(MadeUpKernel, SaysWhichDomainsItsProgramsAreIn) {
  // 7400: everybody's port of the domain 0; 17910 and 17911: a participant of the domain 42;
  // 7910 alone: a program that has nothing to do with DDS.
  write("proc/net/udp",
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid\n"
        " 1224: 00000000:1CE8 00000000:0000 07 00000000:00000000 00:00000000 00000000     0\n"
        " 1225: 0100007F:45F6 00000000:0000 07 00000000:00000000 00:00000000 00000000     0\n"
        " 1226: 0100007F:45F7 00000000:0000 07 00000000:00000000 00:00000000 00000000     0\n"
        " 1227: 00000000:1EE6 00000000:0000 07 00000000:00000000 00:00000000 00000000     0\n"
        " what is this\n");

  EXPECT_THAT(domains_in_use(root_), ElementsAre(Pair(0, 1), Pair(42, 1)));
}

TEST_F(MadeUpKernel, SaysHowMuchASocketMayHaveWaiting) {
  EXPECT_EQ(receive_buffer_max(root_), std::nullopt);

  write("proc/sys/net/core/rmem_max", "212992\n");

  EXPECT_EQ(receive_buffer_max(root_), 212'992U);
}

TEST(Host, HasLoopback) {
  const auto all = local_interfaces();

  const auto lo = std::ranges::find(all, "lo", &LocalInterface::name);
  ASSERT_NE(lo, all.end());
  EXPECT_TRUE(lo->is_loopback);
  EXPECT_EQ(lo->address, "127.0.0.1");
}

}  // namespace
}  // namespace fastcycle::dds_gateway
