// The live server as its clients see it: over sockets, with the Foxglove WebSocket protocol.
#include "web/server.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "inspect/server.h"
#include "web/foxglove.h"

namespace fastcycle::web {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using foxglove::Json;
using google::protobuf::Int64Value;
using ::testing::Contains;
using ::testing::Eq;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using namespace std::chrono_literals;

/// Counts, times its factor, and sends blobs.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context),
        factor_(context.param<std::int64_t>(
            "factor", {.fallback = 1, .min = 1, .max = 9, .is_tunable = true})),
        numbers_(context.create_publisher<Int64Value>("numbers")) {
    context.create_service<Int64Value, Int64Value>(
        "twice",
        [](const Int64Value& request, Int64Value& reply) { reply.set_value(request.value() * 2); });
    context.create_subscriber<Int64Value>(
        "wishes", [this](const Int64Value& wish) { offset_ = wish.value(); });
  }

  void serve() override {
    auto number = numbers_.loan();
    number->set_value(++count_ * factor_.get() + offset_);
    numbers_.publish(std::move(number));
  }

 private:
  Param<std::int64_t> factor_;
  Publisher<Int64Value> numbers_;
  std::int64_t count_ = 0;
  std::int64_t offset_ = 0;
};

/// A client that waits for messages.
class Client {
 public:
  using Stream = websocket::stream<beast::tcp_stream>;

  Client(std::uint16_t port, const std::string& target, std::string_view subprotocol)
      : socket_(io_) {
    beast::get_lowest_layer(socket_).connect(
        tcp::endpoint(asio::ip::make_address("127.0.0.1"), port));
    socket_.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
      request.set(http::field::sec_websocket_protocol, std::string(subprotocol));
    }));
    boost::system::error_code error;
    socket_.handshake(response_, fmt::format("127.0.0.1:{}", port), target, error);
    is_open_ = !error;
  }

  [[nodiscard]] bool is_open() const { return is_open_; }
  [[nodiscard]] const websocket::response_type& response() const { return response_; }

  void send(const Json& json) {
    socket_.text(true);
    socket_.write(asio::buffer(json.dump()));
  }
  void send_raw(const std::string& bytes, bool is_text) {
    socket_.text(is_text);
    socket_.write(asio::buffer(bytes));
  }

  /// The next frame; false once the server has closed.
  bool read() {
    beast::flat_buffer buffer;
    boost::system::error_code error;
    beast::get_lowest_layer(socket_).expires_after(60s);
    socket_.read(buffer, error);
    frame = beast::buffers_to_string(buffer.data());
    if (!error && socket_.got_text() && frame.find("left out") != std::string::npos) {
      losses.push_back(frame);
    }
    return !error;
  }
  /// The next text whose "op" this is.
  Json await(std::string_view op) {
    while (read()) {
      if (!socket_.got_text()) {
        continue;
      }
      Json json = Json::parse(frame);
      if (json["op"] == op) {
        return json;
      }
    }
    ADD_FAILURE() << "no " << op << " came";
    return Json::object();
  }
  /// The next binary frame that begins with `kind`.
  std::string await_binary(char kind) {
    while (read()) {
      if (socket_.got_binary() && !frame.empty() && frame.front() == kind) {
        return frame;
      }
    }
    ADD_FAILURE() << "no binary frame " << static_cast<int>(kind) << " came";
    return {};
  }

  std::string frame;
  std::vector<std::string> losses;  ///< What the server said of messages that it left out.

 private:
  asio::io_context io_;
  Stream socket_;
  websocket::response_type response_;
  bool is_open_ = false;
};

std::uint64_t number_at(std::string_view frame, std::size_t at, std::size_t size) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < size; ++i) {
    number |= static_cast<std::uint64_t>(static_cast<unsigned char>(frame[at + i])) << (8 * i);
  }
  return number;
}

class LiveServer : public testing::Test {
 protected:
  static config::InspectDescription allow(const std::set<std::string>& words) {
    config::InspectDescription allowed;
    allowed.allows_params = words.contains("params");
    allowed.allows_publish = words.contains("publish");
    return allowed;
  }

  void run(config::InspectDescription allowed = {}, bool is_simulated = false,
           config::LiveDescription description = {}) {
    classes_.with<Counter>("counter");
    config::Problems problems;
    application_ = std::make_unique<host::Application>(
        host::describe_text(R"({"name": "shown", "components": [
          {"name": "counter", "library": "counter", "serve_period_ms": 2}]})",
                            problems),
        host::ClockOptions{.is_simulated = is_simulated, .workers = is_simulated ? 1U : 0U});
    inspection_ =
        std::make_unique<inspect::Server>(*application_, allowed, std::filesystem::path());
    application_->add(*inspection_);
    description.port = 0;
    description.publish = {"wishes"};
    description.origins = {"https://app.foxglove.dev"};
    server_ = std::make_unique<Server>(
        *application_, description, [this] { return inspection_->connect(); }, "<p>a page</p>");
    application_->add(*server_);
    application_->build(classes_, problems, host::ConstructorFault::kFault);
    ASSERT_FALSE(problems.has_errors()) << config::to_string(problems.all().front());
    application_->start();
  }
  void TearDown() override {
    if (application_ != nullptr) {
      application_->stop();
    }
    application_.reset();
    server_.reset();
    inspection_.reset();
  }

  Client connect(std::string_view subprotocol = foxglove::kNewSubprotocol) const {
    return {server_->port(), "/?token=" + server_->token(), subprotocol};
  }
  /// The status of the answer to a request for a WebSocket.
  int status_of(const std::string& target,
                const std::map<std::string, std::string>& headers = {}) const {
    std::map<std::string, std::string> all = {
        {"Host", fmt::format("127.0.0.1:{}", server_->port())},
        {"Connection", "Upgrade"},
        {"Upgrade", "websocket"},
        {"Sec-WebSocket-Version", "13"},
        {"Sec-WebSocket-Key", "AAAAAAAAAAAAAAAAAAAAAA=="},
        {"Sec-WebSocket-Protocol", std::string(foxglove::kNewSubprotocol)}};
    for (const auto& [name, value] : headers) {
      all[name] = value;
    }
    std::string request = "GET " + target + " HTTP/1.1\r\n";
    for (const auto& [name, value] : all) {
      request += name + ": " + value + "\r\n";
    }
    asio::io_context io;
    tcp::socket socket(io);
    socket.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), server_->port()));
    boost::system::error_code error;
    asio::write(socket, asio::buffer(request + "\r\n"), error);
    std::string answer;
    asio::read_until(socket, asio::dynamic_buffer(answer), "\r\n", error);
    return answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }

  using Response = http::response<http::string_body>;
  /// The answer over `stream`, which is connected.
  template <typename Stream>
  Response ask(Stream& stream, http::verb verb, const std::string& target, std::string body = {},
               const std::string& accept = {}) const {
    http::request<http::string_body> request(verb, target, 11);
    request.set(http::field::host, fmt::format("127.0.0.1:{}", server_->port()));
    request.set(http::field::authorization, "Bearer " + server_->token());
    request.set(http::field::accept, accept);
    request.body() = std::move(body);
    request.prepare_payload();
    boost::system::error_code error;
    http::write(stream, request, error);
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.body_limit(std::uint64_t{64} << 20U);
    http::read(stream, buffer, parser, error);
    EXPECT_FALSE(error) << error.message();
    return parser.release();
  }
  Response ask(http::verb verb, const std::string& target, std::string body = {},
               const std::string& accept = {}) const {
    asio::io_context io;
    tcp::socket socket(io);
    socket.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), server_->port()));
    return ask(socket, verb, target, std::move(body), accept);
  }

  static Json channel_of(const Json& advertise, std::string_view topic) {
    for (const Json& channel : advertise["channels"]) {
      if (channel["topic"] == topic) {
        return channel;
      }
    }
    ADD_FAILURE() << topic << " is not advertised: " << advertise.dump();
    return Json::object();
  }

  host::TestClasses classes_;
  std::unique_ptr<inspect::Server> inspection_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<host::Application> application_;
};

TEST_F(LiveServer, SaysWhatThereIs) {
  run();
  for (const auto subprotocol : {foxglove::kNewSubprotocol, foxglove::kOldSubprotocol}) {
    Client client = connect(subprotocol);
    ASSERT_TRUE(client.is_open());
    EXPECT_EQ(client.response()[http::field::sec_websocket_protocol], std::string(subprotocol));
    const Json info = client.await("serverInfo");
    EXPECT_EQ(info["name"], "FastCycle shown");
    EXPECT_THAT(info["capabilities"], Contains("parameters"));
    EXPECT_EQ(info["capabilities"].dump().find("services"), std::string::npos);
    const Json numbers = channel_of(client.await("advertise"), "numbers");
    EXPECT_EQ(numbers["encoding"], "protobuf");
    EXPECT_EQ(numbers["schemaName"], "google.protobuf.Int64Value");
    EXPECT_EQ(numbers["schemaEncoding"], "protobuf");
    EXPECT_FALSE(numbers["schema"].get<std::string>().empty());
  }
}

TEST_F(LiveServer, GivesEachMessageInItsOrderOrSaysWhichItLeftOut) {
  run();
  Client client = connect();
  const Json channel = channel_of(client.await("advertise"), "numbers");
  client.send(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 77}, {"channelId", channel["id"]}}}}});

  std::int64_t last = 0;
  std::uint64_t last_ns = 0;
  bool is_complete = true;
  for (int i = 0; i < 50; ++i) {
    const std::string frame = client.await_binary(1);
    ASSERT_GT(frame.size(), 13);
    EXPECT_EQ(number_at(frame, 1, 4), 77);
    EXPECT_GT(number_at(frame, 5, 8), last_ns);
    last_ns = number_at(frame, 5, 8);
    Int64Value number;
    ASSERT_TRUE(number.ParseFromString(frame.substr(13)));
    EXPECT_GT(number.value(), last);
    is_complete &= last == 0 || number.value() == last + 1;
    last = number.value();
  }
  // On a machine that is busy for 0.1 s the queues overflow.
  while (!is_complete && client.losses.empty()) {
    ASSERT_TRUE(client.read());
  }
  client.send({{"op", "unsubscribe"}, {"subscriptionIds", {77}}});
  client.send({{"op", "unsubscribe"}, {"subscriptionIds", {77}}});
  std::string text;
  while (text.find("no such subscription") == std::string::npos) {
    text = client.await("status").value("message", "");
    ASSERT_FALSE(text.empty());
  }
}

TEST_F(LiveServer, RefusesWhoHasNoBusinessHere) {
  run();
  const std::string right = "/?token=" + server_->token();
  EXPECT_EQ(status_of(right), 101);
  EXPECT_EQ(status_of("/"), 403);
  EXPECT_EQ(status_of("/?token=00000000000000000000000000000000"), 403);
  EXPECT_EQ(status_of(right, {{"Origin", "https://evil.example"}}), 403);
  EXPECT_EQ(status_of(right, {{"Origin", "https://app.foxglove.dev"}}), 101);
  EXPECT_EQ(status_of(right, {{"Host", "evil.example"}}), 403);
  EXPECT_EQ(status_of(right, {{"Sec-WebSocket-Protocol", "chat"}}), 400);
  EXPECT_EQ(status_of(right, {{"X-Long", std::string(20'000, 'x')}}), 431);
  EXPECT_EQ(status_of("/other?token=" + server_->token(), {{"Upgrade", "h2c"}}), 404);
  EXPECT_EQ(status_of(right, {{"Upgrade", "h2c"}}), 200);
}

TEST_F(LiveServer, GivesBrowsersItsPage) {
  run();
  const Response page = ask(http::verb::get, "/?token=" + server_->token());
  EXPECT_EQ(page.result_int(), 200);
  EXPECT_EQ(page.body(), "<p>a page</p>");
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_EQ(page["Referrer-Policy"], "no-referrer");
  EXPECT_EQ(ask(http::verb::post, "/", "x").result_int(), 405);
  EXPECT_EQ(ask(http::verb::get, "/ask").result_int(), 405);
  EXPECT_EQ(ask(http::verb::get, "/etc/passwd").result_int(), 404);
}

TEST_F(LiveServer, AsksTheApplicationForThem) {
  run(allow({"params"}));
  asio::io_context io;
  tcp::socket socket(io);
  socket.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), server_->port()));
  // All over one connection.
  const auto answer_to = [&](const std::string& body) {
    const Response response = ask(socket, http::verb::post, "/ask", body);
    EXPECT_EQ(response.result_int(), 200) << response.body();
    return Json::parse(response.body());
  };
  const Json overview = answer_to(R"({"overview": {}})")["overview"];
  EXPECT_EQ(overview["application"], "shown");
  EXPECT_EQ(overview["allow"], Json::parse(R"(["params"])"));
  EXPECT_EQ(overview["components"][0]["name"], "counter");
  EXPECT_TRUE(overview["components"][0]["callback"]["buckets"].empty());
  const Json change = answer_to(
      R"({"change_params": {"changes": [{"param": "counter.factor", "value_json": "4"}]}})");
  EXPECT_TRUE(change["params_changed"]["errors"].empty());
  EXPECT_EQ(answer_to(R"({"params": {}})")["params"]["params"][0]["value_json"], "4");
  const Json refused = answer_to(R"({"switch_mode": {"mode": "off"}})");
  EXPECT_EQ(refused["error"]["kind"], "KIND_NOT_ALLOWED");
  EXPECT_THAT(refused["error"]["hint"].get<std::string>(), HasSubstr("--inspect-allow"));
}

TEST_F(LiveServer, KeepsTheConnectionOfAClientThatAsksAgainLater) {
  run();
  asio::io_context io;
  tcp::socket socket(io);
  socket.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), server_->port()));
  const Response first = ask(socket, http::verb::post, "/ask", R"({"overview": {}})");
  EXPECT_EQ(first[http::field::keep_alive], "timeout=60");
  std::this_thread::sleep_for(6s);  // Longer than a first request may take.
  EXPECT_EQ(ask(socket, http::verb::post, "/ask", R"({"overview": {}})").result_int(), 200);
}

TEST_F(LiveServer, RefusesQuestionsThatAreNone) {
  run();
  for (const char* body : {"", "{", "[]", "{\"no\": 1}", R"({"stream": {"topic": "numbers"}})",
                           R"({"hello": {"version": 1}})", R"({"record": {}})", "{}"}) {
    EXPECT_EQ(ask(http::verb::post, "/ask", body).result_int(), 400) << body;
  }
  EXPECT_EQ(ask(http::verb::post, "/ask", std::string(2'000'000, ' ')).result_int(), 413);
  EXPECT_EQ(ask(http::verb::post, "/ask", R"({"overview": {}})").result_int(), 200);
}

TEST_F(LiveServer, GivesMetrics) {
  run();
  EXPECT_EQ(status_of("/?token=wrong"), 403);
  const Response text = ask(http::verb::get, "/metrics");
  EXPECT_EQ(text[http::field::content_type], "text/plain; version=0.0.4; charset=utf-8");
  EXPECT_THAT(text.body(),
              HasSubstr("fastcycle_component_activations_total{component=\"counter\"}"));
  EXPECT_THAT(text.body(), HasSubstr("le=\"+Inf\""));
  EXPECT_THAT(text.body(), HasSubstr("fastcycle_live_connections_refused_total 1\n"));
  const Response open = ask(http::verb::get, "/metrics", {}, "application/openmetrics-text");
  EXPECT_TRUE(open.body().ends_with("# EOF\n"));
}

TEST_F(LiveServer, TakesItsTokenFromAFile) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / fmt::format("fastcycle_token_{}", ::getpid());
  const std::string token(40, 'k');
  std::ofstream(file) << token << "\nmore\n";
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  config::LiveDescription description;
  description.token_file = file.string();
  run({}, false, description);
  std::filesystem::remove(file);
  EXPECT_EQ(server_->token(), token);
  EXPECT_EQ(status_of("/?token=" + token), 101);
}

TEST_F(LiveServer, SpeaksTlsWhereItIsAskedFor) {
  config::LiveDescription description;
  description.tls = true;
  run({}, false, description);
  EXPECT_THAT(server_->url(), StartsWith("https://127.0.0.1:"));
  EXPECT_EQ(server_->fingerprint().size(), 95U);
  const tcp::endpoint there(asio::ip::make_address("127.0.0.1"), server_->port());
  {
    asio::io_context io;
    tcp::socket plain(io);
    plain.connect(there);
    boost::system::error_code error;
    asio::write(plain, asio::buffer(std::string("GET / HTTP/1.1\r\n\r\n")), error);
    std::string answer;
    asio::read(plain, asio::dynamic_buffer(answer), error);  // Until it is closed.
    EXPECT_EQ(answer.find("HTTP"), std::string::npos);
  }
  asio::io_context io;
  asio::ssl::context trust(asio::ssl::context::tls_client);
  beast::ssl_stream<beast::tcp_stream> stream(io, trust);
  beast::get_lowest_layer(stream).connect(there);
  stream.handshake(asio::ssl::stream_base::client);
  EXPECT_EQ(ask(stream, http::verb::post, "/ask", R"({"params": {}})").result_int(), 200);

  websocket::stream<beast::ssl_stream<beast::tcp_stream>> socket(io, trust);
  beast::get_lowest_layer(socket).connect(there);
  socket.next_layer().handshake(asio::ssl::stream_base::client);
  socket.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
    request.set(http::field::sec_websocket_protocol, std::string(foxglove::kNewSubprotocol));
  }));
  socket.handshake(fmt::format("127.0.0.1:{}", server_->port()), "/?token=" + server_->token());
  beast::flat_buffer buffer;
  socket.read(buffer);
  EXPECT_THAT(beast::buffers_to_string(buffer.data()), HasSubstr("serverInfo"));
}

TEST_F(LiveServer, TellsAndChangesParams) {
  run(allow({"params"}));
  Client client = connect();
  client.send({{"op", "getParameters"}, {"parameterNames", {"counter.factor"}}, {"id", "a"}});
  Json values = client.await("parameterValues");
  EXPECT_EQ(values["id"], "a");
  EXPECT_EQ(values["parameters"], Json::parse(R"([{"name": "counter.factor", "value": 1}])"));

  client.send({{"op", "subscribeParameterUpdates"}, {"parameterNames", {"counter.factor"}}});
  client.send({{"op", "setParameters"},
               {"parameters", {{{"name", "counter.factor"}, {"value", 3.0}}}},
               {"id", "b"}});
  for (;;) {
    values = client.await("parameterValues");
    ASSERT_FALSE(values.empty());
    if (values["parameters"][0]["value"] == 3) {
      break;
    }
  }
  client.send(
      {{"op", "setParameters"}, {"parameters", {{{"name", "counter.factor"}, {"value", 10}}}}});
  EXPECT_THAT(client.await("status")["message"].get<std::string>(), HasSubstr("counter.factor"));
}

TEST_F(LiveServer, ChangesNothingUnlessThatIsAllowed) {
  run();
  Client client = connect();
  client.send(
      {{"op", "setParameters"}, {"parameters", {{{"name", "counter.factor"}, {"value", 3}}}}});
  EXPECT_THAT(client.await("status")["message"].get<std::string>(),
              HasSubstr("may not be changed"));
  client.send({{"op", "advertise"},
               {"channels", {{{"id", 1}, {"topic", "wishes"}, {"encoding", "protobuf"}}}}});
  EXPECT_THAT(client.await("status")["message"].get<std::string>(),
              HasSubstr("may not be published on"));
}

TEST_F(LiveServer, PublishesAndCallsWhereThatIsAllowed) {
  run(allow({"publish"}));
  Client client = connect();
  const Json channel = channel_of(client.await("advertise"), "numbers");
  const Json services = client.await("advertiseServices");
  ASSERT_EQ(services["services"].size(), 1);
  const Json& service = services["services"][0];
  EXPECT_EQ(service["name"], "twice");
  EXPECT_EQ(service["request"]["schemaName"], "google.protobuf.Int64Value");

  Int64Value number;
  number.set_value(21);
  const std::string call =
      foxglove::service_reply(service["id"], 5, foxglove::kProtobuf, number.SerializeAsString());
  client.send_raw("\x02" + call.substr(1), false);
  const std::string reply = client.await_binary(3);
  EXPECT_EQ(number_at(reply, 5, 4), 5);
  ASSERT_TRUE(number.ParseFromString(reply.substr(13 + 8)));
  EXPECT_EQ(number.value(), 42);

  client.send({{"op", "advertise"},
               {"channels",
                {{{"id", 9},
                  {"topic", "wishes"},
                  {"encoding", "protobuf"},
                  {"schemaName", "google.protobuf.Int64Value"}}}}});
  number.set_value(1'000'000);
  std::string message("\x01\x09\0\0\0", 5);
  message += number.SerializeAsString();
  client.send_raw(message, false);
  client.send(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel["id"]}}}}});
  do {
    ASSERT_TRUE(number.ParseFromString(client.await_binary(1).substr(13)));
  } while (number.value() < 1'000'000);

  client.send({{"op", "advertise"},
               {"channels", {{{"id", 2}, {"topic", "numbers"}, {"encoding", "protobuf"}}}}});
  EXPECT_THAT(client.await("status")["message"].get<std::string>(), HasSubstr("numbers"));
}

TEST_F(LiveServer, TakesJsonOfClients) {
  run(allow({"publish"}));
  Client client = connect();
  EXPECT_THAT(client.await("serverInfo")["supportedEncodings"], Contains("json"));
  const Json channel = channel_of(client.await("advertise"), "numbers");
  const Json service = client.await("advertiseServices")["services"][0];

  // Int64Value is a text in protobuf's JSON.
  const auto call = [&](std::uint32_t number, const std::string& text) {
    client.send_raw("\x02" + foxglove::service_reply(service["id"], number, "json", text).substr(1),
                    false);
  };
  call(6, "\"21\"");
  EXPECT_THAT(client.await_binary(3).substr(9), Eq(std::string("\4\0\0\0json\"42\"", 12)));
  call(7, "{\"value\": 21");
  EXPECT_EQ(client.await("serviceCallFailure")["callId"], 7);

  const auto send = [&](const std::string& text) {
    client.send_raw(std::string("\x01\x09\0\0\0", 5) + text, false);
  };
  client.send({{"op", "advertise"},
               {"channels", {{{"id", 9}, {"topic", "wishes"}, {"encoding", "json"}}}}});
  send("[1, 2]");
  EXPECT_THAT(client.await("status")["message"].get<std::string>(), HasSubstr("\"wishes\": "));
  send("\"1000000\"");
  client.send(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel["id"]}}}}});
  Int64Value number;
  do {
    ASSERT_TRUE(number.ParseFromString(client.await_binary(1).substr(13)));
  } while (number.value() < 1'000'000);

  client.send({{"op", "advertise"},
               {"channels", {{{"id", 10}, {"topic", "wishes"}, {"encoding", "cdr"}}}}});
  EXPECT_THAT(client.await("status")["message"].get<std::string>(), HasSubstr("protobuf or json"));
}

TEST_F(LiveServer, ShowsWhoIsConnected) {
  run();
  Client client = connect();
  client.send({{"op", "subscribeConnectionGraph"}});
  const Json graph = client.await("connectionGraphUpdate");
  EXPECT_THAT(graph["publishedTopics"],
              Contains(Json::parse(R"({"name": "numbers", "publisherIds": ["counter"]})")));
  EXPECT_THAT(graph["subscribedTopics"],
              Contains(Json::parse(R"({"name": "wishes", "subscriberIds": ["counter"]})")));
  EXPECT_THAT(graph["advertisedServices"],
              Contains(Json::parse(R"({"name": "twice", "providerIds": ["counter"]})")));
}

TEST_F(LiveServer, GoesOnWhateverClientsSay) {
  run(allow({"params", "publish"}));
  Client client = connect();
  for (
      const char* text :
      {"", "{", "[]", "null", "7", R"({"op": 1})", R"({"op": "fly"})", R"({"op": "subscribe"})",
       R"({"op": "subscribe", "subscriptions": 1})",
       R"({"op": "subscribe", "subscriptions": [1, null, {}, {"id": -1, "channelId": 1}]})",
       R"({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4000000000}]})",
       R"({"op": "unsubscribe", "subscriptionIds": ["a", 99]})",
       R"({"op": "advertise", "channels": [{}, 1, {"id": 1}]})",
       R"({"op": "unadvertise", "channelIds": [1, "x"]})",
       R"({"op": "getParameters", "parameterNames": [1]})",
       R"({"op": "setParameters", "parameters": [{"name": "counter.factor"}]})",
       R"({"op": "setParameters", "parameters": [{"name": "nobody.nothing", "value": {"a": [1]}}]})",
       R"({"op": "subscribeParameterUpdates", "parameterNames": {"a": 1}})"}) {
    client.send_raw(text, true);
  }
  client.send_raw("[[[[" + std::string(100'000, '['), true);
  for (const std::string& frame :
       {std::string(), std::string("\x01"), std::string("\x01\x01\0\0\0", 5), std::string("\x02"),
        std::string("\x02\x07\0\0\0\x01\0\0\0\x08\0\0\0protobuf", 21), std::string("\x63zzz")}) {
    client.send_raw(frame, false);
  }
  client.send({{"op", "getParameters"}, {"parameterNames", {"counter.factor"}}, {"id", "end"}});
  Json values;
  do {
    values = client.await("parameterValues");
  } while (values.value("id", "end") != "end");
  EXPECT_EQ(values["parameters"][0]["value"], 1);
}

TEST_F(LiveServer, GivesEachClientItsOwn) {
  run();
  Client reader = connect();
  Client silent = connect();  // Subscribes, and never reads.
  const Json channel = channel_of(reader.await("advertise"), "numbers");
  for (Client* client : {&reader, &silent}) {
    client->send(
        {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel["id"]}}}}});
  }
  {
    Client gone = connect();
    gone.send(
        {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel["id"]}}}}});
  }
  for (int i = 0; i < 100; ++i) {
    ASSERT_FALSE(reader.await_binary(1).empty());
  }
}

TEST_F(LiveServer, ClosesWhenTheApplicationStops) {
  run();
  Client client = connect();
  client.await("advertise");
  application_->stop();
  while (client.read()) {
  }
  SUCCEED();
}

TEST_F(LiveServer, StopsWhileClientsComeAndLeave) {
  for (int round = 0; round < 10; ++round) {
    run();
    std::atomic<bool> is_over = false;
    std::atomic<int> connections = 0;
    std::vector<std::jthread> clients;
    for (int i = 0; i < 3; ++i) {
      clients.emplace_back([&] {
        while (!is_over) {
          try {
            Client client = connect();
            client.send({{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", 1}}}}});
            ++connections;  // And it leaves without a word.
          } catch (const boost::system::system_error&) {
            std::this_thread::sleep_for(1ms);  // Nobody listens any more.
          }
        }
      });
    }
    for (int i = 0; i < 60'000 && connections < 20 + round; ++i) {
      std::this_thread::sleep_for(1ms);
    }

    application_->stop();

    is_over = true;
    clients.clear();
    EXPECT_GE(connections, 20 + round);
    TearDown();
  }
}

/// A server that was opened as described, and what was wrong with it.
struct Opened {
  explicit Opened(const config::LiveDescription& description)
      : server(application, description, [] { return -1; }) {
    server.open(problems);
  }
  [[nodiscard]] std::string problem() const {
    return problems.has_errors() ? config::to_string(problems.all().front()) : std::string();
  }

  config::Problems problems;
  host::Application application{
      host::describe_text(R"({"name": "shown", "components": [{"name": "one", "library": "one"}]})",
                          problems),
      host::ClockOptions{}};
  Server server;
};

TEST(ALiveServer, HasTlsWhereOthersReachIt) {
  config::LiveDescription description;
  description.port = 0;
  description.address = "0.0.0.0";
  const Opened opened(description);
  EXPECT_EQ(opened.problem(), "");
  EXPECT_THAT(opened.server.url(), StartsWith("https://"));
  EXPECT_EQ(opened.server.url().find("0.0.0.0"), std::string::npos);
  EXPECT_NE(opened.server.fingerprint(), "");
}

TEST(ALiveServer, SaysWhatIsWrongWithItsDescription) {
  const auto problem_of = [](const auto& change) {
    config::LiveDescription description;
    description.port = 0;
    change(description);
    return Opened(description).problem();
  };
  const std::string file =
      (std::filesystem::temp_directory_path() / fmt::format("fastcycle_open_{}", ::getpid()))
          .string();
  std::ofstream(file) << "too short\n";
  EXPECT_THAT(problem_of([](auto& live) { live.address = "example.com"; }),
              HasSubstr("\"example.com\" is no IP address"));
  EXPECT_THAT(problem_of([](auto& live) { live.token_file = "/no/such/file"; }),
              HasSubstr("/no/such/file: cannot be read: No such file or directory"));
  std::filesystem::permissions(file, std::filesystem::perms(0644));
  EXPECT_THAT(problem_of([&](auto& live) { live.token_file = file; }), HasSubstr("chmod 600"));
  std::filesystem::permissions(file, std::filesystem::perms(0600));
  EXPECT_THAT(problem_of([&](auto& live) { live.token_file = file; }), HasSubstr("32 to 256"));
  EXPECT_THAT(problem_of([&](auto& live) { live.certificate = file; }),
              HasSubstr("belong together"));
  EXPECT_THAT(problem_of([&](auto& live) { live.certificate = live.key = file; }), HasSubstr(file));
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace fastcycle::web
