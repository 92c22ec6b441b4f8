#include "inspect/socket_file.h"

#include <filesystem>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "inspect/address.h"

namespace fastcycle::inspect {
namespace {

using testing::HasSubstr;

class ASocketFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("fastcycle_socket_" + std::to_string(::getpid()));
    std::filesystem::remove_all(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] static unsigned mode_of(const std::filesystem::path& file) {
    struct stat info{};
    EXPECT_EQ(::lstat(file.c_str(), &info), 0);
    return info.st_mode & 07777U;
  }
  [[nodiscard]] std::string refusal() const {
    try {
      SocketFile(folder_, "demo");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

TEST_F(ASocketFile, IsForItsUserAlone) {
  const SocketFile socket(folder_, "demo");
  EXPECT_EQ(mode_of(folder_), 0700U);
  EXPECT_EQ(mode_of(socket.file()), 0600U);
  EXPECT_EQ(socket.file(), folder_ / "demo.sock");
}

TEST_F(ASocketFile, IsRefusedInAFolderThatOthersMayEnter) {
  std::filesystem::create_directory(folder_);
  ::chmod(folder_.c_str(), 0755);
  EXPECT_THAT(refusal(), HasSubstr("must have the mode 0700, and has 0755"));
  ::chmod(folder_.c_str(), 0700);
  EXPECT_EQ(refusal(), "");
}

TEST_F(ASocketFile, IsRefusedBehindALink) {
  std::filesystem::create_directory(folder_.string() + "_real");
  ::chmod((folder_.string() + "_real").c_str(), 0700);
  std::filesystem::create_directory_symlink(folder_.string() + "_real", folder_);
  EXPECT_THAT(refusal(), HasSubstr("must be a folder"));
  std::filesystem::remove_all(folder_.string() + "_real");
}

TEST_F(ASocketFile, IsRefusedInAFolderOfSomebodyElse) {
  if (::geteuid() != 0) {
    GTEST_SKIP() << "only root can give a folder to somebody else";
  }
  std::filesystem::create_directory(folder_);
  ::chmod(folder_.c_str(), 0700);
  ASSERT_EQ(::chown(folder_.c_str(), 65534, 65534), 0);
  EXPECT_THAT(refusal(), HasSubstr("belongs to user 65534"));
}

TEST_F(ASocketFile, OfASecondApplicationHasANumber) {
  const SocketFile first(folder_, "demo");
  {
    const SocketFile second(folder_, "demo");
    EXPECT_EQ(second.name(), "demo-2");
    const auto found = find_sockets(folder_);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].name, "demo");
    EXPECT_EQ(found[1].name, "demo-2");
    EXPECT_EQ(found[1].pid, ::getpid());
  }
  EXPECT_EQ(find_sockets(folder_).size(), 1U);
}

TEST_F(ASocketFile, TakesThePlaceOfWhatACrashLeft) {
  std::filesystem::create_directory(folder_);
  ::chmod(folder_.c_str(), 0700);
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  const sockaddr_un address = address_of(folder_ / "demo.sock");
  ASSERT_EQ(::bind(left, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ::close(left);  // The file stays.
  EXPECT_TRUE(find_sockets(folder_).empty());
  const SocketFile socket(folder_, "demo");
  EXPECT_EQ(socket.name(), "demo");
  EXPECT_EQ(find_sockets(folder_).size(), 1U);
}

TEST_F(ASocketFile, HasANameThatIsOne) {
  const SocketFile socket(folder_, "a/b c");
  EXPECT_EQ(socket.name(), "a_b_c");
  EXPECT_THROW(SocketFile(folder_, std::string(120, 'x')), std::runtime_error);
}

}  // namespace
}  // namespace fastcycle::inspect
