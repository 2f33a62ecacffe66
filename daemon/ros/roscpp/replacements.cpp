#include "ros/roscpp/replacements.hpp"

#include <dlfcn.h>
#include <link.h>

#include <cstring>
#include <string_view>

namespace rtcf::ros1 {

namespace {

// A loaded library and its read-only segments.
struct Loaded {
    const char* part;  // part of its file name
    std::string file;
    std::vector<std::string_view> constant;
};

int find(dl_phdr_info* info, std::size_t /*size*/, void* data) {
    auto& wanted = *static_cast<Loaded*>(data);
    if (info->dlpi_name == nullptr || std::strstr(info->dlpi_name, wanted.part) == nullptr)
        return 0;
    wanted.file = info->dlpi_name;
    for (int i = 0; i < info->dlpi_phnum; ++i) {
        const ElfW(Phdr) & segment = info->dlpi_phdr[i];
        const bool constant = segment.p_type == PT_LOAD && (segment.p_flags & PF_W) == 0 &&
                              (segment.p_flags & PF_R) != 0;
        if (!constant) continue;
        // NOLINTNEXTLINE(performance-no-int-to-ptr): address from the loader
        const auto* begin = reinterpret_cast<const char*>(info->dlpi_addr + segment.p_vaddr);
        wanted.constant.emplace_back(begin, segment.p_memsz);
    }
    return 1;
}

// True if the library has a function of this name, and callers by name get ours.
bool isReplaced(const char* name, const Loaded& library) {
    void* const ours = dlsym(RTLD_DEFAULT, name);
    Dl_info there{};
    Dl_info here{};
    if (ours == nullptr || dladdr(ours, &there) == 0 ||
        dladdr(reinterpret_cast<void*>(&dependences), &here) == 0 ||
        there.dli_fbase != here.dli_fbase)
        return false;
    void* const handle = dlopen(library.file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
    if (handle == nullptr) return false;
    void* const theirs = dlsym(handle, name);
    dlclose(handle);
    return theirs != nullptr && theirs != ours;
}

}  // namespace

const std::vector<Dependence>& dependences() {
    constexpr const char* kRoscpp = "libroscpp.so";
    constexpr const char* kRosconsole = "librosconsole";
    constexpr const char* kLevels = "levels of loggers, ROS_* messages in the log";
    constexpr const char* kRejections = "reports of rejected connections";
    constexpr const char* kNetworkMemory = "limits on network memory";
    constexpr auto kFunction = Dependence::Kind::Function;
    static const std::vector<Dependence> list{
        {kFunction,
         "_ZN3ros6master7executeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKN6XmlRpc"
         "11XmlRpcValueERSA_SD_b",
         kRoscpp, "timeouts of calls to the ROS master, and registrations"},
        {kFunction, "_ZN3ros9this_node12getNamespaceB5cxx11Ev", kRoscpp,
         "names of components' topics and parameters outside a namespace"},
        {kFunction, "_ZN3ros12TransportTCP12setKeepAliveEbjjj", kRoscpp,
         "detection of a cut cable within seconds"},
        {kFunction, "_ZN3ros22TransportPublisherLink12onRetryTimerERKNS_16SteadyTimerEventE",
         kRoscpp, "reconnection within seconds after a cut cable"},
        {kFunction,
         "_ZN3ros10Connection4readEjRKN5boost8functionIFvRKNS1_10shared_ptrIS0_EERKNS1_12shared_"
         "arrayIhEEjbEEE",
         kRoscpp, kNetworkMemory},
        {kFunction,
         "_ZN3ros10Connection18onHeaderLengthReadERKN5boost10shared_ptrIS0_EERKNS1_12shared_"
         "arrayIhEEjb",
         kRoscpp, kNetworkMemory},
        {kFunction,
         "_ZN3ros22TransportPublisherLink15onMessageLengthERKN5boost10shared_ptrINS_10ConnectionEEE"
         "RKNS1_12shared_arrayIhEEjb",
         kRoscpp, "skipping of messages that are too large"},
        {kFunction, "_ZN3ros23TransportSubscriberLink14enqueueMessageERKNS_17SerializedMessageEbb",
         kRoscpp, "a limit on messages queued for slow subscribers"},
        {kFunction,
         "_ZN6XmlRpc12XmlRpcSocket6nbReadEiRNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEPb",
         "libxmlrpcpp.so", kNetworkMemory},
        {kFunction, "_ZN3ros7console4impl10initializeEv", kRosconsole, kLevels},
        {kFunction, "_ZN3ros7console4impl8shutdownEv", kRosconsole, kLevels},
        {kFunction,
         "_ZN3ros7console4impl9getHandleERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE",
         kRosconsole, kLevels},
        {kFunction, "_ZN3ros7console4impl7getNameB5cxx11EPv", kRosconsole, kLevels},
        {kFunction, "_ZN3ros7console4impl5printEPvNS0_6levels5LevelEPKcS6_S6_i", kRosconsole,
         kLevels},
        {kFunction, "_ZN3ros7console4impl12isEnabledForEPvNS0_6levels5LevelE", kRosconsole,
         kLevels},
        {kFunction,
         "_ZN3ros7console4impl11get_loggersERSt3mapINSt7__cxx1112basic_stringIcSt11char_traitsIcES"
         "aIcEEENS0_6levels5LevelESt4lessIS8_ESaISt4pairIKS8_SA_EEE",
         kRosconsole, kLevels},
        {kFunction,
         "_ZN3ros7console4impl16set_logger_levelERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaI"
         "cEEENS0_6levels5LevelE",
         kRosconsole, kLevels},
        {kFunction, "_ZN3ros7console4impl17register_appenderEPNS0_11LogAppenderE", kRosconsole,
         kRejections},
        {kFunction, "_ZN3ros7console4impl19deregister_appenderEPNS0_11LogAppenderE", kRosconsole,
         kRejections},
        // RejectedConnections::log() searches for this text, the only sign of a rejection.
        {Dependence::Kind::Text, "error message in header", kRoscpp,
         "reports of subscriptions rejected by a peer"},
        // Also for " wants topic ", which compilers embed in code, so it cannot be found here.
    };
    return list;
}

std::vector<std::string> broken(const std::vector<Dependence>& list) {
    std::vector<std::string> lines;
    for (const Dependence& each : list) {
        Loaded library{each.library, {}, {}};
        dl_iterate_phdr(&find, &library);
        bool works = false;
        if (each.kind == Dependence::Kind::Function) works = isReplaced(each.name, library);
        if (each.kind == Dependence::Kind::Text) {
            for (const std::string_view constant : library.constant)
                works = works || constant.find(each.name) != std::string_view::npos;
        }
        if (works) continue;
        lines.push_back(std::string(each.library) + " has another version than rtcf expects (" +
                        each.name + "): not available: " + each.use);
    }
    return lines;
}

}  // namespace rtcf::ros1
