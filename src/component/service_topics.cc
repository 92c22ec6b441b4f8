#include "component/service_topics.h"

namespace fastcycle::detail {

std::string request_topic(const std::string& service) {
  return service + std::string(kRequestTopic);
}
std::string reply_topic(const std::string& service, const std::string& client) {
  return service + "#reply/" + client;
}
std::string feedback_topic(const std::string& service, const std::string& client) {
  return service + "#feedback/" + client;
}

}  // namespace fastcycle::detail
