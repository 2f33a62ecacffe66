/// @file
/// A user's selection of outputs and states, with shell wildcards.
#pragma once

#include <bitset>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

namespace rtcf::executor {

class PortSelection {
   public:
    /// @param patterns e.g. "/arm/*.effort". `*` matches any characters but '/', `**` any
    /// characters, `?` one character, [abc] and [a-z] one of these. A pattern without '.' matches
    /// all outputs and states of the components. Empty = everything
    /// @throws Error if a pattern is empty or too long
    explicit PortSelection(const std::vector<std::string>& patterns);

    /// A pattern for whole names.
    class Pattern {
       public:
        explicit Pattern(const std::string& text);
        /// The text of the user.
        const std::string& given() const noexcept { return given_; }
        /// The single name that it matches; empty for a component, or a pattern with wildcards.
        const std::string& name() const noexcept { return name_; }
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
        std::string name_;
        std::vector<Element> elements_;  // empty for a single name
    };
    const std::vector<Pattern>& patterns() const noexcept { return patterns_; }
    /// @param name full name of the component, '.', and name of the output or state
    bool matches(const std::string& name) const { return rank(name) != kNone; }
    /// The index of the first pattern that matches, or kNone. Names come before the patterns and
    /// components that select several values.
    std::size_t rank(const std::string& name) const;
    static constexpr std::size_t kNone = SIZE_MAX;

   private:
    std::vector<Pattern> patterns_;
    std::vector<std::size_t> wild_;  // indices of patterns that are not single names
    // Index by single name, so that a look-up among thousands costs as little as among a few.
    std::unordered_map<std::string, std::size_t> names_;
};

}  // namespace rtcf::executor
