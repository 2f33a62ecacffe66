#include "names/name_pattern.hpp"

#include <fmt/format.h>

#include <cstring>
#include <regex>

#include "common/refusal.hpp"
#include "names/names.hpp"

namespace rtcf::executor {

namespace {

// The shell's way to write 'any text'; libstdc++ takes it for a missing parenthesis.
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

// Time and stack that a match takes grow with the name's length times the expression's, and no
// more: libstdc++'s other way recurses once for each character, and takes for ever on some.
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
    if (code == error_escape) return "a \\ stands before what cannot be escaped";
    if (code == error_range) return "a range in [ ] is the wrong way round";
    if (code == error_complexity || code == error_stack || code == error_space)
        return "it is too complex";
    return "it is not an ECMAScript expression";
}

}  // namespace

struct NamePattern::Expression {
    std::regex regex;
};

NamePattern::NamePattern(const std::string& what, const std::string& expression) {
    if (expression.empty()) return;
    requireLength(what.c_str(), expression, kLongestPattern);
    try {
        expression_ =
            std::make_shared<const Expression>(Expression{std::regex(expression, kSyntax)});
    } catch (const std::regex_error& error) {
        throw Refusal(RefusalKind::ExpressionInvalid,
                      fmt::format("{}: bad regular expression '{}': {}", what, expression,
                                  reason(error.code(), expression)));
    }
}

bool NamePattern::matches(const std::string& name) const {
    try {
        return expression_ != nullptr && std::regex_match(name, expression_->regex);
    } catch (const std::regex_error& error) {
        throw Refusal(RefusalKind::ExpressionInvalid,
                      fmt::format("a regular expression takes too long on '{}': {}", name,
                                  reason(error.code())));
    }
}

}  // namespace rtcf::executor
