#include "plugins/library.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "common/error.hpp"
#include "support/temporary_folder.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

const std::string kFolder = RTCF_UNIT_COMPONENTS "/";

std::string errorOf(const std::string& path) {
    try {
        LibraryStore().open(path);
        return {};
    } catch (const Error& refused) {
        return refused.what();
    }
}

// The value that a Versioned component of this library writes.
std::int32_t versionOf(const Library& library) {
    const std::unique_ptr<Component> component(library.find("Versioned")->create("V", nullptr));
    component->update();
    return static_cast<const Slot<std::int32_t>&>(*accessTo(*component).outputs()[0]->slot()).value;
}

TEST(Library, ListsItsTypesByName) {
    LibraryStore store;
    const Library& library = *store.open(RTCF_EXAMPLES);
    ASSERT_EQ(library.types().size(), 4U);
    EXPECT_STREQ(library.types()[0]->type, "Identity");
    EXPECT_STREQ(library.types()[1]->type, "Mimo");
    EXPECT_STREQ(library.types()[2]->type, "PaperExample");
    EXPECT_STREQ(library.types()[3]->type, "Wave");
    EXPECT_EQ(library.find("Nothing"), nullptr);
}

TEST(Library, MissingFileIsNamed) {
    EXPECT_EQ(errorOf("/nowhere/x.so"), "library /nowhere/x.so: No such file or directory");
}

TEST(Library, FolderIsRejected) {
    EXPECT_NE(errorOf("/tmp").find("not a regular file"), std::string::npos);
}

TEST(Library, MissingSymbolIsNamed) {
    const std::string text = errorOf(kFolder + "missing_symbol.so");
    EXPECT_NE(text.find("missing_symbol.so: does not load"), std::string::npos) << text;
    EXPECT_NE(text.find("undefined symbol: rtcf_unit_test_undefined_function"), std::string::npos)
        << text;
    EXPECT_EQ(text.find("/proc/"), std::string::npos)
        << "the name of the private copy is meaningless to users";
}

TEST(Library, WithoutEntryPointIsRejected) {
    const std::string text = errorOf(kFolder + "no_entry_point.so");
    EXPECT_NE(text.find("has no components"), std::string::npos) << text;
    EXPECT_NE(text.find("rtcf_add_components()"), std::string::npos) << text;
}

TEST(Library, OfAnotherAbiIsRejectedWithBothNumbers) {
    const std::string text = errorOf(kFolder + "wrong_abi.so");
    for (const std::string& part :
         {"ABI " + std::to_string(AbiProbe::fingerprint(4711)),
          "this executor has " + std::to_string(AbiProbe::fingerprint(RTCF_ABI_VERSION))})
        EXPECT_NE(text.find(part), std::string::npos) << text;
}

TEST(Library, WithTwoTypesOfOneNameIsRejected) {
    const std::string error = errorOf(kFolder + "registered_twice.so");
    EXPECT_NE(error.find("registers the type Gain twice"), std::string::npos) << error;
    EXPECT_NE(error.find("of file 1"), std::string::npos) << error;
    EXPECT_NE(error.find("of file 2"), std::string::npos) << error;
}

// The same headers and ABI number; only the compiler options differ.
TEST(Library, OfAnotherLayoutIsRejected) {
    const std::string text = errorOf(kFolder + "other_layout.so");
    EXPECT_NE(text.find("was built for component ABI"), std::string::npos) << text;
}

TEST(Library, WithThreadLocalsThatAllocateInTheCycleIsRejected) {
    const std::string text = errorOf(kFolder + "thread_local_lazy.so");
    EXPECT_NE(text.find("thread_local"), std::string::npos) << text;
    EXPECT_NE(text.find("-ftls-model=initial-exec"), std::string::npos) << text;
    EXPECT_EQ(errorOf(kFolder + "thread_local_static.so"), "");
}

TEST(Library, InvalidLibraryIsRejected) {
    const std::string text = errorOf("/etc/passwd");
    EXPECT_NE(text.find("does not load"), std::string::npos) << text;
}

// Otherwise each attempt would cost a descriptor and a mapping for the life of a loop.
TEST(Library, RejectedLibraryLeavesNothingOpen) {
    const auto open_files = [] {
        const std::filesystem::directory_iterator files("/proc/self/fd");
        return std::distance(begin(files), end(files));
    };
    const auto mapped = [] {
        std::ifstream maps("/proc/self/maps");
        std::string line;
        int count = 0;
        while (std::getline(maps, line))
            count += line.find("no_entry_point") == std::string::npos ? 0 : 1;
        return count;
    };
    const auto before = open_files();
    EXPECT_NE(errorOf(kFolder + "no_entry_point.so"), "");
    EXPECT_NE(errorOf(kFolder + "missing_symbol.so"), "");
    EXPECT_EQ(open_files(), before);
    EXPECT_EQ(mapped(), 0);
}

TEST(LibraryStore, OpensAnUnchangedFileOnce) {
    LibraryStore store;
    EXPECT_EQ(store.open(kFolder + "versioned_1.so"), store.open(kFolder + "versioned_1.so"));
}

TEST(LibraryStore, LoadsARebuiltFileBesideTheOldCode) {
    const TemporaryFolder folder;
    const std::string path = folder.path("versioned.so");
    LibraryStore store;
    std::filesystem::copy_file(kFolder + "versioned_1.so", path);
    const auto before = store.open(path);
    // In place, like a linker: the same file with other bytes.
    std::filesystem::copy_file(kFolder + "versioned_2.so", path,
                               std::filesystem::copy_options::overwrite_existing);
    const auto after = store.open(path);
    EXPECT_NE(before, after);
    EXPECT_EQ(versionOf(*before), 1);
    EXPECT_EQ(versionOf(*after), 2);
}

}  // namespace
}  // namespace rtcf::test
