#include "names/name_pattern.hpp"

#include <fmt/format.h>

#include <cstring>
#include <regex>

#include "common/error.hpp"
#include "names/names.hpp"

namespace rtcf::executor {

namespace {

// True if a repeat follows nothing, as in the shell's "*". libstdc++ reports it as a missing
// parenthesis.
bool repeatsNothing(const std::string& expression) {
    constexpr const char* kBegin = "(|";
    char before = '|';
    for (const char c : expression) {
        const bool group = before == '(' && c == '?';  // (?: and the like
        if (std::strchr("*+?", c) != nullptr && std::strchr(kBegin, before) != nullptr && !group)
            return true;
        before = c;
    }
    return false;
}

// Bounds the time and stack of a match by the length of the name times the length of the
// expression. libstdc++'s other algorithm recurses once per character and takes exponential time
// for some expressions.
constexpr auto kSyntax =
    std::regex::ECMAScript | std::regex::optimize | std::regex_constants::__polynomial;

const char* reason(std::regex_constants::error_type code, const std::string& expression = {}) {
    using namespace std::regex_constants;
    if (code == error_badrepeat || repeatsNothing(expression)) {
        return "a repeat (*, +, ?) has nothing before it; 'any text' is .*";
    }
    if (code == error_brack) return "a [ is not closed";
    if (code == error_paren) return "a ( is not closed, or a ) not opened";
    if (code == error_brace || code == error_badbrace) return "a { } is not complete";
    if (code == error_escape) return "a \\ is followed by a character that cannot be escaped";
    if (code == error_range) return "a range in [ ] is reversed";
    if (code == error_complexity || code == error_stack || code == error_space)
        return "it is too complex";
    return "it is not an ECMAScript expression";
}

}  // namespace

struct NamePattern::Expression {
    std::string text;
    std::regex regex;
};

NamePattern::NamePattern(const std::string& what, const std::string& expression) {
    if (expression.empty()) return;
    requireLength(what.c_str(), expression, kLongestPattern);
    try {
        expression_ = std::make_shared<const Expression>(
            Expression{expression, std::regex(expression, kSyntax)});
    } catch (const std::regex_error& error) {
        throw Error(ErrorKind::ExpressionInvalid,
                    fmt::format("{}: bad regular expression '{}': {}", what, expression,
                                reason(error.code(), expression)));
    }
}

const std::string& NamePattern::text() const noexcept {
    static const std::string kNothing;
    return expression_ == nullptr ? kNothing : expression_->text;
}

bool NamePattern::matches(const std::string& name) const {
    try {
        return expression_ != nullptr && std::regex_match(name, expression_->regex);
    } catch (const std::regex_error& error) {
        throw Error(ErrorKind::ExpressionInvalid,
                    fmt::format("a regular expression takes too long on '{}': {}", name,
                                reason(error.code())));
    }
}

}  // namespace rtcf::executor
