/// @file
/// Which outputs and states somebody watches, as a person writes it: with the wildcards of a shell.
#pragma once

#include <bitset>
#include <climits>
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

    /// Of whole names.
    class Pattern {
       public:
        explicit Pattern(const std::string& text);
        /// What was asked for.
        const std::string& given() const noexcept { return given_; }
        /// @param name as of PortSelection::matches()
        bool matches(const std::string& name) const;

       private:
        // What one character may be, or any number of them.
        struct Element {
            std::bitset<UCHAR_MAX + 1> characters;
            bool many;
        };
        void add(const Element& element);

        std::string given_;
        std::vector<Element> elements_;
    };
    const std::vector<Pattern>& patterns() const noexcept { return patterns_; }
    /// @param name full name of the component, '.', and of the output or state
    bool matches(const std::string& name) const;

   private:
    std::vector<Pattern> patterns_;
};

}  // namespace rtcf::executor
