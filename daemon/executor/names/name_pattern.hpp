/// @file
/// A regular expression over names as users write it: ECMAScript, and it must
/// match a whole name. Not real-time.
#pragma once

#include <memory>
#include <string>

namespace rtcf::executor {

class NamePattern {
   public:
    /// Matches nothing.
    NamePattern() = default;
    /// @param what what the expression is for, e.g. "ignore of /H1"
    /// @param expression empty = matches nothing
    /// @throws Refusal naming both, and where the expression goes wrong
    NamePattern(const std::string& what, const std::string& expression);

    bool matches(const std::string& name) const;

   private:
    struct Expression;
    std::shared_ptr<const Expression> expression_;  // immutable, shared by copies
};

}  // namespace rtcf::executor
