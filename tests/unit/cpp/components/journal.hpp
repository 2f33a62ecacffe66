/// @file
/// The reports of the test components to the test that loaded them. The test
/// program owns the single journal; component libraries find it as a symbol of
/// the program. Writing is wait-free, so that the real-time thread can write.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace rtcf_unit_test {

class Journal {
   public:
    /// Adds a note, e.g. "/H1 start". Real-time safe, any thread.
    void note(const std::string& component, const char* what) noexcept {
        const std::size_t index = used_.fetch_add(1);
        if (index >= entries_.size()) return;
        Entry& entry = entries_[index];
        std::strncpy(entry.component.data(), component.c_str(), entry.component.size() - 1);
        entry.what = what;
        entry.complete.store(true, std::memory_order_release);
    }

    /// All notes so far, in order.
    std::vector<std::string> notes() const {
        std::vector<std::string> result;
        for (const Entry& entry : entries_) {
            if (!entry.complete.load(std::memory_order_acquire)) break;
            result.push_back(std::string(entry.component.data()) + " " + entry.what);
        }
        return result;
    }

    /// The number of occurrences of a note.
    std::size_t count(const std::string& note_text) const {
        std::size_t result = 0;
        for (const std::string& line : notes()) result += line == note_text ? 1 : 0;
        return result;
    }

    /// Removes all notes; only while no component runs.
    void clear() {
        for (Entry& entry : entries_) {
            entry.component.fill('\0');
            entry.complete.store(false);
        }
        used_.store(0);
        gate_open.store(true);
        copies_throw.store(false);
    }

    /// Blocker's hooks wait until it is open.
    std::atomic<bool> gate_open{true};
    /// Whether copying the values of Touchy's ports fails.
    std::atomic<bool> copies_throw{false};

   private:
    struct Entry {
        std::array<char, 48> component{};
        const char* what = "";
        std::atomic<bool> complete{false};
    };
    std::array<Entry, 4096> entries_;
    std::atomic<std::size_t> used_{0};
};

}  // namespace rtcf_unit_test

/// The journal of the program; libraries see a null function without one.
extern "C" __attribute__((weak, visibility("default"))) rtcf_unit_test::Journal*
rtcf_unit_test_journal();
