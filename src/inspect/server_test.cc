#include "inspect/server.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/prepare_replay.h"
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

/// Doubles numbers on request, and receives wishes that nobody publishes.
class Reader final : public Component {
 public:
  explicit Reader(Context& context)
      : Component(context),
        factor_(context.param<double>(
            "factor", {.fallback = 1.0, .min = 0.0, .max = 9.0, .is_tunable = true})),
        received_(context.create_publisher<Int64Value>("received")) {
    context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) {});
    context.create_subscriber<Int64Value>("wishes", [this](const Int64Value& wish) {
      auto received = received_.loan();
      received->set_value(wish.value());
      received_.publish(std::move(received));
    });
    context.create_service<Int64Value, Int64Value>(
        "double",
        [](const Int64Value& number, Int64Value& twice) { twice.set_value(2 * number.value()); });
  }

 private:
  Param<double> factor_;
  Publisher<Int64Value> received_;
};

constexpr const char* kApplication = R"({"name": "looked_at", "components": [
  {"name": "source", "library": "source", "serve_period_ms": 1},
  {"name": "reader", "library": "reader"}]})";

/// An application that runs, in a folder of its own.
class Running {
 public:
  explicit Running(const config::InspectDescription& allowed = {},
                   const host::ClockOptions& clock = {},
                   std::chrono::nanoseconds patience = Server::kPatience,
                   const std::filesystem::path& record = {},
                   const std::filesystem::path& recording = {})
      : folder_(
            std::filesystem::temp_directory_path() /
            ("fastcycle_inspect_" + std::to_string(::getpid()) + "_" + std::to_string(++runs_))) {
    std::filesystem::remove_all(folder_);
    classes_.with<Source>("source").with<Reader>("reader");
    config::Problems problems;
    config::ApplicationDescription description = host::describe_text(kApplication, problems);
    host::ComponentClasses* classes = &classes_;
    if (!recording.empty()) {
      replay_ = host::prepare_replay({.files = {recording}}, description, classes_, problems);
      if (replay_ == nullptr) {
        throw std::runtime_error(config::text_of(problems));
      }
      description = replay_->description();
      classes = replay_.get();
    }
    application = std::make_unique<host::Application>(std::move(description), clock);
    if (replay_ != nullptr) {
      application->replay(*replay_);
    }
    if (!record.empty()) {
      config::RecordDescription recorded;
      recorded.file = record;
      application->record(recorded);
    }
    server.emplace(*application, allowed, folder_, patience);
    server->offer("greeting", [] { return std::string(R"({"hello": "world"})"); });
    application->add(*server);
    application->build(*classes, problems, host::ConstructorFault::kFault);
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
  std::unique_ptr<host::Replay> replay_;

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
  /// At the other end of `descriptor`.
  explicit Stranger(int descriptor) : descriptor_(descriptor) {}
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;
  ~Stranger() { ::close(descriptor_); }

  void send(const std::string& bytes) const {
    static_cast<void>(!::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
  }
  /// Whether the other one closes before long; nothing is read until then.
  [[nodiscard]] bool is_closed() const {
    pollfd polled{.fd = descriptor_, .events = 0, .revents = 0};
    constexpr auto kLongest = std::chrono::milliseconds(kBound);
    return ::poll(&polled, 1, static_cast<int>(kLongest.count())) == 1 &&
           (polled.revents & POLLHUP) != 0;
  }
  /// All that is said until the other one closes.
  [[nodiscard]] std::string receive() const {
    std::string received;
    std::string piece(4096, '\0');
    for (;;) {
      const ssize_t count = ::recv(descriptor_, piece.data(), piece.size(), 0);
      if (count <= 0) {
        return received;
      }
      received.append(piece, 0, static_cast<std::size_t>(count));
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
  ASSERT_EQ(overview.components(0).callbacks().size(), 1);
  EXPECT_EQ(overview.components(0).callbacks(0).name(), "serve");
  EXPECT_EQ(overview.components(0).callbacks(0).kind(), "tick");
  std::map<std::string, std::string> kinds;
  for (const protocol::Callback& callback : overview.components(1).callbacks()) {
    kinds[callback.name()] = callback.kind();
  }
  EXPECT_EQ(kinds, (std::map<std::string, std::string>{
                       {"double", "request"}, {"numbers", "message"}, {"wishes", "message"}}));
  EXPECT_EQ(overview.clock(), "live");
  const auto numbers = std::ranges::find_if(
      overview.topics(), [](const auto& topic) { return topic.name() == "numbers"; });
  ASSERT_NE(numbers, overview.topics().end());
  EXPECT_EQ(numbers->type(), "google.protobuf.Int64Value");
  ASSERT_EQ(numbers->subscribers().size(), 1);
  const protocol::Ledger& ledger = numbers->subscribers(0).ledger();
  EXPECT_EQ(ledger.published(), ledger.delivered() + ledger.dropped() + ledger.queued());
  ASSERT_EQ(overview.services().size(), 1);
  EXPECT_EQ(overview.services(0).name(), "double");
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

TEST(AServer, LooksAtASimulatedRunBetweenItsRounds) {
  Running run({}, {.is_simulated = true});
  Client client(run.socket(), "test");
  client.begin(stream_request("numbers", protocol::Stream::CONTENT_INFO));
  const auto end = std::chrono::steady_clock::now() + kBound;
  for (int i = 1; std::chrono::steady_clock::now() < end; ++i) {
    run.application->advance_to(run.application->start_time() + i * 1ms);
    if (const auto answer = client.next(1ms); answer && has_messages(*answer)) {
      const protocol::Message& message = answer->messages().messages(0);
      EXPECT_EQ(message.publish_time_ns(),
                base::to_ns(run.application->start_time() + message.sequence() * 1ms));
      return;
    }
  }
  FAIL() << "nothing came";
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
  EXPECT_TRUE(set("2.5").errors().empty());
  EXPECT_THAT(set("10").errors(), Not(testing::IsEmpty()));
  protocol::Request request;
  request.mutable_params();
  const protocol::Params params = client.ask(std::move(request)).params();
  ASSERT_EQ(params.params().size(), 1);
  EXPECT_EQ(params.params(0).value_json(), "2.5");
}

std::string serialized(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message.SerializeAsString();
}

config::InspectDescription all_allowed() {
  config::InspectDescription allowed;
  allowed.allows_params = allowed.allows_publish = allowed.allows_lifecycle = true;
  return allowed;
}

TEST(AServer, PublishesWhereThatIsAllowed) {
  Running run(all_allowed());
  Client client(run.socket(), "test");
  client.begin(stream_request("received"));
  protocol::Request request;
  request.mutable_publish()->set_topic("wishes");
  request.mutable_publish()->set_message(serialized(7));
  EXPECT_TRUE(client.ask(request).has_done());
  const protocol::Answer received = await(client, has_messages);
  EXPECT_EQ(received.messages().messages(0).payload(), serialized(7));

  request.mutable_publish()->set_message("\xff\xff");
  EXPECT_EQ(error_of([&] { client.ask(request); }).kind(), protocol::Error::KIND_REFUSED);
  request.mutable_publish()->set_topic("fastcycle/status");
  EXPECT_THROW(client.ask(request), ClientError);
}

// Messages and calls of tools are in the recording, under the name that they would have now too.
TEST(AServer, PublishesBesideWhatToolsPublishedInARecording) {
  const config::TestFolder folder;
  const auto send = [](Client& client, std::int64_t value) {
    protocol::Request request;
    request.mutable_publish()->set_topic("numbers");
    request.mutable_publish()->set_message(serialized(value));
    EXPECT_TRUE(client.ask(request).has_done());
    protocol::Request call;
    call.mutable_call_service()->set_service("double");
    call.mutable_call_service()->set_request(serialized(value));
    call.mutable_call_service()->set_timeout_ms(60'000);
    EXPECT_EQ(client.ask(std::move(call), kBound).reply().reply(), serialized(2 * value));
  };
  {
    Running run(all_allowed(), {}, Server::kPatience, folder / "a.mcap");
    Client client(run.socket(), "test");
    send(client, 1'000'001);
    run.application->stop();
  }

  Running run(all_allowed(), {}, Server::kPatience, {}, folder / "a.mcap");
  Client client(run.socket(), "test");
  send(client, 1'000'002);

  const auto& publishers = run.application->topics().find("numbers")->publishers;
  const auto names = [&] {
    std::set<std::string> all;
    for (const auto& publisher : publishers) {
      all.insert(publisher->owner.name);
    }
    return all;
  };
  EXPECT_EQ(names(), (std::set<std::string>{"fastcycle/inspect", "fastcycle/inspect_", "source"}));
  const auto end = std::chrono::steady_clock::now() + kBound;
  const auto is_fed = [&] {
    return std::ranges::any_of(publishers, [](const auto& publisher) {
      return publisher->owner.name == "fastcycle/inspect" && publisher->published() == 1;
    });
  };
  while (!is_fed() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(is_fed());
}

TEST(AServer, CallsAServiceWhereThatIsAllowed) {
  Running run(all_allowed());
  Client client(run.socket(), "test");
  for (std::int64_t number = 1; number <= 3; ++number) {
    protocol::Request request;
    request.mutable_call_service()->set_service("double");
    request.mutable_call_service()->set_request(serialized(number));
    request.mutable_call_service()->set_timeout_ms(60'000);
    const protocol::Reply reply = client.ask(std::move(request), kBound).reply();
    EXPECT_EQ(reply.status(), "ok") << reply.error();
    EXPECT_EQ(reply.reply(), serialized(2 * number));
  }
  protocol::Request request;
  request.mutable_call_service()->set_service("dubble");
  EXPECT_THAT(error_of([&] { client.ask(std::move(request)); }).hint(), HasSubstr("double"));
}

TEST(AServer, StopsStartsAndRestartsComponentsWhereThatIsAllowed) {
  Running run(all_allowed());
  Client client(run.socket(), "test");
  const auto change = [&](protocol::Lifecycle::Action action) {
    protocol::Request request;
    request.mutable_lifecycle()->set_action(action);
    request.mutable_lifecycle()->set_component("reader");
    return client.ask(std::move(request), kBound).done().text();
  };
  EXPECT_EQ(change(protocol::Lifecycle::ACTION_STOP), "component \"reader\" is standby");
  EXPECT_EQ(change(protocol::Lifecycle::ACTION_START), "component \"reader\" is active");
  EXPECT_EQ(change(protocol::Lifecycle::ACTION_RESTART), "component \"reader\" is active");
  const ClientError error = error_of([&] { change(protocol::Lifecycle::ACTION_START); });
  EXPECT_THAT(error.what(), HasSubstr("it is active"));
  const protocol::Overview overview = client.ask(overview_request()).overview();
  EXPECT_EQ(overview.components(1).restarts(), 1U);
  EXPECT_EQ(overview.components(1).faults(), 0U);
}

TEST(AServer, SendsAllThatARecordingNeeds) {
  Running run;
  Client client(run.socket(), "test");
  protocol::Request request;
  request.mutable_record()->add_topics("n*");
  const protocol::Answer answer = client.begin(std::move(request));
  const protocol::Started& started = answer.started();
  ASSERT_EQ(started.channels().size(), 1);
  EXPECT_EQ(started.channels(0).topic(), "numbers");
  EXPECT_THAT(started.schemas(0), HasSubstr("wrappers.proto"));
  EXPECT_FALSE(started.facts().empty());
  const protocol::Message message = await(client, has_messages).messages().messages(0);
  EXPECT_EQ(message.payload(), serialized(static_cast<std::int64_t>(message.sequence())));
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
    stranger.send(said);
    EXPECT_THAT(stranger.receive().size(), testing::Gt(0U));  // Why not; then it is closed.
  }
  Client client(run.socket(), "test");
  EXPECT_TRUE(client.ask(overview_request()).has_overview());
}

TEST(AHostileClient, OfAnotherUserIsRefused) {
  if (::geteuid() != 0) {
    GTEST_SKIP() << "only root can become somebody else";
  }
  Running run;
  // As if the folder had been opened for all.
  ::chmod(run.socket().parent_path().c_str(), 0755);
  ::chmod(run.socket().c_str(), 0666);
  const pid_t child = ::fork();
  if (child == 0) {  // Only calls that are safe in the child of a process with threads.
    const sockaddr_un address = address_of(run.socket());
    const int descriptor = ::socket(AF_UNIX, SOCK_STREAM, 0);
    if (::setuid(65534) != 0 ||
        ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      ::_exit(1);
    }
    std::size_t received = 0;
    char piece[256];
    for (;;) {
      const ssize_t count = ::recv(descriptor, piece, sizeof(piece), 0);
      if (count <= 0) {
        break;
      }
      received += static_cast<std::size_t>(count);
    }
    ::_exit(received > 0 ? 0 : 2);  // It is notified why, and the connection closed.
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  Client client(run.socket(), "test");
  EXPECT_EQ(client.ask(overview_request()).overview().clients(), 1U);
}

TEST(AHostileClient, OfAnotherVersionIsNotified) {
  Running run;
  protocol::Request request;
  request.set_id(1);
  request.mutable_hello()->set_version(99);
  const Stranger stranger(run.socket());
  stranger.send(frame_of(request));
  EXPECT_THAT(stranger.receive(), HasSubstr("version 1"));
}

/// Asks for more than a socket holds, and reads nothing of it.
std::string endless_questions() {
  protocol::Request request;
  request.set_id(1);
  request.mutable_hello()->set_version(kProtocolVersion);
  std::string bytes = frame_of(request);
  protocol::Request overview = overview_request();
  overview.set_id(2);
  for (int i = 0; i < 1000; ++i) {
    bytes += frame_of(overview);
  }
  return bytes;
}

TEST(AHostileClient, ThatDoesNotReadIsDroppedAndCounted) {
  Running run({}, {}, 50ms);
  Client other(run.socket(), "test");
  const Stranger stranger(run.socket());

  stranger.send(endless_questions());

  EXPECT_TRUE(stranger.is_closed());
  const protocol::Overview overview = other.ask(overview_request()).overview();
  EXPECT_EQ(overview.clients(), 1U);
  EXPECT_EQ(overview.clients_dropped(), 1U);
}

TEST(AClientOfTheSameProcess, IsKeptWhenItDoesNotRead) {
  Running run({}, {}, 50ms);
  const Stranger within(run.server->connect());
  within.send(endless_questions());
  const Stranger without(run.socket());
  without.send(endless_questions());
  ASSERT_TRUE(without.is_closed());  // Who came later has been stuck for too long by now.

  Client other(run.socket(), "test");
  const protocol::Overview overview = other.ask(overview_request()).overview();
  EXPECT_EQ(overview.clients(), 2U);
  EXPECT_EQ(overview.clients_dropped(), 1U);
}

TEST(AHostileClient, WithoutANameIsNamedByItsProcess) {
  Running run({}, {}, 50ms);
  Client other(run.socket(), "test");
  protocol::Request log;
  log.mutable_stream_log()->set_level("warning");
  other.begin(std::move(log));
  const Stranger stranger(run.socket());

  stranger.send(endless_questions());

  const protocol::Answer answer = await(other, [](const auto& one) { return one.has_log(); });
  EXPECT_EQ(
      answer.log().lines(0).text(),
      "the connection of process " + std::to_string(::getpid()) + " was ended: it does not read");
}

TEST(AHostileClient, MayRestForAWhile) {
  Running run({}, {}, 1h);
  const Stranger stranger(run.socket());

  stranger.send(endless_questions());

  Client other(run.socket(), "test");
  const protocol::Overview overview = other.ask(overview_request()).overview();
  EXPECT_EQ(overview.clients(), 2U);
  EXPECT_EQ(overview.clients_dropped(), 0U);
}

/// As long as it lives this process has one file descriptor left.
class AllDescriptorsButOne {
 public:
  AllDescriptorsButOne() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    rlimit few = before_;
    few.rlim_cur = std::min<rlim_t>(before_.rlim_cur, 512);
    ::setrlimit(RLIMIT_NOFILE, &few);
    for (int taken = ::dup(STDERR_FILENO); taken >= 0; taken = ::dup(STDERR_FILENO)) {
      taken_.push_back(taken);
    }
    ::close(taken_.back());
    taken_.pop_back();
  }
  AllDescriptorsButOne(const AllDescriptorsButOne&) = delete;
  AllDescriptorsButOne& operator=(const AllDescriptorsButOne&) = delete;
  ~AllDescriptorsButOne() {
    for (const int descriptor : taken_) {
      ::close(descriptor);
    }
    ::setrlimit(RLIMIT_NOFILE, &before_);
  }

 private:
  rlimit before_{};
  std::vector<int> taken_;
};

/// What the server answers to a client for which the process has its last descriptor. A sanitizer
/// or another thread may hold that one for a moment: then the client cannot even ask.
ClientError error_of_one_more(const std::filesystem::path& socket) {
  const auto end = std::chrono::steady_clock::now() + kBound;
  for (;;) {
    ClientError error = error_of([&] { Client(socket, "one more"); });
    if (std::string_view(error.what()).find(std::strerror(EMFILE)) == std::string_view::npos ||
        std::chrono::steady_clock::now() > end) {
      return error;
    }
    std::this_thread::sleep_for(1ms);
  }
}

TEST(AServer, TellsWhoConnectsThatNoDescriptorIsLeft) {
  if (std::string_view(FASTCYCLE_SANITIZER) == "address") {
    GTEST_SKIP() << "the sanitizer of undefined behaviour needs descriptors itself";
  }
  // In live time a worker opens a timer of its own before its first sleep with a deadline, which
  // may be after the descriptors have been taken.
  Running run({}, {.is_simulated = true});
  {
    const AllDescriptorsButOne taken;
    for (int i = 0; i < 3; ++i) {
      const ClientError error = error_of_one_more(run.socket());
      EXPECT_EQ(error.kind(), protocol::Error::KIND_TOO_MANY);
      EXPECT_THAT(error.what(), HasSubstr("no file descriptor"));
    }
  }
  Client client(run.socket(), "test");
  EXPECT_TRUE(client.ask(overview_request()).has_overview());
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
