#include "live/message.h"

#include <stdexcept>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "archive/message_text.h"
#include "live/session.h"

namespace fastcycle::tool::live {

std::string serialized_from_json(const archive::MessageType& type, const std::string& json) {
  try {
    return type.parse_json(json)->SerializePartialAsString();
  } catch (const std::runtime_error& error) {
    std::string fields;
    for (int i = 0; i < type.descriptor().field_count(); ++i) {
      fields += (i == 0 ? "" : ", ") + type.descriptor().field(i)->name();
    }
    throw Failure(kWrong, "this is no " + type.descriptor().full_name() + ": " +
                              archive::printable(error.what()) +
                              "; its fields are: " + (fields.empty() ? "none" : fields));
  }
}

}  // namespace fastcycle::tool::live
