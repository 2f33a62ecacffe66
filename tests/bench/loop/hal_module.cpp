#include "hal_module.hpp"

#include <dlfcn.h>

#include <array>
#include <cstdarg>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>

namespace rtcf::bench {
namespace {

// Pins and functions of the modules of this process.
struct Declared {
    std::map<std::string, volatile double*> numbers;
    std::map<std::string, volatile bool*> bits;
    std::map<std::string, volatile unsigned*> wholes;
    void (*function)(void*, long) = nullptr;  // the last one
    void* argument = nullptr;
};

Declared& declared() {
    static Declared all;
    return all;
}

std::string formatted(const char* format, va_list words) {
    std::array<char, 128> text{};
    std::vsnprintf(text.data(), text.size(), format, words);
    return text.data();
}

// Never freed: a module keeps its pins to the end.
template <typename T>
volatile T* addTo(std::map<std::string, volatile T*>& all, const std::string& name) {
    return all[name] = new T{};
}

template <typename T>
volatile T& find(const std::map<std::string, volatile T*>& all, const std::string& name) {
    const auto found = all.find(name);
    if (found == all.end()) throw std::runtime_error("no pin " + name + " of its type");
    return *found->second;
}

}  // namespace

HalModule::HalModule(const std::string& file) {
    void* const opened = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (opened == nullptr) throw std::runtime_error(dlerror());
    const auto begin = reinterpret_cast<int (*)()>(dlsym(opened, "rtapi_app_main"));
    if (begin == nullptr) throw std::runtime_error(file + " is not a module of HAL");
    // Modules that have a parameter num_chan make no instance without it.
    if (auto** const count = static_cast<int**>(dlsym(opened, "rtapi_info_address_num_chan")))
        **count = 1;
    declared().function = nullptr;
    if (begin() != 0 || declared().function == nullptr)
        throw std::runtime_error(file + " does not start");
    function_ = declared().function;
    argument_ = declared().argument;
}

volatile double& HalModule::number(const std::string& name) const {
    return find(declared().numbers, name);
}
volatile bool& HalModule::bit(const std::string& name) const { return find(declared().bits, name); }
volatile unsigned& HalModule::whole(const std::string& name) const {
    return find(declared().wholes, name);
}

}  // namespace rtcf::bench

// The functions of rtapi(3) and hal(3) that the modules call.
extern "C" {

int hal_init(const char*) { return 1; }
int hal_ready(int) { return 0; }
int hal_exit(int) { return 0; }
void* hal_malloc(long size) {
    return std::aligned_alloc(64, (static_cast<std::size_t>(size) + 63) / 64 * 64);
}

int hal_export_funct(const char*, void (*function)(void*, long), void* argument, int, int, int) {
    rtcf::bench::declared().function = function;
    rtcf::bench::declared().argument = argument;
    return 0;
}

int hal_pin_float_newf(int, volatile double** pin, int, const char* format, ...) {
    va_list words;
    va_start(words, format);
    *pin =
        rtcf::bench::addTo(rtcf::bench::declared().numbers, rtcf::bench::formatted(format, words));
    va_end(words);
    return 0;
}
int hal_pin_bit_newf(int, volatile bool** pin, int, const char* format, ...) {
    va_list words;
    va_start(words, format);
    *pin = rtcf::bench::addTo(rtcf::bench::declared().bits, rtcf::bench::formatted(format, words));
    va_end(words);
    return 0;
}
int hal_pin_u32_newf(int, volatile unsigned** pin, int, const char* format, ...) {
    va_list words;
    va_start(words, format);
    *pin =
        rtcf::bench::addTo(rtcf::bench::declared().wholes, rtcf::bench::formatted(format, words));
    va_end(words);
    return 0;
}
int hal_pin_s32_newf(int, volatile int** pin, int, const char*, ...) {
    *pin = new int{};
    return 0;
}
int hal_param_float_newf(int, volatile double* place, int, const char* format, ...) {
    va_list words;
    va_start(words, format);
    rtcf::bench::declared().numbers[rtcf::bench::formatted(format, words)] = place;
    va_end(words);
    return 0;
}

void rtapi_print_msg(int, const char* format, ...) {
    va_list words;
    va_start(words, format);
    std::vfprintf(stderr, format, words);
    va_end(words);
}
int rtapi_snprintf(char* text, unsigned long size, const char* format, ...) {
    va_list words;
    va_start(words, format);
    const int written = std::vsnprintf(text, size, format, words);
    va_end(words);
    return written;
}
int rtapi_get_msg_level() { return 1; }
int rtapi_set_msg_level(int) { return 0; }

}  // extern "C"
