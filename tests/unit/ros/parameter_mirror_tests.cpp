// The mirror of parameters, called by hand, at a real master.
#include "ros/parameters/parameter_mirror.hpp"

#include <cmath>
#include <limits>

#include "ros_fixture.hpp"

namespace {

using rtcf::executor::BatchPolicy;
using rtcf::executor::ParameterSet;
using rtcf::ros1::MasterAddress;
using rtcf::ros1::MasterCall;
using rtcf::ros1::ParallelCalls;
using rtcf::ros1::ParameterMirror;
using rtcf::ros1::texts;

class ParameterMirrorTest : public RosFixture {
   protected:
    void SetUp() override {
        startMaster();
        std::string host;
        ASSERT_TRUE(rtcf::ros1::splitMasterUri(masterUri(), host, address_.port));
        address_.address = host;
        master_calls_ = std::make_unique<ParallelCalls>(address_, never_);
    }
    ParallelCalls& calls() { return *master_calls_; }
    static ParameterMirror::Component component(double value, const char* name = "kp") {
        auto set = std::make_shared<ParameterSet>();
        set->full_name = "/C";
        rtcf::ParameterDeclaration declaration;
        declaration.name = name;
        declaration.type = "double";
        declaration.default_value = 1.0;
        set->parameters.push_back({declaration, value});
        return {set, true};
    }
    static ParameterMirror::Component textComponent(const std::string& text) {
        auto set = std::make_shared<ParameterSet>();
        set->full_name = "/C";
        rtcf::ParameterDeclaration declaration;
        declaration.name = "name";
        declaration.type = "string";
        declaration.default_value = std::string();
        set->parameters.push_back({declaration, text});
        return {set, true};
    }
    std::vector<rtcf::ros1::MasterAnswer> ask(const char* method,
                                              const XmlRpc::XmlRpcValue& arguments) {
        return calls().run({MasterCall{method, arguments}}, 1000ms,
                           std::chrono::steady_clock::now() + 1s);
    }
    const ParameterMirror::Caller caller_{"/mirror", "http://127.0.0.1:1"};

   private:
    const std::atomic<bool> never_{false};
    MasterAddress address_;
    std::unique_ptr<ParallelCalls> master_calls_;
};

// Pending deletions for an unloaded component must not affect a component loaded later.
TEST_F(ParameterMirrorTest, DeletesNothingOfAReloadedComponent) {
    ParameterMirror mirror;
    mirror.serve([](const std::string&, const rtcf::executor::ParameterBatch&, BatchPolicy,
                    const std::function<void(const std::string&)>& done) { done({}); });
    mirror.reconcile(calls(), caller_, {component(2.0)});
    ASSERT_TRUE(ask("getParam", texts({"/test", "/C/kp"}))[0]);
    // Replaced while the master is too slow to be told.
    mirror.leave(calls(), caller_, {"/C"}, std::chrono::steady_clock::now() - 1s);
    mirror.reconcile(calls(), caller_, {component(3.0)});
    for (int turn = 0; turn < 3; ++turn) {
        mirror.leave(calls(), caller_, {}, std::chrono::steady_clock::now() + 1s);
        mirror.reconcile(calls(), caller_, {component(3.0)});
    }
    EXPECT_TRUE(ask("getParam", texts({"/test", "/C/kp"}))[0]) << "it was deleted";
}

TEST_F(ParameterMirrorTest, FindsAParameterInItsGroup) {
    std::vector<std::pair<std::string, double>> taken;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch& batch, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        for (const auto& [name, value] : batch) taken.emplace_back(name, std::get<double>(value));
        done({});
    });
    const auto reconcile = [&](double value) {
        mirror.reconcile(calls(), caller_, {component(value, "gains/filter/p")});
    };
    XmlRpc::XmlRpcValue given = texts({"/test", "/C/gains/filter/p"});
    given[2] = 2.5;
    ASSERT_TRUE(ask("setParam", given)[0]);
    reconcile(1.0);
    using Taken = std::vector<std::pair<std::string, double>>;
    ASSERT_EQ(taken, (Taken{{"gains/filter/p", 2.5}}));
    reconcile(2.5);
    // A group that is written as a whole, without the parameter, and one that is no group.
    for (const bool is_group : {true, false}) {
        XmlRpc::XmlRpcValue whole = texts({"/test", "/C/gains"});
        if (is_group) {
            whole[2]["filter"]["q"] = 7.0;
        } else {
            whole[2] = 7.0;
        }
        ASSERT_TRUE(ask("setParam", whole)[0]);
        mirror.noteWritten("/C/gains/");
        reconcile(2.5);
        EXPECT_EQ(taken.size(), 1U) << "the loop keeps its value";
        auto answers = ask("getParam", texts({"/test", "/C/gains/filter/p"}));
        ASSERT_TRUE(answers[0]) << "and writes it again";
        EXPECT_EQ(static_cast<double>(answers[0].value), 2.5);
    }
    mirror.leave(calls(), caller_, {"/C"}, std::chrono::steady_clock::now() + 1s);
    EXPECT_FALSE(ask("getParam", texts({"/test", "/C/gains/filter/p"}))[0]) << "it was the loop's";
}

// A component of a launch file may be loaded before the node has met the master, so it is not new.
TEST_F(ParameterMirrorTest, TakesNoSizeFromBesideItsListUntilItIsWrittenAgain) {
    std::vector<std::int64_t> taken;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch& batch, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        taken.push_back(std::get<std::int64_t>(batch.at(0).second));
        done({});
    });
    const auto size_on_master = [&] {
        auto answers = ask("getParam", texts({"/test", "/C/filter/taps_size"}));
        return static_cast<int>(answers[0].value);
    };
    XmlRpc::XmlRpcValue list = texts({"/test", "/C/filter"});
    for (int i = 0; i < 5; ++i) list[2]["taps"][i] = 1.0;
    list[2]["taps_size"] = 2;
    ASSERT_TRUE(ask("setParam", list)[0]);
    auto set = std::make_shared<ParameterSet>();
    set->full_name = "/C";
    rtcf::ParameterDeclaration declaration;
    declaration.name = "filter/taps_size";
    declaration.type = "int";
    declaration.default_value = std::int64_t{3};
    declaration.is_size = true;
    set->parameters.push_back({declaration, std::int64_t{5}});
    mirror.reconcile(calls(), caller_, {{set, false}});
    EXPECT_TRUE(taken.empty()) << "the list counts";
    EXPECT_EQ(size_on_master(), 5);
    XmlRpc::XmlRpcValue size = texts({"/test", "/C/filter/taps_size"});
    size[2] = 4;
    ASSERT_TRUE(ask("setParam", size)[0]);
    mirror.noteWritten("/C/filter/taps_size/");
    mirror.reconcile(calls(), caller_, {{set, false}});
    EXPECT_EQ(taken, std::vector<std::int64_t>{4});
}

// rosparam reads 1e-3 as text, as YAML 1.1 does.
TEST_F(ParameterMirrorTest, TakesATextThatIsANumberWhereANumberIsWanted) {
    std::vector<rtcf::executor::ParameterBatch> taken;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch& batch, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        taken.push_back(batch);
        done({});
    });
    mirror.reconcile(calls(), caller_, {component(2.0)});
    for (const char* text : {"1e-3", "fast"}) {
        ASSERT_TRUE(ask("setParam", texts({"/test", "/C/kp", text}))[0]);
        mirror.noteWritten("/C/kp/");
        mirror.reconcile(calls(), caller_, {component(2.0)});
    }
    ASSERT_EQ(taken.size(), 2U);
    EXPECT_EQ(taken[0].at(0).second, rtcf::ParameterValue(0.001));
    EXPECT_EQ(taken[1].at(0).second, rtcf::ParameterValue(std::string("fast"))) << "for the error";
}

// The loop may answer during a turn, which still has the old values.
TEST_F(ParameterMirrorTest, OverwritesNoNewValueOfTheLoopWithAnOldOne) {
    std::vector<double> taken;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch& batch, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        taken.push_back(std::get<double>(batch.at(0).second));
        done({});
    });
    mirror.reconcile(calls(), caller_, {component(2.0)});
    XmlRpc::XmlRpcValue arguments = texts({"/test", "/C/kp"});
    arguments[2] = 5.0;
    ASSERT_TRUE(ask("setParam", arguments)[0]);
    mirror.noteWritten("/C/kp/");
    mirror.reconcile(calls(), caller_, {component(2.0)});
    ASSERT_EQ(taken, std::vector{5.0});
    auto answers = ask("getParam", texts({"/test", "/C/kp"}));
    ASSERT_TRUE(answers[0]);
    EXPECT_EQ(static_cast<double>(answers[0].value), 5.0);
}

// Any peer may send a key of the maximum size; processing must not be quadratic in its
// slashes.
TEST_F(ParameterMirrorTest, HandlesAKeyOfSlashesLikeAnyOther) {
    int asked = 0;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch&, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        ++asked;
        done({});
    });
    mirror.reconcile(calls(), caller_, {component(2.0)});
    XmlRpc::XmlRpcValue arguments = texts({"/test", "/C/kp"});
    arguments[2] = 5.0;
    ASSERT_TRUE(ask("setParam", arguments)[0]);
    constexpr std::size_t kLong = 4 * 1024 * 1024;
    mirror.noteWritten("/D" + std::string(kLong, '/'));
    mirror.reconcile(calls(), caller_, {component(2.0)});
    EXPECT_EQ(asked, 0);
    mirror.noteWritten("/C" + std::string(kLong, '/'));
    mirror.reconcile(calls(), caller_, {component(2.0)});
    EXPECT_EQ(asked, 1);
}

TEST_F(ParameterMirrorTest, WritesNoTextThatXmlCannotCarry) {
    const auto problemOf = [this](const std::string& text) {
        ParameterMirror mirror;
        mirror.serve([](const std::string&, const rtcf::executor::ParameterBatch&, BatchPolicy,
                        const std::function<void(const std::string&)>& done) { done({}); });
        mirror.reconcile(calls(), caller_, {textComponent(text)});
        return mirror.problem();
    };
    // Latin-1, cut, overlong, a surrogate, above U+10FFFF, control characters.
    for (const std::string text : {"\xE4", "\xC3", "\xE0\x80\xAF", "\xF0\x80\x80\xAF",
                                   "\xED\xA0\x80", "\xF4\x90\x80\x80", "\x01", "\r", "\x7F"}) {
        EXPECT_NE(problemOf("a" + text).find("/C/name on the parameter server: it contains"),
                  std::string::npos)
            << text;
        auto answers = ask("hasParam", texts({"/test", "/C/name"}));
        ASSERT_TRUE(answers[0]);
        EXPECT_FALSE(static_cast<bool>(answers[0].value)) << text;
    }
    const std::string carried = "a\u00E4\u20AC\U0001F916\t\n";
    EXPECT_EQ(problemOf(carried), "");
    auto answers = ask("getParam", texts({"/test", "/C/name"}));
    ASSERT_TRUE(answers[0]);
    EXPECT_EQ(static_cast<std::string>(answers[0].value), carried);
}

// NaN is a valid default; that it does not equal itself is no change.
TEST_F(ParameterMirrorTest, RequestsNoNanThatIsSetAlready) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    int asked = 0;
    ParameterMirror mirror;
    mirror.serve([&](const std::string&, const rtcf::executor::ParameterBatch&, BatchPolicy,
                     const std::function<void(const std::string&)>& done) {
        ++asked;
        done({});
    });
    auto limit = component(kNaN);
    limit.is_new = false;
    mirror.reconcile(calls(), caller_, {limit});
    mirror.reconcile(calls(), caller_, {limit});
    mirror.noteWritten("/C/other");
    mirror.reconcile(calls(), caller_, {limit});
    EXPECT_EQ(asked, 0);
}

}  // namespace
