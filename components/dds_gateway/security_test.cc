// Who may take part: one with a certificate, and who has none, another authority's, or no
// permission.
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "basic/basic.pb.h"
#include "dds_gateway/gateway.h"
#include "dds_gateway/test_network.h"
#include "dds_security/keystore.h"

namespace fastcycle::dds_gateway {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr const char* kStringThere = "std_msgs::msg::dds_::String_";
constexpr const char* kSecret = "the-secret-that-nobody-else-may-read";
constexpr int kEnough = 50;

/// Receives all that goes over loopback, on a thread of its own.
class Eavesdropper {
 public:
  Eavesdropper() : socket_(::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETH_P_ALL))) {
    sockaddr_ll place{};
    place.sll_family = AF_PACKET;
    place.sll_protocol = htons(ETH_P_ALL);
    place.sll_ifindex = static_cast<int>(if_nametoindex("lo"));
    if (socket_ < 0 || bind(socket_, reinterpret_cast<sockaddr*>(&place), sizeof place) != 0) {
      return;
    }
    const int bytes = 64 << 20;
    (void)setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes);
    const timeval patience{.tv_sec = 0, .tv_usec = 50'000};
    (void)setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    thread_ = std::jthread([this](const std::stop_token& stop) { listen(stop); });
  }
  Eavesdropper(const Eavesdropper&) = delete;
  Eavesdropper& operator=(const Eavesdropper&) = delete;
  ~Eavesdropper() {
    end();
    close(socket_);
  }

  [[nodiscard]] bool can_receive() const { return thread_.joinable(); }
  /// After this the numbers stay.
  void end() {
    if (thread_.joinable()) {
      thread_.request_stop();
      thread_.join();
      tpacket_stats statistics{};
      socklen_t size = sizeof statistics;
      (void)getsockopt(socket_, SOL_PACKET, PACKET_STATISTICS, &statistics, &size);
      missed = statistics.tp_drops;
    }
  }

  int packets = 0;
  unsigned missed = 0;
  int with_secret = 0;
  int with_topic = 0;  // But for the permissions.

 private:
  /// Whether it names the topic, but for the permissions: while they get to know each other,
  /// participants send these as they are, in several packets where they are long.
  static bool names_topic(std::string_view text) {
    constexpr std::string_view kInPermissions = "<topic>";
    for (auto place = text.find("rt/to_peer"); place != std::string_view::npos;
         place = text.find("rt/to_peer", place + 1)) {
      if (!text.substr(0, place).ends_with(kInPermissions)) {
        return true;
      }
    }
    return false;
  }

  /// To the last packet that is there.
  void listen(const std::stop_token& stop) {
    std::vector<char> packet(1 << 16);
    while (true) {
      const ssize_t count = recv(socket_, packet.data(), packet.size(), 0);
      if (count <= 0) {
        if (stop.stop_requested()) {
          return;
        }
        continue;
      }
      ++packets;
      const std::string_view text(packet.data(), static_cast<std::size_t>(count));
      with_secret += text.find(kSecret) == std::string_view::npos ? 0 : 1;
      with_topic += names_topic(text) ? 1 : 0;
    }
  }

  int socket_;
  std::jthread thread_;
};

/// A gateway that sends on /to_peer and gets on /from_peer and /from_stranger, with a certificate;
/// by each engine.
class SecuredGateway : public ::testing::TestWithParam<const char*> {
 protected:
  SecuredGateway() {
    std::string name = ::testing::TempDir() + "secured_XXXXXX";
    folder_ = ::mkdtemp(name.data());
    keystore_ = folder_ / "keys";
    dds_security::make_keystore(keystore_, days_);
    gateway_ = enclave("/gateway", {"rt/to_peer"}, {"rt/from_peer", "rt/from_stranger"});
    peer_ = enclave("/peer", {"rt/from_peer"}, {"rt/to_peer"});
  }
  ~SecuredGateway() override { fs::remove_all(folder_); }

  std::string enclave(const std::string& name, std::set<std::string> publish,
                      std::set<std::string> subscribe) {
    return enclave_of(keystore_, name, std::move(publish), std::move(subscribe));
  }
  std::string enclave_of(const fs::path& keystore, const std::string& name,
                         std::set<std::string> publish, std::set<std::string> subscribe) const {
    publish.insert("ros_discovery_info");
    subscribe.insert("ros_discovery_info");
    return dds_security::add_enclave(keystore, name,
                                     {.domain = domain_of_test(),
                                      .publish = std::move(publish),
                                      .subscribe = std::move(subscribe)},
                                     days_);
  }

  static std::vector<std::string> echo(const std::string& security, const std::string& out) {
    std::vector<std::string> args = {"echo",       "rt/to_peer", out,
                                     kStringThere, "reliable",   "volatile"};
    if (!security.empty()) {
      args.insert(args.begin(), {"secured", security});
    }
    return args;
  }

  void add_gateway(const std::string& security, const std::string& more = "") {
    const auto topic = [](const char* name, const char* direction) {
      return fmt::format(
          R"({{"topic": "{0}", "direction": "{1}", "ros": "/{0}", "type": "std_msgs/msg/String",
               "depth": 1000}})",
          name, direction);
    };
    bench_.add<Gateway>(
        "gateway", fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo",
                                     "security": "{}", "topics": [{}, {}, {}{}]}}}})",
                               GetParam(), domain_of_test(), security, topic("to_peer", "out"),
                               topic("from_peer", "in"), topic("from_stranger", "in"), more));
  }

  /// Sends the secret until it has come back from the peer often enough, and from the stranger,
  /// where one is expected.
  void exchange(bool is_stranger_expected = false) {
    auto out = bench_.input<basic::Text>("to_peer");
    auto in = bench_.output<basic::Text>("from_peer");
    auto strange = bench_.output<basic::Text>("from_stranger");
    basic::Text text;
    text.set_data(kSecret);
    bench_.start();
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (back_ < kEnough || (is_stranger_expected && from_stranger_ == 0)) {
      ASSERT_LT(std::chrono::steady_clock::now(), end)
          << back_ << " came back, " << from_stranger_ << " from the stranger";
      out.publish(text);
      bench_.advance(10ms);
      std::this_thread::sleep_for(2ms);
      for (const basic::Text& one : in.take()) {
        EXPECT_EQ(one.data(), kSecret);
        ++back_;
      }
      from_stranger_ += strange.take().size();
    }
  }

  const dds_security::Days days_{10};
  fs::path folder_;
  fs::path keystore_;
  std::string gateway_;
  std::string peer_;
  testing::Bench bench_;
  int back_ = 0;
  std::size_t from_stranger_ = 0;
};

TEST_P(SecuredGateway, ExchangesMessagesWithAPeerThatHasACertificate) {
  Peer peer(GetParam(), echo(peer_, "rt/from_peer"));
  add_gateway(gateway_);

  exchange();

  EXPECT_THAT(peer.end(), HasSubstr("1 writers and 1 readers found"));
}

// Two gateways of one application: what one asks, the other answers, by DDS.
TEST_P(SecuredGateway, AsksAndAnswersServices) {
  const std::set<std::string> both = {"rq/set_boolRequest", "rr/set_boolReply"};
  const std::string security = enclave("/both", both, both);
  const auto add = [&](const char* name, const char* service, const char* direction) {
    bench_.add<Gateway>(
        name, fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo",
            "security": "{}", "node": "{}", "services": [{{"service": "{}", "direction": "{}",
            "ros": "/set_bool", "type": "std_srvs/srv/SetBool"}}]}}}})",
                          GetParam(), domain_of_test(), security, name, service, direction));
  };
  add("server", "set", "in");
  add("client", "set_there", "out");
  bench_.service<basic::Flag, basic::Outcome>(
      "set",
      [](const basic::Flag& flag, basic::Outcome& outcome) { outcome.set_success(flag.data()); });
  auto asks = bench_.client<basic::Flag, basic::Outcome>("set_there");
  bench_.start();
  basic::Flag flag;
  flag.set_data(true);
  int answered = 0;

  const auto end = std::chrono::steady_clock::now() + 60s;
  while (answered < 10 && std::chrono::steady_clock::now() < end) {
    // The first replies may go before the server knows who reads them.
    const auto answer = asks.call(flag, {.deadline = 200ms});
    while (!answer.is_done() && std::chrono::steady_clock::now() < end) {
      bench_.advance(1ms);
      std::this_thread::sleep_for(1ms);
    }
    if (answer.ok()) {
      EXPECT_TRUE(answer->success());
      ++answered;
    }
    bench_.advance(1ms);
    std::this_thread::sleep_for(1ms);
  }
  bench_.stop();

  EXPECT_EQ(answered, 10);
}

TEST_P(SecuredGateway, IsNotFoundByAPeerWithoutACertificateThatGetsNothing) {
  Peer stranger(GetParam(), echo("", "rt/from_stranger"));
  const Peer peer(GetParam(), echo(peer_, "rt/from_peer"));
  add_gateway(gateway_);

  exchange();

  EXPECT_EQ(stranger.end(), "0 came, 0 lost, 0 writers and 0 readers found\n");
  EXPECT_EQ(from_stranger_, 0U);
}

TEST_P(SecuredGateway, IsNotFoundByAPeerOfAnotherAuthorityThatGetsNothing) {
  const fs::path strange = folder_ / "strange";
  dds_security::make_keystore(strange, days_);
  const std::string forged = enclave_of(strange, "/peer", {"rt/from_stranger"}, {"rt/to_peer"});
  Peer stranger(GetParam(), echo(forged, "rt/from_stranger"));
  const Peer peer(GetParam(), echo(peer_, "rt/from_peer"));
  add_gateway(gateway_);

  exchange();

  EXPECT_EQ(stranger.end(), "0 came, 0 lost, 0 writers and 0 readers found\n");
  EXPECT_EQ(from_stranger_, 0U);
}

// What the two tests before could not show if nothing reached a stranger anyway.
TEST_P(SecuredGateway, IsFoundByAnybodyWithoutSecurity) {
  Peer stranger(GetParam(), echo("", "rt/from_stranger"));
  const Peer peer(GetParam(), echo("", "rt/from_peer"));
  add_gateway("");

  exchange(true);

  EXPECT_THAT(stranger.end(), HasSubstr("1 writers and 1 readers found"));
  EXPECT_GT(from_stranger_, 0U);
}

TEST_P(SecuredGateway, IsReadByNobodyOnTheWay) {
  Eavesdropper eavesdropper;
  if (!eavesdropper.can_receive()) {
    GTEST_SKIP() << "needs a network of its own";
  }
  const Peer peer(GetParam(), echo(peer_, "rt/from_peer"));
  add_gateway(gateway_);

  exchange();
  eavesdropper.end();

  EXPECT_GT(eavesdropper.packets, kEnough);
  EXPECT_EQ(eavesdropper.missed, 0U);
  EXPECT_EQ(eavesdropper.with_secret, 0);
  EXPECT_EQ(eavesdropper.with_topic, 0);
}

TEST_P(SecuredGateway, IsReadOnTheWayWithoutSecurity) {
  Eavesdropper eavesdropper;
  if (!eavesdropper.can_receive()) {
    GTEST_SKIP() << "needs a network of its own";
  }
  const Peer peer(GetParam(), echo("", "rt/from_peer"));
  add_gateway("");

  exchange();
  eavesdropper.end();

  EXPECT_GE(eavesdropper.with_secret, kEnough);
  EXPECT_GT(eavesdropper.with_topic, 0);
}

TEST_P(SecuredGateway, IsRefusedATopicThatItsPermissionsDoNotName) {
  const auto all = engines();
  const auto engine = std::ranges::find_if(
      all, [](const Engine& one) { return std::string_view(one.name) == GetParam(); });
  const auto participant = engine->create({.domain = domain_of_test(),
                                           .interface = "lo",
                                           .user_data = "enclave=/gateway;",
                                           .security = gateway_});
  Endpoint endpoint{.topic = "rt/brake", .type = kStringThere, .user_data = {}, .qos = {}};

  EXPECT_THAT([&] { (void)participant->create_writer(endpoint); },
              ThrowsMessage<EngineError>(
                  AllOf(HasSubstr("rt/brake: security refuses to write it"),
                        HasSubstr("expected <topic>rt/brake</topic> under <publish>"))));
  endpoint.is_reader = true;
  EXPECT_THAT([&] { (void)participant->create_reader(endpoint, nullptr); },
              ThrowsMessage<EngineError>(
                  AllOf(HasSubstr("rt/brake: security refuses to read it"),
                        HasSubstr("expected <topic>rt/brake</topic> under <subscribe>"))));
  endpoint.topic = "rt/to_peer";
  endpoint.is_reader = false;
  EXPECT_NO_THROW((void)participant->create_writer(endpoint));
}

TEST_P(SecuredGateway, RefusesAnEnclaveThatIsWrongBeforeItStarts) {
  fs::remove(fs::path(gateway_) / "key.pem");
  add_gateway(gateway_);

  EXPECT_THAT([&] { bench_.start(); },
              ThrowsMessage<std::exception>(
                  AllOf(HasSubstr("/params/security: "),
                        HasSubstr("key.pem: expected a private key in PEM, found no such file"))));
}

/// What `ros2 security create_keystore` and `create_enclave` make of their arguments, with openssl:
/// one authority with the links that it has, a governance, and enclaves that may do everything
/// under rt/, rq/ and rr/. $1 is the folder, $2 the domain, the others are the enclaves.
constexpr const char* kKeystoreOfRos = R"sh(
set -e
keys=$1 domain=$2
shift 2
mkdir -p "$keys/public" "$keys/private" "$keys/enclaves"
cd "$keys"
curve='-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes'
openssl req -x509 $curve -keyout private/ca.key.pem -out public/ca.cert.pem -days 3650 -sha256 \
  -subj /CN=sros2CA -addext basicConstraints=critical,CA:true,pathlen:1 2>openssl.txt
for part in identity permissions; do
  ln -s ca.cert.pem public/${part}_ca.cert.pem
  ln -s ca.key.pem private/${part}_ca.key.pem
done
sign() {
  openssl smime -sign -text -in "$1.xml" -out "$1.p7s" -signer public/permissions_ca.cert.pem \
    -inkey private/permissions_ca.key.pem
}
head='<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation'
cat >enclaves/governance.xml <<END
$head="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id>$domain</id></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
END
sign enclaves/governance
topics() {
  for verb in publish subscribe; do
    echo "<$verb><topics>"
    for topic in "$@"; do echo "<topic>$topic</topic>"; done
    echo "</topics></$verb>"
  done
}
for name in "$@"; do
  here=enclaves/$name
  mkdir "$here"
  ln -s ../../public/identity_ca.cert.pem "$here/identity_ca.cert.pem"
  ln -s ../../public/permissions_ca.cert.pem "$here/permissions_ca.cert.pem"
  ln -s ../governance.p7s "$here/governance.p7s"
  openssl req $curve -keyout "$here/key.pem" -out request.pem -subj "/CN=\/$name" 2>openssl.txt
  echo basicConstraints=CA:false >extensions.txt
  openssl x509 -req -in request.pem -CA public/ca.cert.pem -CAkey private/ca.key.pem -CAcreateserial \
    -out "$here/cert.pem" -days 3650 -sha256 -extfile extensions.txt 2>openssl.txt
  rule="<allow_rule><domains><id>$domain</id></domains>"
  cat >"$here/permissions.xml" <<END
$head="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="/$name">
      <subject_name>CN=/$name</subject_name>
      <validity><not_before>2020-05-01T00:00:00</not_before><not_after>2040-05-01T00:00:00</not_after></validity>
      $rule $(topics 'rt/*' 'rq/*Request' 'rr/*Reply')</allow_rule>
      $rule $(topics ros_discovery_info)</allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
END
  sign "$here/permissions"
done
)sh";

TEST_P(SecuredGateway, TakesAnEnclaveAsRos2SecurityMakesIt) {
  if (std::system("openssl version >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "needs the program openssl";
  }
  const fs::path script = folder_ / "keystore_of_ros.sh";
  std::ofstream(script) << kKeystoreOfRos;
  const fs::path keys = folder_ / "keys_of_ros";
  ASSERT_EQ(std::system(fmt::format("sh '{}' '{}' {} gateway talker", script.string(),
                                    keys.string(), domain_of_test())
                            .c_str()),
            0);
  Peer peer(GetParam(), echo(keys / "enclaves/talker", "rt/from_peer"));
  const std::string other = enclave("/other", {"rt/from_stranger"}, {"rt/to_peer"});
  Peer stranger(GetParam(), echo(other, "rt/from_stranger"));
  add_gateway(keys / "enclaves/gateway");

  exchange();

  EXPECT_THAT(peer.end(), HasSubstr("1 writers and 1 readers found"));
  EXPECT_EQ(stranger.end(), "0 came, 0 lost, 0 writers and 0 readers found\n");
}

#ifdef FASTCYCLE_HAS_CYCLONE
// Cyclone DDS gave the second one the permissions of the first.
TEST_P(SecuredGateway, IsTheOnlySecurityThatItsProcessHasInADomainOfCyclone) {
  if (std::string_view(GetParam()) != "cyclone") {
    GTEST_SKIP() << "Fast DDS distinguishes them";
  }
  ParticipantOptions options{
      .domain = domain_of_test(), .interface = "lo", .user_data = {}, .security = gateway_};
  const auto create = engines().front().create;
  const auto first = create(options);

  for (const std::string& other : {peer_, std::string()}) {
    options.security = other;
    EXPECT_THAT([&] { (void)create(options); },
                ThrowsMessage<EngineError>(
                    HasSubstr("expected the security that this process has there already, \"")));
  }
  options.security = gateway_;
  EXPECT_NO_THROW((void)create(options));
}
#endif

INSTANTIATE_TEST_SUITE_P(Engines, SecuredGateway, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
}  // namespace fastcycle::dds_gateway
