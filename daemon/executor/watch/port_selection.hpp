/// @file
/// Which outputs and states somebody watches, as a person writes it: with the wildcards of a shell.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtcf::executor {

class PortSelection {
   public:
    /// @param patterns e.g. "/arm/*.effort": `*` stops at '/', `**` does not, `?` is one character,
    ///                 [abc] and [a-z] one of these. Without '.' it means all of such components.
    ///                 Empty = everything
    /// @throws Refusal of one that is empty or too long
    explicit PortSelection(const std::vector<std::string>& patterns);

    struct Pattern {
        std::string given;
        std::string full;  ///< of whole names
    };
    const std::vector<Pattern>& patterns() const noexcept { return patterns_; }
    /// @param name full name of the component, '.', and of the output or state
    bool matches(const std::string& name) const;
    static bool matches(const std::string& pattern, const std::string& name);

   private:
    std::vector<Pattern> patterns_;
};

}  // namespace rtcf::executor
