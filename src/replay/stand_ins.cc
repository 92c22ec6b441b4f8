#include "replay/stand_ins.h"

#include <algorithm>
#include <set>
#include <utility>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "component/component_host.h"
#include "component/declare.h"
#include "component/service_topics.h"
#include "replay/stand_in.h"

namespace fastcycle::host {

StandIns::StandIns(ComponentClasses& classes, config::ApplicationDescription description,
                   const std::vector<record::RecordedStream>& streams)
    : classes_(classes), description_(std::move(description)) {
  std::set<std::string> known;
  for (const config::ComponentDescription& component : description_.components) {
    known.insert(component.name);
  }
  for (const record::RecordedStream& stream : streams) {
    if (stream.publisher.empty() || stream.encoding != "protobuf" ||
        known.contains(stream.publisher)) {
      continue;
    }
    if (streams_[stream.publisher].empty()) {
      config::ComponentDescription added;
      added.name = stream.publisher;
      added.params = config::Value::object_at(description_.shared_params);
      added.place = description_.place;
      description_.components.push_back(std::move(added));
    }
    streams_[stream.publisher].push_back(stream);
    auto topic =
        std::ranges::find(description_.topics, stream.topic, &config::TopicDescription::name);
    if (topic == description_.topics.end()) {
      config::TopicDescription added;
      added.name = stream.topic;
      added.place = description_.place;
      topic = description_.topics.insert(topic, std::move(added));
    }
    topic->multiple_publishers = true;
  }
}

const ComponentClass* StandIns::find(const config::ComponentDescription& component,
                                     config::Problems& problems) {
  return streams_.contains(component.name) ? &stand_in_class() : classes_.find(component, problems);
}

void StandIns::declare(detail::ComponentCore& component) const {
  for (const record::RecordedStream& stream : streams_.at(component.name)) {
    const auto* type =
        google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(stream.type);
    if (type == nullptr) {
      continue;
    }
    if (stream.topic.ends_with(detail::kRequestTopic)) {
      component.application.wiring().topics().set_options(stream.topic,
                                                          detail::kRequestTopicOptions);
    }
    static_cast<void>(fastcycle::detail::declare_publisher(
        component, stream.topic,
        *google::protobuf::MessageFactory::generated_factory()->GetPrototype(type), nullptr, true));
  }
}

}  // namespace fastcycle::host
