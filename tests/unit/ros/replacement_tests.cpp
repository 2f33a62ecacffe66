#include "ros/roscpp/replacements.hpp"

#include <dlfcn.h>
#include <elf.h>
#include <gtest/gtest.h>
#include <link.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <set>

using rtcf::ros1::broken;
using rtcf::ros1::Dependence;

namespace {

// Loaded libraries whose name contains `part`.
std::vector<std::string> loaded(const char* part) {
    struct Found {
        const char* part;
        std::vector<std::string> files;
    } found{part, {}};
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t /*size*/, void* data) {
            auto& into = *static_cast<Found*>(data);
            if (std::strstr(info->dlpi_name, into.part) != nullptr)
                into.files.emplace_back(info->dlpi_name);
            return 0;
        },
        &found);
    return found.files;
}

// Functions defined by a library, except templates and inline ones, which any program may define.
std::vector<std::string> functionsOf(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    const auto at = [&bytes](std::size_t offset, auto& to) {
        ASSERT_LE(offset + sizeof to, bytes.size());
        std::memcpy(&to, &bytes[offset], sizeof to);
    };
    std::vector<std::string> names;
    ElfW(Ehdr) header{};
    at(0, header);
    for (std::size_t i = 0; i < header.e_shnum; ++i) {
        ElfW(Shdr) section{};
        at(header.e_shoff + i * sizeof section, section);
        if (section.sh_type != SHT_DYNSYM) continue;
        ElfW(Shdr) texts{};
        at(header.e_shoff + section.sh_link * sizeof texts, texts);
        for (std::size_t offset = 0; offset < section.sh_size; offset += sizeof(ElfW(Sym))) {
            ElfW(Sym) symbol{};
            at(section.sh_offset + offset, symbol);
            const bool strong_function = ELF64_ST_TYPE(symbol.st_info) == STT_FUNC &&
                                         ELF64_ST_BIND(symbol.st_info) == STB_GLOBAL;
            if (strong_function && symbol.st_shndx != SHN_UNDEF)
                names.emplace_back(&bytes[texts.sh_offset + symbol.st_name]);
        }
    }
    return names;
}

// The address of the function of this name; null if there is none.
const void* homeOf(const char* name) {
    Dl_info info{};
    void* const function = dlsym(RTLD_DEFAULT, name);
    return function != nullptr && dladdr(function, &info) != 0 ? info.dli_fbase : nullptr;
}

}  // namespace

TEST(Replacements, AreInEffectWithThisMachinesRoscpp) {
    EXPECT_EQ(broken(rtcf::ros1::dependences()), std::vector<std::string>{});
}

// A replacement missing in the list would be unnoticed.
TEST(Replacements, AreAllInTheList) {
    std::set<std::string> listed;
    for (const Dependence& each : rtcf::ros1::dependences()) {
        if (each.kind == Dependence::Kind::Function) listed.insert(each.name);
    }
    Dl_info here{};
    ASSERT_NE(dladdr(reinterpret_cast<void*>(&broken), &here), 0);
    std::set<std::string> replaced;
    for (const char* library : {"libroscpp", "librosconsole", "librostime", "libxmlrpcpp"}) {
        const std::vector<std::string> files = loaded(library);
        EXPECT_FALSE(files.empty()) << library;
        for (const std::string& file : files) {
            for (const std::string& name : functionsOf(file)) {
                if (homeOf(name.c_str()) == here.dli_fbase) replaced.insert(name);
            }
        }
    }
    EXPECT_EQ(replaced, listed);
}

TEST(Replacements, MissingInALibraryAreReported) {
    const std::vector<Dependence> other{
        {Dependence::Kind::Function, "_ZN3ros6master6nobodyEv", "libroscpp.so", "the first use"},
        {Dependence::Kind::Text, "no such text there is", "libroscpp.so", "the second use"}};
    const std::vector<std::string> lines = broken(other);
    ASSERT_EQ(lines.size(), 2U);
    EXPECT_NE(lines[0].find("the first use"), std::string::npos);
    EXPECT_NE(lines[1].find("no such text there is"), std::string::npos);
}
