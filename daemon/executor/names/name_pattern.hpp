/// @file
/// A regular expression for names: ECMAScript, and it must match the whole name. Not real-time.
#pragma once

#include <memory>
#include <string>

namespace rtcf::executor {

class NamePattern {
   public:
    /// Matches nothing.
    NamePattern() = default;
    /// @param what purpose of the expression, for errors, e.g. "ignore of /H1"
    /// @param expression empty = matches nothing
    /// @throws Error that names the purpose, the expression and its error
    NamePattern(const std::string& what, const std::string& expression);

    bool matches(const std::string& name) const;
    /// The expression; empty = matches nothing.
    const std::string& text() const noexcept;

   private:
    struct Expression;
    std::shared_ptr<const Expression> expression_;  // immutable, shared by copies
};

}  // namespace rtcf::executor
