/// @file
/// A user's selection of outputs and states, with shell wildcards.
#pragma once

#include <bitset>
#include <climits>
#include <string>
#include <vector>

namespace rtcf::executor {

class PortSelection {
   public:
    /// @param patterns e.g. "/arm/*.effort". `*` matches any characters but '/', `**` any
    /// characters, `?` one character, [abc] and [a-z] one of these. A pattern without '.' matches
    /// all outputs and states of the components. Empty = everything
    /// @throws Refusal if a pattern is empty or too long
    ///                 [abc] and [a-z] one of these. Without '.' it means all of such components.
    ///                 Empty = everything
    /// @throws Refusal of one that is empty or too long
    explicit PortSelection(const std::vector<std::string>& patterns);

    /// A pattern for whole names.
    class Pattern {
       public:
        explicit Pattern(const std::string& text);
        /// The text of the user.
        const std::string& given() const noexcept { return given_; }
        /// @param name see PortSelection::matches()
        bool matches(const std::string& name) const;

       private:
        // Matches one character of a set, or any number of them.
        struct Element {
            std::bitset<UCHAR_MAX + 1> characters;
            bool many;
        };
        void add(const Element& element);

        std::string given_;
        std::vector<Element> elements_;
    };
    const std::vector<Pattern>& patterns() const noexcept { return patterns_; }
    /// @param name full name of the component, '.', and name of the output or state
    bool matches(const std::string& name) const;

   private:
    std::vector<Pattern> patterns_;
};

}  // namespace rtcf::executor
