#include "common/serialized.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rtcf/executor/v1/executor.pb.h"
#include "rtcf/executor/v1/snapshot.pb.h"

namespace rtcf::test {
namespace {

using executor::v1::Response;
using executor::v1::RunnerSnapshot;

const std::string kLatin1 = "Stromst\xE4rke";
const std::string kReplaced = "Stromst\uFFFDrke";

TEST(Serialized, ReplacesInvalidTextInEachKindOfField) {
    Response response;
    response.set_id(7);
    rtcf::v1::ComponentInfo& info = *response.mutable_components()->add_components();
    info.set_fault(kLatin1);
    auto& parameter = *info.mutable_spec()->add_parameters();
    parameter.set_name("valid \u00E4");
    parameter.mutable_value()->set_string_value(kLatin1);
    info.mutable_spec()->add_breaks("valid");
    info.mutable_spec()->add_breaks(kLatin1);
    const std::string before = info.SerializeAsString();

    Response parsed;
    ASSERT_TRUE(parsed.ParseFromString(executor::serialized(response)));
    EXPECT_EQ(info.SerializeAsString(), before) << "the message itself is unchanged";
    info.set_fault(kReplaced);
    parameter.mutable_value()->set_string_value(kReplaced);
    info.mutable_spec()->set_breaks(1, kReplaced);
    EXPECT_EQ(parsed.SerializeAsString(), response.SerializeAsString());
}

TEST(Serialized, LeavesBytesAlone) {
    RunnerSnapshot snapshot;
    snapshot.set_runner(kLatin1);
    auto& state = *snapshot.add_components()->add_states();
    state.set_value(kLatin1);
    RunnerSnapshot parsed;
    ASSERT_TRUE(parsed.ParseFromString(executor::serialized(snapshot)));
    EXPECT_EQ(parsed.runner(), kReplaced);
    EXPECT_EQ(parsed.components(0).states(0).value(), kLatin1);
}

TEST(Serialized, IsTheUsualFormOfValidMessages) {
    Response response;
    response.mutable_log()->set_message("\u00E4");
    EXPECT_EQ(executor::serialized(response), response.SerializeAsString());
}

}  // namespace
}  // namespace rtcf::test
