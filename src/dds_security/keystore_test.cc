#include "dds_security/keystore.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dds_security/enclave.h"

namespace fastcycle::dds_security {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::ThrowsMessage;

constexpr Days kDays(100);

class Keystore : public ::testing::Test {
 protected:
  Keystore() {
    std::string name = ::testing::TempDir() + "keystore_XXXXXX";
    folder_ = ::mkdtemp(name.data());
    keystore_ = folder_ / "keys";
  }
  ~Keystore() override { fs::remove_all(folder_); }

  fs::path add(const std::string& name) {
    return add_enclave(
        keystore_, name,
        {.domain = 42, .publish = {"rt/speed"}, .subscribe = {"rt/speed", "rt/points"}}, kDays);
  }
  static std::string read(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void write(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
  }
  static unsigned mode_of(const fs::path& path) {
    struct stat state{};
    EXPECT_EQ(::stat(path.c_str(), &state), 0) << path;
    return state.st_mode & 0777U;
  }

  fs::path folder_;
  fs::path keystore_;
};

TEST_F(Keystore, AnEnclaveOfItIsRight) {
  make_keystore(keystore_, kDays);

  const fs::path enclave = add("/fleet/gateway");

  EXPECT_EQ(enclave, keystore_ / "enclaves/fleet/gateway");
  EXPECT_THAT(enclave_errors(enclave), IsEmpty());
  EXPECT_EQ(name_of_enclave(enclave), "/fleet/gateway");
}

TEST_F(Keystore, HasThePlacesAndNamesThatRos2Has) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");

  for (const char* const name : {"public/identity_ca.cert.pem", "public/permissions_ca.cert.pem",
                                 "private/identity_ca.key.pem", "private/permissions_ca.key.pem",
                                 "enclaves/governance.xml", "enclaves/governance.p7s"}) {
    EXPECT_TRUE(fs::exists(keystore_ / name)) << name;
  }
  for (const char* const name :
       {"identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem", "governance.p7s",
        "permissions.xml", "permissions.p7s"}) {
    EXPECT_TRUE(fs::exists(enclave / name)) << name;
  }
}

TEST_F(Keystore, PrivateKeysAreForTheirOwnerAlone) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");

  EXPECT_EQ(mode_of(keystore_ / "private"), 0700U);
  EXPECT_EQ(mode_of(keystore_ / "private/ca.key.pem"), 0600U);
  EXPECT_EQ(mode_of(enclave / "key.pem"), 0600U);
  EXPECT_FALSE(has_open_key(enclave));
  fs::permissions(enclave / "key.pem", fs::perms::others_read, fs::perm_options::add);
  EXPECT_TRUE(has_open_key(enclave));
}

TEST_F(Keystore, PermissionsNameTheTopicsInTheirDirectionAndDenyAllElse) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");

  const std::string text = read(enclave / "permissions.xml");
  EXPECT_THAT(text, HasSubstr("<subject_name>CN=/gateway</subject_name>"));
  EXPECT_THAT(text, HasSubstr("<id>42</id>"));
  EXPECT_THAT(text, HasSubstr("<default>DENY</default>"));
  const auto subscribe = text.find("<subscribe>");
  EXPECT_THAT(text.substr(0, subscribe),
              AllOf(HasSubstr("<topic>rt/speed</topic>"), Not(HasSubstr("rt/points"))));
  EXPECT_THAT(text.substr(subscribe),
              AllOf(HasSubstr("<topic>rt/speed</topic>"), HasSubstr("<topic>rt/points</topic>")));
}

TEST_F(Keystore, WhatIsThereIsNeverOverwritten) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");
  const std::string authority = read(keystore_ / "private/ca.key.pem");
  const std::string key = read(enclave / "key.pem");

  EXPECT_THAT([&] { make_keystore(keystore_, kDays); },
              ThrowsMessage<std::runtime_error>(HasSubstr("keys: it is there already")));
  EXPECT_THAT([&] { add("/gateway"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("gateway: it is there already")));

  EXPECT_EQ(read(keystore_ / "private/ca.key.pem"), authority);
  EXPECT_EQ(read(enclave / "key.pem"), key);
}

TEST_F(Keystore, WithoutOneThereIsNoEnclave) {
  EXPECT_THAT([&] { add("/gateway"); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("keys/public/identity_ca.cert.pem"),
                                                      HasSubstr("security init"))));
  EXPECT_FALSE(fs::exists(keystore_));
}

TEST_F(Keystore, FilesThatAreMissingOrNothingOfTheKindAreReported) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");
  fs::remove(enclave / "permissions.p7s");
  write(enclave / "identity_ca.cert.pem", "nonsense");

  EXPECT_THAT(enclave_errors(enclave),
              ElementsAre(AllOf(HasSubstr("identity_ca.cert.pem: expected the certificate of an "
                                          "authority in PEM, found no certificate")),
                          AllOf(HasSubstr("permissions.p7s"), HasSubstr("found no such file"))));
}

TEST_F(Keystore, TheKeyOfAnotherIsReported) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");
  write(enclave / "key.pem", read(add("/other") / "key.pem"));

  EXPECT_THAT(enclave_errors(enclave),
              ElementsAre(HasSubstr("key.pem: expected the private key of the certificate in "
                                    "cert.pem, found another one")));
}

TEST_F(Keystore, ACertificateOfAnotherAuthorityIsReported) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");
  const fs::path strange = folder_ / "strange";
  make_keystore(strange, kDays);
  write(enclave / "identity_ca.cert.pem", read(strange / "public/ca.cert.pem"));

  EXPECT_THAT(enclave_errors(enclave),
              ElementsAre(AllOf(
                  HasSubstr("cert.pem: expected a certificate that is signed by the authority in "
                            "identity_ca.cert.pem, found that of CN=/gateway: "))));
}

TEST_F(Keystore, ACertificateThatHasExpiredIsReported) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add_enclave(keystore_, "/old", {}, Days(-1));

  const auto errors = enclave_errors(enclave);

  ASSERT_FALSE(errors.empty());
  EXPECT_THAT(errors.front(), AllOf(HasSubstr("cert.pem: expected a certificate that is valid "
                                              "now, found one that has expired on ")));
}

TEST_F(Keystore, PermissionsThatWereChangedOrAreOfAnotherAreReported) {
  make_keystore(keystore_, kDays);
  const fs::path enclave = add("/gateway");
  std::string text = read(enclave / "permissions.p7s");
  text.replace(text.find("rt/speed"), 8, "rt/brake");
  write(enclave / "permissions.p7s", text);

  EXPECT_THAT(enclave_errors(enclave),
              ElementsAre(AllOf(HasSubstr("permissions.p7s: expected a document that is signed"),
                                HasSubstr("found one that was changed"))));

  write(enclave / "permissions.p7s", read(add("/other") / "permissions.p7s"));
  EXPECT_THAT(enclave_errors(enclave),
              ElementsAre(HasSubstr("permissions.p7s: expected permissions of CN=/gateway, found "
                                    "those of others")));
}

TEST_F(Keystore, AKeystoreInThePlaceOfAnEnclaveIsReported) {
  make_keystore(keystore_, kDays);

  EXPECT_THAT(enclave_errors(keystore_),
              ElementsAre(HasSubstr("expected the folder of one enclave, found a keystore")));
  EXPECT_THAT(enclave_errors(folder_ / "nowhere"),
              ElementsAre(HasSubstr("expected the folder of an enclave, found nothing")));
}

TEST_F(Keystore, NoCertificateOutlivesItsAuthority) {
  make_keystore(keystore_, Days(10));
  const fs::path enclave = add("/gateway");

  EXPECT_EQ(end_of(read(enclave / "cert.pem")), end_of(read(keystore_ / "public/ca.cert.pem")));
}

}  // namespace
}  // namespace fastcycle::dds_security
