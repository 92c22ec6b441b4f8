#include "playback/played_log.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "config/nearest.h"
#include "config/problem.h"
#include "fastcycle/version.h"
#include "inspect/frame.h"
#include "inspect/refusal.h"
#include "record/recorded_schedule.h"

namespace fastcycle::playback {
namespace {

namespace protocol = inspect::protocol;
using namespace std::chrono_literals;
using inspect::Connection;
using inspect::Refusal;
using record::RecordedMessage;
using record::RecordedStream;

constexpr const char* kName = "fastcycle/view";
constexpr std::size_t kMaxConnections = 32;
constexpr std::size_t kMaxStreams = 4096;  // Of one connection.
constexpr auto kAtOnce = 20ms;             // Played for this long between requests.
constexpr int kIdleMs = 50;
constexpr Duration kFirstLookBack = 1s;

std::string name_of(const std::vector<std::filesystem::path>& files) {
  return files.size() == 1
             ? files.front().filename().string()
             : fmt::format("{} and {} more", files.front().filename().string(), files.size() - 1);
}

bool is_shown(const RecordedStream& stream) {
  return stream.encoding == "protobuf" && !stream.type.empty() && !stream.schema.empty();
}

/// @errors  `std::runtime_error` if one of them is there twice.
const std::vector<std::filesystem::path>& each_once(
    const std::vector<std::filesystem::path>& files) {
  if (const std::string twice = record::find_named_twice(files); !twice.empty()) {
    throw std::runtime_error(twice);
  }
  return files;
}

}  // namespace

PlayedLog::PlayedLog(const std::vector<std::filesystem::path>& files, Options options)
    : on_problem_(std::move(options.on_problem)),
      name_(name_of(files)),
      reader_(each_once(files)),
      backwards_(files),
      begin_(reader_.begin()),
      end_(std::max(reader_.begin(), reader_.end())),
      is_paused_(options.is_paused),
      speed_(std::clamp(options.speed, kMinSpeed, kMaxSpeed)),
      notes_(reader_.notes()) {
  std::map<std::string, Topic> topics;
  std::set<std::string> others;
  const std::vector<RecordedStream>& streams = reader_.streams();
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!is_shown(streams[i])) {
      others.insert(streams[i].topic);
      continue;
    }
    Topic& topic = topics[streams[i].topic];
    topic.name = streams[i].topic;
    topic.streams.push_back(i);
    topic.messages += streams[i].messages;
  }
  if (topics.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: none of its {} topics has messages in protobuf with a schema", name_, others.size()));
  }
  if (!others.empty()) {
    notes_.push_back(fmt::format("{} topics are not shown, since their messages are no protobuf "
                                 "with a schema: {}",
                                 others.size(), *others.begin()) +
                     (others.size() > 1 ? ", …" : ""));
  }
  topic_of_.assign(streams.size(), topics.size());
  for (auto& [name, topic] : topics) {
    for (const std::size_t stream : topic.streams) {
      topic_of_[stream] = topics_.size();
    }
    topics_.push_back(std::move(topic));
  }
  sent_ = anchor_ = std::clamp(options.start.value_or(begin_), begin_, end_);
}

PlayedLog::~PlayedLog() {
  stop();
}

void PlayedLog::start(std::vector<base::Refusal>& refusals) {
  wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake_ < 0) {
    throw std::runtime_error("no event descriptor can be made");
  }
  anchor_ns_ = base::monotonic_ns();
  thread_ =
      base::Thread(base::ThreadOptions{.name = kName, .cpus = {}}, [this] { serve(); }, refusals);
  is_running_ = true;
}

void PlayedLog::stop() {
  if (is_running_) {
    is_stopping_.store(true);
    const std::uint64_t one = 1;
    static_cast<void>(!::write(wake_, &one, sizeof(one)));
    thread_.join();
    is_running_ = false;
  }
  clients_.clear();
  for (const int descriptor : std::exchange(joining_, {})) {
    ::close(descriptor);
  }
  if (wake_ >= 0) {
    ::close(std::exchange(wake_, -1));
  }
}

int PlayedLog::connect() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()) != 0) {
    return -1;
  }
  {
    const std::lock_guard lock(mutex_);
    joining_.push_back(ends[0]);
  }
  const std::uint64_t one = 1;
  static_cast<void>(!::write(wake_, &one, sizeof(one)));
  return ends[1];
}

void PlayedLog::take_problem(const std::string& what) {
  move_to(sent_);
  is_paused_ = true;
  moment_ = {};
  is_selected_ = is_broken_ = true;
  for (const auto& client : clients_) {
    for (Stream& stream : client->streams) {
      stream.is_new = false;
    }
  }
  has_new_ = false;
  problem_ = what;
  on_problem_(what);
}

// ------------------------------------------------------------------------------------ the thread

void PlayedLog::serve() {
  while (!is_stopping_.load()) {
    wait();
    accept_joining();
    try {
      play();
    } catch (const std::exception& error) {
      take_problem(error.what());
    }
    for (const auto& client : clients_) {
      client->is_over = client->is_over || !client->connection->write(base::monotonic_ns());
    }
    std::erase_if(clients_, [](const auto& client) { return client->is_over; });
  }
}

void PlayedLog::wait() {
  std::vector<pollfd> polled{{.fd = wake_, .events = POLLIN, .revents = 0}};
  for (const auto& client : clients_) {
    short events = POLLIN;
    if (client->connection->waiting() > 0) {
      events |= POLLOUT;
    }
    polled.push_back({.fd = client->connection->descriptor(), .events = events, .revents = 0});
  }
  int timeout = -1;
  if (!is_paused_ && !moment_.empty()) {
    const double wait_ns = static_cast<double>((moment_.front().due - now()).count()) / speed_;
    timeout = static_cast<int>(std::clamp(std::ceil(wait_ns / 1e6), 0.0, double{kIdleMs}));
  } else if (!is_paused_) {
    timeout = kIdleMs;  // The recording may end a while after its last message.
  }
  if (has_new_ || (!is_selected_ && !is_paused_)) {
    timeout = 0;
  }
  if (::poll(polled.data(), polled.size(), timeout) < 0) {
    return;
  }
  if (polled[0].revents != 0) {
    std::uint64_t count = 0;
    static_cast<void>(!::read(wake_, &count, sizeof(count)));
  }
  for (std::size_t i = 0; i + 1 < polled.size(); ++i) {
    if ((polled[i + 1].revents & POLLIN) != 0) {
      read(*clients_[i]);
    } else if ((polled[i + 1].revents & (POLLHUP | POLLERR)) != 0) {
      clients_[i]->is_over = true;
    }
  }
}

void PlayedLog::accept_joining() {
  std::vector<int> joining;
  {
    const std::lock_guard lock(mutex_);
    joining.swap(joining_);
  }
  for (const int descriptor : joining) {
    auto client = std::make_unique<Client>();
    client->connection =
        std::make_unique<Connection>(descriptor, ++numbers_, ::geteuid(), ::getpid());
    client->connection->is_within = true;
    client->is_over = clients_.size() >= kMaxConnections;
    clients_.push_back(std::move(client));
  }
}

void PlayedLog::read(Client& client) {
  Connection& connection = *client.connection;
  client.is_over = !connection.receive();
  while (!client.is_over && connection.has_next(inspect::kMaxRequestBytes)) {
    std::string wrong;
    const auto frame = connection.next(inspect::kMaxRequestBytes, wrong);
    protocol::Request request;
    if (!frame || !request.ParseFromArray(frame->data(), static_cast<int>(frame->size())) ||
        request.id() == 0) {
      connection.put(inspect::error_answer(
          0, {protocol::Error::KIND_MALFORMED,
              wrong.empty() ? "this is no request of a FastCycle tool" : wrong}));
      static_cast<void>(connection.write(base::monotonic_ns()));
      client.is_over = true;
      return;
    }
    try {
      answer(client, request);
    } catch (const Refusal& refusal) {
      connection.put(inspect::error_answer(request.id(), refusal));
    }
  }
}

// ------------------------------------------------------------------------------------ requests

void PlayedLog::answer(Client& client, const protocol::Request& request) {
  if (!client.connection->is_greeted) {
    greet(client, request);
    return;
  }
  protocol::Answer answer;
  answer.set_id(request.id());
  using What = protocol::Request::WhatCase;
  switch (request.what_case()) {
    case What::kOverview:
      give_overview(!request.overview().without_topics(), *answer.mutable_overview());
      break;
    case What::kTopic:
      give_topic(request.topic().topic(), *answer.mutable_topic());
      break;
    case What::kParams:
      answer.mutable_params();
      break;
    case What::kPlayback:
      obey(request.playback());
      *answer.mutable_playback() = state();
      break;
    case What::kStream:
      begin_stream(client, request);
      return;
    case What::kEndStream:
      end_stream(client, request.end_stream().id());
      return;
    default:
      throw Refusal(protocol::Error::KIND_REFUSED,
                    "this is a recording: nothing of it runs, and nothing can be changed",
                    "fastcycle play feeds a recording into an application that runs");
  }
  client.connection->put(answer);
}

void PlayedLog::greet(Client& client, const protocol::Request& request) {
  if (!request.has_hello()) {
    throw Refusal(protocol::Error::KIND_MALFORMED, "the first request has to be a hello");
  }
  client.connection->is_greeted = true;
  client.connection->client = request.hello().client();
  protocol::Answer answer;
  answer.set_id(request.id());
  protocol::Welcome& welcome = *answer.mutable_welcome();
  welcome.set_version(inspect::kProtocolVersion);
  welcome.set_application(name_);
  welcome.set_pid(::getpid());
  welcome.set_framework(FASTCYCLE_VERSION);
  client.connection->put(answer);
}

void PlayedLog::fill(const Topic& topic, protocol::Topic& said) const {
  const RecordedStream& first = reader_.streams()[topic.streams.front()];
  said.set_name(topic.name);
  said.set_type(first.type);
  said.set_published(topic.messages);
  // Later clients are given the last messages too, as the original subscribers were.
  said.set_latched(topic.streams.size());
  for (const std::size_t stream : topic.streams) {
    protocol::Publisher& publisher = *said.add_publishers();
    publisher.set_component(reader_.streams()[stream].publisher);
    publisher.set_id(reader_.streams()[stream].publisher_id);
    publisher.set_published(reader_.streams()[stream].messages);
  }
}

void PlayedLog::give_overview(bool with_topics, protocol::Overview& overview) const {
  overview.set_application(name_);
  overview.set_pid(::getpid());
  overview.set_clock("simulated");
  overview.set_now_ns(base::to_ns(now()));
  overview.set_start_ns(base::to_ns(begin_));
  overview.set_monotonic_ns(base::monotonic_ns());
  overview.set_end("running");
  overview.set_clients(clients_.size());
  *overview.mutable_playback() = state();
  if (with_topics) {
    for (const Topic& topic : topics_) {
      fill(topic, *overview.add_topics());
    }
  }
}

std::size_t PlayedLog::find_topic(const std::string& name) const {
  const auto found = std::ranges::find(topics_, name, &Topic::name);
  if (found != topics_.end()) {
    return static_cast<std::size_t>(found - topics_.begin());
  }
  std::vector<std::string> known;
  for (const Topic& topic : topics_) {
    known.push_back(topic.name);
  }
  throw Refusal(protocol::Error::KIND_NOT_FOUND,
                fmt::format("there is no topic \"{}\" in the recording", name),
                config::did_you_mean(config::nearest(name, known)));
}

void PlayedLog::give_topic(const std::string& name, protocol::Topic& topic) const {
  const Topic& its = topics_[find_topic(name)];
  fill(its, topic);
  topic.set_schema(reader_.streams()[its.streams.front()].schema);
}

void PlayedLog::begin_stream(Client& client, const protocol::Request& request) {
  if (client.streams.size() >= kMaxStreams) {
    throw Refusal(protocol::Error::KIND_TOO_MANY,
                  fmt::format("a connection may have {} streams", kMaxStreams));
  }
  protocol::Answer answer;
  answer.set_id(request.id());
  protocol::Started& started = *answer.mutable_started();
  Stream stream{.id = request.id(),
                .topic = find_topic(request.stream().topic()),
                .has_payload = request.stream().content() != protocol::Stream::CONTENT_INFO};
  for (const std::size_t one : topics_[stream.topic].streams) {
    const RecordedStream& its = reader_.streams()[one];
    protocol::Started::Channel& channel = *started.add_channels();
    channel.set_channel(static_cast<std::uint32_t>(one));
    channel.set_topic(its.topic);
    channel.set_type(its.type);
    channel.set_component(its.publisher);
    channel.set_publisher(its.publisher_id);
    channel.set_schema(static_cast<std::uint32_t>(started.schemas_size()));
    started.add_schemas(its.schema);
  }
  client.connection->put(answer);
  client.streams.push_back(stream);
  if (!std::exchange(has_begun_, true)) {
    move_to(anchor_);
  }
  has_new_ = true;
  is_selected_ = false;
}

void PlayedLog::end_stream(Client& client, std::uint32_t id) {
  if (std::erase_if(client.streams, [&](const Stream& stream) { return stream.id == id; }) > 0) {
    protocol::Answer answer;
    answer.set_id(id);
    answer.mutable_ended()->set_why("requested");
    client.connection->put(answer);
    is_selected_ = false;
  }
}

// ------------------------------------------------------------------------------------ time

Time PlayedLog::now() const {
  if (is_paused_ || !has_begun_) {
    return anchor_;
  }
  const double passed_ns = static_cast<double>(base::monotonic_ns() - anchor_ns_) * speed_;
  return std::min(end_, anchor_ + Duration(static_cast<std::int64_t>(passed_ns)));
}

void PlayedLog::move_to(Time position) {
  anchor_ = std::clamp(position, begin_, end_);
  anchor_ns_ = base::monotonic_ns();
}

protocol::Playback PlayedLog::state() const {
  protocol::Playback playback;
  const Time position = now();
  playback.set_status(position >= end_ ? protocol::Playback::STATUS_ENDED
                      : is_paused_     ? protocol::Playback::STATUS_PAUSED
                                       : protocol::Playback::STATUS_PLAYING);
  playback.set_now_ns(base::to_ns(position));
  playback.set_begin_ns(base::to_ns(begin_));
  playback.set_end_ns(base::to_ns(end_));
  playback.set_speed(speed_);
  playback.set_seeks(seeks_);
  playback.set_can_seek(true);
  playback.set_problem(problem_);
  return playback;
}

void PlayedLog::obey(const protocol::ControlPlayback& control) {
  const Time position = now();
  move_to(position);
  if (std::isfinite(control.speed()) && control.speed() > 0) {
    speed_ = std::clamp(control.speed(), kMinSpeed, kMaxSpeed);
  }
  std::optional<Time> target;
  if (control.has_seek()) {
    target = base::from_ns(control.seek_ns());
  } else if (control.command() == protocol::ControlPlayback::COMMAND_PLAY && position >= end_) {
    target = begin_;  // Start over.
  }
  if (target) {
    move_to(*target);
    sent_ = anchor_;
    ++seeks_;
    moment_ = {};
    problem_.clear();
    is_selected_ = false;
    has_new_ = true;
    for (const auto& client : clients_) {
      for (Stream& stream : client->streams) {
        stream.is_new = true;
      }
    }
  }
  if (control.command() == protocol::ControlPlayback::COMMAND_PLAY) {
    is_paused_ = false;
    problem_.clear();
    is_selected_ = is_selected_ && !std::exchange(is_broken_, false);  // Reading is retried.
  } else if (control.command() == protocol::ControlPlayback::COMMAND_PAUSE) {
    is_paused_ = true;
  }
}

void PlayedLog::select() {
  std::vector<bool> wanted(reader_.streams().size());
  for (const auto& client : clients_) {
    for (const Stream& stream : client->streams) {
      for (const std::size_t one : topics_[stream.topic].streams) {
        wanted[one] = true;
      }
    }
  }
  reader_.rewind({.wanted = std::move(wanted), .from = sent_ + Duration(1), .to = end_});
  moment_ = reader_.next();
  is_selected_ = true;
}

/// Sends new streams the last messages up to the present time: searches in growing windows, so that
/// frequent topics are found without reading much.
void PlayedLog::give_last() {
  std::vector<bool> wanted(reader_.streams().size());
  for (const auto& client : clients_) {
    for (const Stream& stream : client->streams) {
      if (stream.is_new) {
        for (const std::size_t one : topics_[stream.topic].streams) {
          wanted[one] = true;
        }
      }
    }
  }
  std::map<std::size_t, RecordedMessage> last;
  Time to = sent_;
  for (Duration window = kFirstLookBack; to >= begin_; window *= 4) {
    if (std::ranges::find(wanted, true) == wanted.end()) {
      break;
    }
    const Time from = std::max(begin_, to - window);
    backwards_.rewind({.wanted = wanted, .from = from, .to = to});
    for (auto moment = backwards_.next(); !moment.empty(); moment = backwards_.next()) {
      for (RecordedMessage& message : moment) {
        wanted[message.stream] = false;
        std::swap(last[message.stream], message);
      }
    }
    to = from - Duration(1);
  }
  std::vector<const RecordedMessage*> in_order;
  for (const auto& [stream, message] : last) {
    in_order.push_back(&message);
  }
  std::ranges::sort(in_order, {}, &RecordedMessage::due);
  for (const RecordedMessage* message : in_order) {
    send(*message, true);
  }
  for (const auto& client : clients_) {
    for (Stream& stream : client->streams) {
      stream.is_new = false;
    }
  }
  has_new_ = false;
}

void PlayedLog::play() {
  if (!is_paused_ && !send_due()) {
    return;
  }
  if (has_new_) {
    give_last();
  }
  if (!is_selected_) {
    select();
  }
  if (!is_paused_ && sent_ >= end_) {
    move_to(end_);
    is_paused_ = true;
  }
}

bool PlayedLog::send_due() {
  const auto until = std::chrono::steady_clock::now() + kAtOnce;
  const Time position = now();
  while (!moment_.empty() && moment_.front().due <= position) {
    if (std::chrono::steady_clock::now() >= until) {
      move_to(moment_.front().due);  // Behind schedule: time has to wait.
      return false;
    }
    for (const RecordedMessage& message : moment_) {
      send(message, false);
    }
    sent_ = moment_.front().due;
    moment_ = reader_.next();
  }
  sent_ = std::max(sent_, position);
  return true;
}

void PlayedLog::send(const RecordedMessage& message, bool is_last) {
  const std::size_t topic = topic_of_[message.stream];
  for (const auto& client : clients_) {
    for (Stream& stream : client->streams) {
      if (stream.topic != topic || stream.is_new != is_last) {
        continue;
      }
      if (client->connection->waiting() >= Connection::kEnoughWithin) {
        ++stream.lost;
        continue;
      }
      protocol::Answer answer;
      answer.set_id(stream.id);
      answer.mutable_messages()->set_lost(std::exchange(stream.lost, 0));
      protocol::Message& said = *answer.mutable_messages()->add_messages();
      said.set_channel(static_cast<std::uint32_t>(message.stream));
      said.set_sequence(message.info.sequence);
      said.set_publish_time_ns(base::to_ns(message.info.publish_time));
      said.set_taken_ns(base::to_ns(message.info.origin.taken));
      said.set_bytes(message.data.size());
      if (stream.has_payload) {
        said.set_payload(message.data.data(), message.data.size());
      }
      client->connection->put(answer);
    }
  }
}

}  // namespace fastcycle::playback
