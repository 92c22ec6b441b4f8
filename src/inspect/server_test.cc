#include "inspect/server.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "inspect/address.h"
#include "inspect/client.h"
#include "inspect/frame.h"

namespace fastcycle::inspect {
namespace {

using namespace std::chrono_literals;
using google::protobuf::BytesValue;
using google::protobuf::Int64Value;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr std::size_t kLarge = 100'000;

/// Publishes a number and a large message each millisecond.
class Source final : public Component {
 public:
  explicit Source(Context& context)
      : Component(context),
        numbers_(context.create_publisher<Int64Value>("numbers")),
        blobs_(context.create_publisher<BytesValue>("blobs")) {}

  void serve() override {
    auto number = numbers_.loan();
    number->set_value(++count_);
    numbers_.publish(std::move(number));
    auto blob = blobs_.loan();
    blob->mutable_value()->assign(kLarge, 'x');
    blobs_.publish(std::move(blob));
  }

 private:
  Publisher<Int64Value> numbers_;
  Publisher<BytesValue> blobs_;
  std::int64_t count_ = 0;
};

class Reader final : public Component {
 public:
  explicit Reader(Context& context)
      : Component(context),
        factor_(context.param<double>(
            "factor", {.fallback = 1.0, .min = 0.0, .max = 9.0, .is_tunable = true})) {
    context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) {});
  }

 private:
  Param<double> factor_;
};

constexpr const char* kApplication = R"({"name": "looked_at", "components": [
  {"name": "source", "library": "source", "serve_period_ms": 1},
  {"name": "reader", "library": "reader"}]})";

/// An application that runs, in a folder of its own.
class Running {
 public:
  explicit Running(const config::InspectDescription& allowed = {})
      : folder_(
            std::filesystem::temp_directory_path() /
            ("fastcycle_inspect_" + std::to_string(::getpid()) + "_" + std::to_string(++runs_))) {
    std::filesystem::remove_all(folder_);
    classes_.with<Source>("source").with<Reader>("reader");
    config::Problems problems;
    application = std::make_unique<host::Application>(host::describe_text(kApplication, problems),
                                                      host::ClockOptions{});
    server.emplace(*application, allowed, folder_);
    server->offer("greeting", [] { return std::string(R"({"hello": "world"})"); });
    application->add(*server);
    application->build(classes_, problems, host::ConstructorFault::kFault);
    for (const config::Problem& problem : problems.all()) {
      if (!problem.warning) {
        throw std::runtime_error(config::to_string(problem));
      }
    }
    application->start();
  }
  ~Running() {
    stop();
    std::filesystem::remove_all(folder_);
  }
  void stop() {
    application.reset();
    server.reset();
  }

  [[nodiscard]] std::filesystem::path socket() const { return server->file(); }

 private:
  static inline int runs_ = 0;
  std::filesystem::path folder_;
  host::TestClasses classes_;

 public:
  std::optional<Server> server;
  std::unique_ptr<host::Application> application;
};

constexpr auto kBound = 60s;  // For what must happen: the machine may be busy.

/// Waits for an answer of a stream that `is_meant`.
protocol::Answer await(Client& client,
                       const std::function<bool(const protocol::Answer&)>& is_meant) {
  const auto end = std::chrono::steady_clock::now() + kBound;
  while (std::chrono::steady_clock::now() < end) {
    if (auto answer = client.next(100ms); answer && is_meant(*answer)) {
      return *answer;
    }
  }
  throw std::runtime_error("what was awaited did not come");
}

protocol::Request overview_request() {
  protocol::Request request;
  request.mutable_overview();
  return request;
}

protocol::Request stream_request(const std::string& topic, protocol::Stream::Content content =
                                                               protocol::Stream::CONTENT_ELIDED) {
  protocol::Request request;
  request.mutable_stream()->set_topic(topic);
  request.mutable_stream()->set_content(content);
  return request;
}

ClientError error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const ClientError& error) {
    return error;
  }
  throw std::runtime_error("nothing was refused");
}

bool has_messages(const protocol::Answer& answer) {
  return answer.has_messages() && !answer.messages().messages().empty();
}

/// A connection that says what it likes.
class Stranger {
 public:
  explicit Stranger(const std::filesystem::path& socket)
      : descriptor_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const sockaddr_un address = address_of(socket);
    if (::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      throw std::runtime_error("nobody listens");
    }
  }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;
  ~Stranger() { ::close(descriptor_); }

  void say(const std::string& bytes) const {
    static_cast<void>(!::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
  }
  /// All that is said until the other one closes.
  [[nodiscard]] std::string hear() const {
    std::string heard;
    std::string piece(4096, '\0');
    for (;;) {
      const ssize_t count = ::recv(descriptor_, piece.data(), piece.size(), 0);
      if (count <= 0) {
        return heard;
      }
      heard.append(piece, 0, static_cast<std::size_t>(count));
    }
  }

 private:
  int descriptor_;
};

std::string frame_of(const protocol::Request& request) {
  std::string bytes;
  append_size(bytes, request.ByteSizeLong());
  return bytes + request.SerializeAsString();
}

TEST(AServer, SaysWhatRuns) {
  Running run;
  Client client(run.socket(), "test");
  EXPECT_EQ(client.welcome().application(), "looked_at");
  EXPECT_EQ(client.welcome().pid(), ::getpid());
  EXPECT_TRUE(client.welcome().allow().empty());
  const protocol::Overview overview = client.ask(overview_request()).overview();
  ASSERT_EQ(overview.components().size(), 2);
  EXPECT_EQ(overview.components(0).name(), "source");
  EXPECT_EQ(overview.components(0).state(), "active");
  EXPECT_EQ(overview.components(0).health(), "ok");
  EXPECT_EQ(overview.clock(), "live");
  ASSERT_EQ(overview.topics().size(), 2);
  EXPECT_EQ(overview.topics(1).name(), "numbers");
  EXPECT_EQ(overview.topics(1).type(), "google.protobuf.Int64Value");
  ASSERT_EQ(overview.topics(1).subscribers().size(), 1);
  const protocol::Ledger& ledger = overview.topics(1).subscribers(0).ledger();
  EXPECT_EQ(ledger.published(), ledger.delivered() + ledger.dropped() + ledger.queued());
}

TEST(AServer, StreamsATopicFromItsPublisher) {
  Running run;
  Client client(run.socket(), "test");
  const protocol::Answer started = client.begin(stream_request("numbers"));
  ASSERT_EQ(started.started().channels().size(), 1);
  EXPECT_EQ(started.started().channels(0).component(), "source");
  const protocol::Answer first = await(client, has_messages);
  Int64Value number;
  const protocol::Message& message = first.messages().messages(0);
  ASSERT_TRUE(number.ParseFromString(message.payload()));
  EXPECT_EQ(static_cast<std::uint64_t>(number.value()), message.sequence());
  client.end(started.id());
  EXPECT_EQ(await(client, [](const auto& answer) { return answer.has_ended(); }).ended().why(),
            "requested");
}

TEST(AServer, CutsWhatIsLongUnlessAllIsAskedFor) {
  Running run;
  Client client(run.socket(), "test");
  const protocol::Answer cut = client.begin(stream_request("blobs"));
  const protocol::Message shown = await(client, has_messages).messages().messages(0);
  EXPECT_LT(shown.payload().size(), 100U);
  ASSERT_EQ(shown.elisions().size(), 1);
  EXPECT_EQ(shown.elisions(0).name(), "value");
  EXPECT_EQ(shown.elisions(0).size(), kLarge);
  client.end(cut.id());
  await(client, [](const auto& answer) { return answer.has_ended(); });

  client.begin(stream_request("blobs", protocol::Stream::CONTENT_FULL));
  const protocol::Message full = await(client, has_messages).messages().messages(0);
  BytesValue blob;
  ASSERT_TRUE(blob.ParseFromString(full.payload()));
  EXPECT_EQ(blob.value().size(), kLarge);
}

TEST(AServer, CountsWhatAStreamDoesNotHave) {
  Running run;
  Client client(run.socket(), "test");
  client.begin(stream_request("numbers", protocol::Stream::CONTENT_INFO));
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  std::uint64_t seen = 0;
  std::uint64_t lost = 0;
  while (seen < 50) {
    const protocol::Answer answer =
        await(client, [](const auto& its) { return its.has_messages(); });
    lost += answer.messages().lost();
    for (const protocol::Message& message : answer.messages().messages()) {
      first = first == 0 ? message.sequence() : first;
      last = message.sequence();
      ++seen;
    }
  }
  EXPECT_EQ(last - first + 1, seen + lost);
}

TEST(AServer, SendsASchemaThatDecodesATopic) {
  Running run;
  Client client(run.socket(), "test");
  protocol::Request request;
  request.mutable_topic()->set_topic("numbers");
  const protocol::Topic topic = client.ask(std::move(request)).topic();
  EXPECT_EQ(topic.type(), "google.protobuf.Int64Value");
  EXPECT_THAT(topic.schema(), HasSubstr("wrappers.proto"));
  protocol::Request unknown;
  unknown.mutable_topic()->set_topic("number");
  const ClientError error = error_of([&] { client.ask(std::move(unknown)); });
  EXPECT_EQ(error.kind(), protocol::Error::KIND_NOT_FOUND);
  EXPECT_THAT(error.hint(), HasSubstr("numbers"));
}

TEST(AServer, ChangesNothingUnlessThatIsAllowed) {
  Running run;
  Client client(run.socket(), "test");
  protocol::Request request;
  auto& change = *request.mutable_change_params()->add_changes();
  change.set_param("reader.factor");
  change.set_value_json("2");
  const ClientError error = error_of([&] { client.ask(std::move(request)); });
  EXPECT_EQ(error.kind(), protocol::Error::KIND_NOT_ALLOWED);
  EXPECT_EQ(error.error().allow(), "params");
}

TEST(AServer, ChangesParamsWhereThatIsAllowed) {
  config::InspectDescription allowed;
  allowed.allows_params = true;
  Running run(allowed);
  Client client(run.socket(), "test");
  const auto set = [&](const std::string& value) {
    protocol::Request request;
    auto& change = *request.mutable_change_params()->add_changes();
    change.set_param("reader.factor");
    change.set_value_json(value);
    return client.ask(std::move(request)).params_changed();
  };
  EXPECT_TRUE(set("2.5").mistakes().empty());
  EXPECT_THAT(set("10").mistakes(), Not(testing::IsEmpty()));
  protocol::Request request;
  request.mutable_params();
  const protocol::Params params = client.ask(std::move(request)).params();
  ASSERT_EQ(params.params().size(), 1);
  EXPECT_EQ(params.params(0).value_json(), "2.5");
}

TEST(AServer, GivesDocumentsOfOthersByName) {
  Running run;
  Client client(run.socket(), "test");
  EXPECT_THAT(client.welcome().documents(), ElementsAre("greeting"));
  protocol::Request request;
  request.mutable_document()->set_name("greeting");
  EXPECT_EQ(client.ask(std::move(request)).document().json(), R"({"hello": "world"})");
  protocol::Request graph;
  graph.mutable_graph();
  EXPECT_THAT(client.ask(std::move(graph)).graph().dot(), HasSubstr("digraph"));
}

TEST(AServer, StreamsTheLog) {
  Running run;
  Client client(run.socket(), "test");
  protocol::Request request;
  request.mutable_stream_log()->set_level("warning");
  client.begin(std::move(request));
  run.application->log(LogLevel::kInfo, "reader", "not this one");
  run.application->log(LogLevel::kError, "reader", "this one");
  for (;;) {
    const protocol::Answer answer = await(client, [](const auto& its) { return its.has_log(); });
    for (const protocol::LogLine& line : answer.log().lines()) {
      EXPECT_NE(line.text(), "not this one");
      if (line.text() == "this one") {
        EXPECT_EQ(line.level(), "error");
        return;
      }
    }
  }
}

TEST(AServer, TellsItsStreamsThatTheApplicationStops) {
  Running run;
  Client client(run.socket(), "test");
  client.begin(stream_request("numbers"));
  run.stop();
  const protocol::Answer last =
      await(client, [](const auto& answer) { return answer.has_ended(); });
  EXPECT_EQ(last.ended().why(), "the application stops");
  EXPECT_THROW(client.ask(overview_request()), ClientError);
}

TEST(AServer, LeavesNothingBehindWhenItsClientsHaveLeft) {
  Running run;
  for (int i = 0; i < 3; ++i) {
    Client client(run.socket(), "test");
    client.begin(stream_request("numbers"));
    client.begin(stream_request("blobs", protocol::Stream::CONTENT_FULL));
    await(client, has_messages);
  }
  run.application->stop();
  const detail::Ledger ledger = host::ledger_of(*run.application, "numbers", "reader");
  EXPECT_TRUE(ledger.adds_up());
}

TEST(AHostileClient, IsTurnedAwayIfItSaysNothingMeaningful) {
  Running run;
  for (const std::string& said :
       {std::string("\xff\xff\xff\xff what is this"), std::string("\x05\0\0\0hello", 9),
        std::string("\0\0\0\0", 4), frame_of(overview_request())}) {
    const Stranger stranger(run.socket());
    stranger.say(said);
    EXPECT_THAT(stranger.hear().size(), testing::Gt(0U));  // Why not; then it is closed.
  }
  Client client(run.socket(), "test");
  EXPECT_TRUE(client.ask(overview_request()).has_overview());
}

TEST(AHostileClient, OfAnotherVersionIsToldSo) {
  Running run;
  protocol::Request request;
  request.set_id(1);
  request.mutable_hello()->set_version(99);
  const Stranger stranger(run.socket());
  stranger.say(frame_of(request));
  EXPECT_THAT(stranger.hear(), HasSubstr("version 1"));
}

TEST(AHostileClient, IsOneOfNotTooMany) {
  Running run;
  std::vector<std::unique_ptr<Client>> clients;
  for (std::size_t i = 0; i < Server::kMaxConnections; ++i) {
    clients.push_back(std::make_unique<Client>(run.socket(), "test"));
  }
  const ClientError error = error_of([&] { Client(run.socket(), "one more"); });
  EXPECT_EQ(error.kind(), protocol::Error::KIND_TOO_MANY);
  clients.pop_back();
  const auto end = std::chrono::steady_clock::now() + kBound;
  for (;;) {  // Until the server has seen that one is gone.
    try {
      Client(run.socket(), "another");
      return;
    } catch (const ClientError&) {
      ASSERT_LT(std::chrono::steady_clock::now(), end);
      std::this_thread::sleep_for(1ms);
    }
  }
}

}  // namespace
}  // namespace fastcycle::inspect
