#include "config/parse.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "base/utf8.h"

namespace fastcycle::config {

namespace {

/// Closes a file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) {
      ::close(number_);
    }
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int number() const { return number_; }

 private:
  int number_;
};

std::string reason_of(int error) {
  return std::generic_category().message(error);
}

// Empty if the file can be read.
std::string why_not_readable(int descriptor) {
  struct stat status{};
  if (::fstat(descriptor, &status) != 0) {
    return reason_of(errno);
  }
  if (S_ISDIR(status.st_mode)) {
    return "it is a folder";
  }
  if (!S_ISREG(status.st_mode)) {
    return "it is not a regular file";
  }
  if (status.st_size > static_cast<off_t>(kMaxFileBytes)) {
    return "it is larger than 16 MiB";
  }
  return {};
}

// Reads to the end, or one byte beyond the limit: a file may grow while it is read.
std::string read_all(int descriptor, std::string& content) {
  std::vector<char> block(std::size_t{64} << 10U);
  while (content.size() <= kMaxFileBytes) {
    const ssize_t count = ::read(descriptor, block.data(), block.size());
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return reason_of(errno);
    }
    if (count == 0) {
      return {};
    }
    content.append(block.data(), static_cast<std::size_t>(count));
  }
  return "it is larger than 16 MiB";
}

int line_at(std::string_view text, std::size_t position) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(position, text.size()));
  return 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
}

/// Checks the encoding before parsing.
std::optional<Problem> encoding_error(std::string_view text, const std::string& name) {
  if (text.starts_with("\xEF\xBB\xBF")) {
    return make_error({name, 1, ""}, "the file begins with a byte order mark",
                      "save it as UTF-8 without one");
  }
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    return make_error({name, 1, ""}, "the file is UTF-16", "save it as UTF-8");
  }
  for (std::size_t position = 0; position < text.size();) {
    if (text[position] == '\0') {
      return make_error({name, line_at(text, position), ""}, "the file has a NUL byte");
    }
    const std::size_t length = base::utf8_length(text.substr(position));
    if (length == 0) {
      return make_error({name, line_at(text, position), ""}, "the file is not UTF-8");
    }
    position += length;
  }
  return std::nullopt;
}

/// An iterator over the text that exposes the parser's position. The parser's own events have no
/// lines.
struct CountingIterator {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  reference operator*() const { return *at; }
  CountingIterator& operator++() {
    ++at;
    ++*count;
    return *this;
  }
  CountingIterator operator++(int) {
    const CountingIterator before = *this;
    ++*this;
    return before;
  }
  friend bool operator==(const CountingIterator& a, const CountingIterator& b) {
    return a.at == b.at;
  }

  const char* at;
  std::size_t* count;
};

/// Builds the tree from the parser's events.
///
/// Invariant: `open_` holds the containers that are not closed yet, outermost first, each with the
/// key that its next value gets.
class TreeBuilder final : public nlohmann::json_sax<nlohmann::json> {
 public:
  TreeBuilder(std::string_view text, std::shared_ptr<const Source> source, const std::size_t& read,
              Problems& problems)
      : text_(text), source_(std::move(source)), read_(read), problems_(problems) {}

  bool null() override { return take(std::monostate{}); }
  bool boolean(bool value) override { return take(value); }
  bool number_integer(std::int64_t value) override { return take(value); }
  bool number_unsigned(std::uint64_t value) override { return take(value); }

  bool number_float(double value, const std::string& token) override {
    if (token.find_first_of(".eE") == std::string::npos) {
      return refuse("the integer " + cut_token(token) + " needs more than 64 bits");
    }
    return take(value);
  }

  bool string(std::string& value) override {
    // It would end a path or a name early wherever the system takes it.
    if (value.find('\0') != std::string::npos) {
      return refuse("a string has a NUL character");
    }
    return take(std::move(value));
  }

  bool binary(nlohmann::json::binary_t& /*value*/) override { return false; }
  bool start_object(std::size_t /*size*/) override { return open(Value::Object{}); }
  bool start_array(std::size_t /*size*/) override { return open(Value::Array{}); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(std::string& key) override {
    Open& object = open_.back();
    if (key.size() > kMaxKeyBytes) {
      return refuse("the key " + in_quotes(key) + " is longer than 256 bytes");
    }
    if (object.lines.size() >= kMaxKeysOfObject) {
      return refuse("the object has more than 10000 keys");
    }
    object.key = std::move(key);
    object.has_key = true;
    const auto [first, is_new] = object.lines.emplace(object.key, line());
    object.is_duplicate = !is_new;
    if (!is_new) {
      problems_.add(make_error({source_->name, line(), next_pointer()},
                               "the key " + in_quotes(object.key) +
                                   " is given twice, first in line " +
                                   std::to_string(first->second)));
    }
    return true;
  }

  bool parse_error(std::size_t position, const std::string& last_token,
                   const nlohmann::detail::exception& error) override {
    const Place place{source_->name, line_at(text_, position == 0 ? 0 : position - 1),
                      next_pointer()};
    if (error.id == 406) {
      problems_.add(make_error(place, "the number " + cut_token(last_token) + " is out of range"));
    } else {
      problems_.add(make_error(place, "this is not JSON: " + reason_of(error), hint_for(position)));
    }
    return false;
  }

  [[nodiscard]] std::optional<Value> take_result() { return std::move(result_); }

 private:
  struct Open {
    Value value;
    std::string key;
    bool has_key = false;
    bool is_duplicate = false;
    std::unordered_map<std::string, int> lines;  // Where each key was seen first.
  };

  // The parser has read up to one character beyond the token, which may be a line's end.
  int line() {
    const std::size_t end = read_ == 0 ? 0 : read_ - 1;
    const auto at = [&](std::size_t index) {
      return text_.begin() + static_cast<std::ptrdiff_t>(index);
    };
    if (end > counted_) {
      line_ += static_cast<int>(std::count(at(counted_), at(end), '\n'));
      counted_ = end;
    }
    return line_;
  }

  [[nodiscard]] std::string next_pointer() const {
    if (open_.empty()) {
      return {};
    }
    const Open& parent = open_.back();
    const std::string& parent_pointer = parent.value.pointer();
    if (parent.value.is_object() && !parent.has_key) {
      return parent_pointer;
    }
    return pointer_to(parent_pointer,
                      parent.value.is_array() ? std::to_string(parent.value.size()) : parent.key);
  }

  Value make(Value::Content content) {
    return Value(std::move(content), {source_, line(), next_pointer()});
  }

  bool refuse(std::string message) {
    problems_.add(make_error({source_->name, line(), next_pointer()}, std::move(message)));
    return false;
  }

  bool take(Value::Content content) {
    if (++value_count_ > kMaxValues) {
      return refuse("the file has more than a million values");
    }
    put(make(std::move(content)));
    return true;
  }

  bool open(Value::Content content) {
    if (open_.size() >= kMaxDepth) {
      return refuse("the values are nested deeper than 64");
    }
    if (++value_count_ > kMaxValues) {
      return refuse("the file has more than a million values");
    }
    open_.push_back({.value = make(std::move(content)), .key = {}, .lines = {}});
    return true;
  }

  bool close() {
    Value value = std::move(open_.back().value);
    open_.pop_back();
    put(std::move(value));
    return true;
  }

  // Of a key that is given twice the first value stands.
  void put(Value value) {
    if (open_.empty()) {
      result_ = std::move(value);
      return;
    }
    Open& parent = open_.back();
    if (parent.value.is_array()) {
      parent.value.items().push_back(std::move(value));
    } else if (!parent.is_duplicate) {
      parent.value.members().push_back({parent.key, std::move(value)});
    }
    parent.has_key = false;
    parent.is_duplicate = false;
  }

  static std::string cut_token(const std::string& token) {
    return token.size() <= 40 ? token : token.substr(0, 40) + "…";
  }

  // The parser's message without its own name and place: "[…] parse error at line 3, column 5: …".
  static std::string reason_of(const nlohmann::detail::exception& error) {
    std::string reason = error.what();
    const std::size_t column = reason.find("column ");
    const std::size_t colon = reason.find(": ", column == std::string::npos ? 0 : column);
    if (colon != std::string::npos) {
      reason.erase(0, colon + 2);
    }
    for (char& c : reason) {
      c = static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
    return reason.size() <= 200 ? reason : "…" + reason.substr(reason.size() - 200);
  }

  [[nodiscard]] std::string hint_for(std::size_t position) const {
    if (position == 0 || position > text_.size()) {
      return open_.empty() ? "" : "the file ends too early";
    }
    const char last = text_[position - 1];
    const std::size_t before = text_.substr(0, position - 1).find_last_not_of(" \t\r\n");
    if ((last == '}' || last == ']') && before != std::string_view::npos && text_[before] == ',') {
      return "the last item is not followed by a comma";
    }
    return {};
  }

  std::string_view text_;
  std::shared_ptr<const Source> source_;
  const std::size_t& read_;
  Problems& problems_;

  std::vector<Open> open_;
  std::optional<Value> result_;
  std::size_t value_count_ = 0;
  std::size_t counted_ = 0;  // The text before has been searched for line ends …
  int line_ = 1;             // … and this is the line there.
};

}  // namespace

std::optional<std::string> read_file(const std::filesystem::path& file, const Place& asked_at,
                                     Problems& problems) {
  const Place place = asked_at.file.empty() ? Place{file.string(), 0, ""} : asked_at;
  const auto fail = [&](const std::string& reason) {
    problems.add(
        make_error(place, "cannot read " + in_quotes(file.string(), 4096) + ": " + reason));
    return std::nullopt;
  };
  // O_NONBLOCK: opening a FIFO without a writer returns at once instead of waiting for one.
  const Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  if (descriptor.number() < 0) {
    return fail(reason_of(errno));
  }
  if (std::string reason = why_not_readable(descriptor.number()); !reason.empty()) {
    return fail(reason);
  }
  std::string content;
  if (std::string reason = read_all(descriptor.number(), content); !reason.empty()) {
    return fail(reason);
  }
  return content;
}

std::optional<Value> parse(std::string_view text, const std::shared_ptr<const Source>& source,
                           Problems& problems) {
  if (auto problem = encoding_error(text, source->name)) {
    problems.add(std::move(*problem));
    return std::nullopt;
  }
  std::size_t read = 0;
  TreeBuilder builder(text, source, read, problems);
  const CountingIterator begin{text.data(), &read};
  const CountingIterator end{text.data() + text.size(), &read};
  constexpr bool kUntilTheEnd = true;
  constexpr bool kIgnoreComments = true;
  if (!nlohmann::json::sax_parse(begin, end, &builder, nlohmann::json::input_format_t::json,
                                 kUntilTheEnd, kIgnoreComments)) {
    return std::nullopt;
  }
  return builder.take_result();
}

std::optional<Value> parse_file(const std::filesystem::path& file, const Place& asked_at,
                                Problems& problems) {
  const auto content = read_file(file, asked_at, problems);
  if (!content) {
    return std::nullopt;
  }
  const auto source =
      std::make_shared<const Source>(Source{file.string(), file.parent_path(), true});
  return parse(*content, source, problems);
}

Value parse_option(const std::string& text, const std::string& option) {
  const auto source = std::make_shared<const Source>(Source{option, {}, false});
  Problems not_json;
  auto value = parse(text, source, not_json);
  return value && !not_json.has_errors() ? *value : Value(text, {source, 0, ""});
}

}  // namespace fastcycle::config
