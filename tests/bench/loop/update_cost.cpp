// What update() takes of components of one name in two libraries, in turn, on the same inputs.
// Prints JSON. Usage: update_cost LIBRARY REFERENCE TYPE...
#include <dlfcn.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "rtcf/component.hpp"

namespace {

constexpr int kRounds = 201;
constexpr int kUpdates = 1000;       // a round's
constexpr std::size_t kInputs = 64;  // values of each input, again and again

// A component by itself, with inputs that are written before each update.
class Contender {
   public:
    Contender(const char* library, const std::string& type) {
        clock_.period_ns = 1'000'000;
        clock_.elapsed_ns = 1'000'000;
        context_.clock = &clock_;
        context_.period_ns = 1'000'000;
        component_.reset(recordOf(library, type).create(type.c_str(), &context_));
        component_->attach(context_);
        if (!component_->prepare(rtcf::Values{}) || !component_->configure())
            throw std::runtime_error(type + ": " + component_->failure());
        std::mt19937 draw(1);
        std::normal_distribution<double> normal;
        for (rtcf::InputBase* input : component_->inputs()) {
            const rtcf::TypeInfo& info = input->type();
            slots_.push_back(info.make_slot(nullptr));
            input->rewire(slots_.back().get(), false);
            // Of doubles alone.
            std::vector<double> values(kInputs * info.size / sizeof(double));
            std::generate(values.begin(), values.end(), [&] { return normal(draw); });
            values_.push_back(std::move(values));
            sizes_.push_back(info.size);
            const std::size_t header = sizeof(rtcf::SlotHeader);
            places_.push_back(reinterpret_cast<char*>(slots_.back().get()) +
                              (header + info.alignment - 1) / info.alignment * info.alignment);
        }
        if (!component_->start()) throw std::runtime_error(type + ": " + component_->failure());
    }

    // @return ns of one update
    double round() {
        const auto begin = std::chrono::steady_clock::now();
        for (int i = 0; i < kUpdates; ++i) {
            const std::size_t at = static_cast<std::size_t>(i) % kInputs;
            for (std::size_t input = 0; input < slots_.size(); ++input) {
                const std::size_t doubles = sizes_[input] / sizeof(double);
                std::memcpy(places_[input], &values_[input][at * doubles], sizes_[input]);
                ++slots_[input]->sequence;
            }
            component_->update();
        }
        const std::chrono::duration<double, std::nano> took =
            std::chrono::steady_clock::now() - begin;
        return took.count() / kUpdates;
    }

   private:
    static const rtcf::ComponentRecord& recordOf(const char* library, const std::string& type) {
        void* const opened = dlopen(library, RTLD_NOW | RTLD_LOCAL);
        if (opened == nullptr) throw std::runtime_error(dlerror());
        const auto entry = reinterpret_cast<const rtcf::PluginDescriptor* (*)()>(
            dlsym(opened, RTCF_ENTRY_POINT_NAME));
        if (entry == nullptr) throw std::runtime_error(std::string(library) + ": no components");
        for (const rtcf::ComponentRecord* each = entry()->components; each != nullptr;
             each = each->next)
            if (type == each->type) return *each;
        throw std::runtime_error(std::string(library) + " has no " + type);
    }

    rtcf::LoopClock clock_;
    rtcf::ComponentContext context_;
    std::unique_ptr<rtcf::Component> component_;
    std::vector<std::shared_ptr<rtcf::SlotHeader>> slots_;
    std::vector<std::vector<double>> values_;
    std::vector<std::size_t> sizes_;
    std::vector<char*> places_;
};

double median(std::vector<double> values) {
    std::nth_element(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc < 4) {
        std::fputs("usage: update_cost LIBRARY REFERENCE TYPE...\n", stderr);
        return 2;
    }
    std::vector<std::string> rows;
    for (int i = 3; i < argc; ++i) {
        Contender ours(argv[1], argv[i]);
        Contender reference(argv[2], argv[i]);
        std::vector<double> our_rounds;
        std::vector<double> reference_rounds;
        for (int round = 0; round < kRounds; ++round) {
            our_rounds.push_back(ours.round());
            reference_rounds.push_back(reference.round());
        }
        rows.push_back(fmt::format(R"({{"type": "{}", "ns": {:.2f}, "reference_ns": {:.2f}}})",
                                   argv[i], median(our_rounds), median(reference_rounds)));
    }
    fmt::print("{{\"rounds\": {}, \"updates\": {}, \"types\": [{}]}}\n", kRounds, kUpdates,
               fmt::join(rows, ", "));
    return 0;
} catch (const std::exception& error) {
    fmt::print(stderr, "update_cost: {}\n", error.what());
    return 1;
}
