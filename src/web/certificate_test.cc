#include "web/certificate.h"

#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::web {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

TEST(ACertificate, IsAnotherOneEachTime) {
  const Certificate one = make_certificate({"192.0.2.1", "vehicle.example", "::1"});
  const Certificate other = make_certificate({});
  EXPECT_THAT(one.chain, HasSubstr("BEGIN CERTIFICATE"));
  EXPECT_THAT(one.key, HasSubstr("PRIVATE KEY"));
  EXPECT_THAT(fingerprint_of(one.chain), MatchesRegex("([0-9A-F][0-9A-F]:)+[0-9A-F][0-9A-F]"));
  EXPECT_EQ(fingerprint_of(one.chain).size(), 32 * 3 - 1);
  EXPECT_NE(fingerprint_of(one.chain), fingerprint_of(other.chain));
  EXPECT_NE(one.key, other.key);
}

TEST(AFingerprint, IsOfACertificateOnly) {
  EXPECT_THROW(static_cast<void>(fingerprint_of("")), std::runtime_error);
  EXPECT_THROW(static_cast<void>(fingerprint_of(make_certificate({}).key)), std::runtime_error);
}

}  // namespace
}  // namespace fastcycle::web
