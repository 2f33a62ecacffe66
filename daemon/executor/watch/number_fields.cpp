#include "watch/number_fields.hpp"

#include <cstring>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>

namespace rtcf::executor {

namespace {

const std::map<std::string, NumberKind> kRosNumbers{
    {"bool", NumberKind::Bool},       {"int8", NumberKind::Int8},
    {"byte", NumberKind::Int8},       {"uint8", NumberKind::UInt8},
    {"char", NumberKind::UInt8},      {"int16", NumberKind::Int16},
    {"uint16", NumberKind::UInt16},   {"int32", NumberKind::Int32},
    {"uint32", NumberKind::UInt32},   {"int64", NumberKind::Int64},
    {"uint64", NumberKind::UInt64},   {"float32", NumberKind::Float32},
    {"float64", NumberKind::Float64},
};

const std::map<std::string, NumberKind> kStateNumbers{
    {"bool", NumberKind::Bool},     {"int8", NumberKind::Int8},      {"uint8", NumberKind::UInt8},
    {"int16", NumberKind::Int16},   {"uint16", NumberKind::UInt16},  {"int32", NumberKind::Int32},
    {"uint32", NumberKind::UInt32}, {"int64", NumberKind::Int64},    {"uint64", NumberKind::UInt64},
    {"float", NumberKind::Float32}, {"double", NumberKind::Float64},
};

bool isNameCharacter(char character) {
    return (character >= 'a' && character <= 'z') || (character >= 'A' && character <= 'Z') ||
           (character >= '0' && character <= '9') || character == '_' || character == '/';
}

// One field of a definition.
struct Line {
    std::string type;
    bool array = false;
    std::optional<std::size_t> length;  // of an array of fixed length
};

// Parses a line; unset if it is not a field but a constant, a comment or empty.
std::optional<Line> fieldOf(std::string text) {
    text = text.substr(0, text.find('#'));
    std::istringstream words(text);
    std::string type;
    std::string name;
    std::string more;
    words >> type >> name >> more;
    if (name.empty() || !more.empty() || name.find('=') != std::string::npos) return std::nullopt;
    Line line;
    const std::size_t bracket = type.find('[');
    line.type = type.substr(0, bracket);
    if (bracket != std::string::npos) {
        line.array = true;
        const std::string length = type.substr(bracket + 1, type.size() - bracket - 2);
        if (!length.empty()) line.length = std::stoul(length);
    }
    return line;
}

// Walks through one message by its definition.
class Walk {
   public:
    Walk(const std::string& definition, const std::string& sample) : sample_(sample) {
        std::istringstream lines(definition);
        std::string name;
        bool head = false;
        for (std::string line; std::getline(lines, line);) {
            if (line.size() > 1 && line.find_first_not_of('=') == std::string::npos) {
                head = true;
            } else if (head) {
                head = false;
                const std::size_t begin = line.find(':') + 1;
                name.clear();
                for (std::size_t i = begin; i < line.size(); ++i)
                    if (isNameCharacter(line[i])) name += line[i];
            } else if (const std::optional<Line> field = fieldOf(line)) {
                types_[name].push_back(*field);
            }
        }
    }

    std::vector<NumberField> all() {
        message("");
        if (at_ != sample_.size())
            throw std::invalid_argument("a message does not match its definition");
        return std::move(fields_);
    }

   private:
    void message(const std::string& name) {
        const auto found = types_.find(name);
        if (found == types_.end()) return;  // std_msgs/Empty
        const std::string package = name.substr(0, name.find('/'));
        for (const Line& line : found->second) {
            std::size_t count = 1;
            if (line.array) count = line.length ? *line.length : length();
            if (const auto number = kRosNumbers.find(line.type); number != kRosNumbers.end()) {
                take(number->second, count);
            } else if (line.type == "time") {
                take(NumberKind::UInt32, 2 * count);
            } else if (line.type == "duration") {
                take(NumberKind::Int32, 2 * count);
            } else if (line.type == "string") {
                for (std::size_t i = 0; i < count; ++i) skip(length());
            } else {
                const std::string inner = resolve(line.type, package);
                for (std::size_t i = 0; i < count; ++i) message(inner);
            }
        }
    }

    std::string resolve(const std::string& type, const std::string& package) const {
        if (type == "Header") return "std_msgs/Header";
        if (type.find('/') != std::string::npos) return type;
        if (types_.count(package + "/" + type) != 0) return package + "/" + type;
        for (const auto& [name, lines] : types_) {
            const std::size_t slash = name.find('/');
            if (slash != std::string::npos && name.compare(slash + 1, std::string::npos, type) == 0)
                return name;
        }
        return type;
    }

    void take(NumberKind kind, std::size_t count) {
        if (count != 0) fields_.push_back({kind, at_, count});
        skip(sizeOf(kind) * count);
    }

    void skip(std::size_t bytes) {
        if (bytes > sample_.size() - at_)
            throw std::invalid_argument("a message is shorter than its definition");
        at_ += bytes;
    }

    std::uint32_t length() {
        const std::size_t at = at_;
        std::uint32_t result = 0;
        skip(sizeof result);
        std::memcpy(&result, sample_.data() + at, sizeof result);
        return result;
    }

    const std::string& sample_;
    std::map<std::string, std::vector<Line>> types_;
    std::vector<NumberField> fields_;
    std::size_t at_ = 0;
};

}  // namespace

std::size_t sizeOf(NumberKind kind) noexcept {
    switch (kind) {
        case NumberKind::Bool:
        case NumberKind::Int8:
        case NumberKind::UInt8:
            return 1;
        case NumberKind::Int16:
        case NumberKind::UInt16:
            return 2;
        case NumberKind::Int32:
        case NumberKind::UInt32:
        case NumberKind::Float32:
            return 4;
        case NumberKind::Int64:
        case NumberKind::UInt64:
        case NumberKind::Float64:
            break;
    }
    return 8;
}

std::vector<NumberField> numbersOfMessage(const std::string& definition,
                                          const std::string& sample) {
    return Walk(definition, sample).all();
}

std::vector<NumberField> numbersOfState(const std::string& type, std::size_t size) {
    if (type == "quaternion" || type == "transform") {
        const std::size_t count = type == "quaternion" ? 4 : 16;
        const bool doubles = size == 8 * count;
        return {{doubles ? NumberKind::Float64 : NumberKind::Float32, 0, count}};
    }
    const auto found = kStateNumbers.find(type.substr(0, type.find('[')));
    if (found == kStateNumbers.end()) return {};
    return {{found->second, 0, size / sizeOf(found->second)}};
}

}  // namespace rtcf::executor
