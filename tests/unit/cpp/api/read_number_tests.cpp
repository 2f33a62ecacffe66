#include <rtcf/read_number.hpp>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <clocale>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

#include "support/temporary_folder.hpp"

namespace rtcf {
namespace {

TEST(ReadNumber, ReadsWhatStrtodReadsInTheLocaleC) {
    for (const char* text : {"0.5", "-0.5", "+0.5", "1e-3", "+1E3", ".5", "5.", "-0", "17", "inf",
                             "-inf", "infinity", "1.7976931348623157e308", "5e-324"}) {
        const std::optional<double> number = readNumber(text);
        ASSERT_TRUE(number) << text;
        EXPECT_EQ(*number, std::strtod(text, nullptr)) << text;  // in the locale C
    }
    EXPECT_TRUE(std::isnan(readNumber("nan").value_or(0.0)));
}

TEST(ReadNumber, RejectsOtherTexts) {
    for (const char* text : {"", "+", "-", "+-1", "--1", " 1", "1 ", "1,5", "1.5.", "0x10", "1e400",
                             "-1e400", "1e-400", "half", "1e", "e3"})
        EXPECT_FALSE(readNumber(text)) << text;
}

TEST(ReadNumber, TakesANumberOffTheBeginning) {
    std::string_view text = "-2+1j";
    EXPECT_EQ(takeNumber(text), -2.0);
    EXPECT_EQ(text, "+1j");
    EXPECT_EQ(takeNumber(text), 1.0);
    EXPECT_EQ(takeNumber(text), std::nullopt);
    EXPECT_EQ(text, "j");
}

TEST(ReadNumber, DoesNotDependOnTheLocaleOfTheProcess) {
    const test::TemporaryFolder folder;
    const std::string name = "de_DE.UTF-8";
    const std::string made = folder.path(name);
    const pid_t localedef = ::fork();
    if (localedef == 0) {
        ::execlp("localedef", "localedef", "-i", "de_DE", "-f", "UTF-8", made.c_str(), nullptr);
        ::_exit(127);
    }
    int status = -1;
    ASSERT_EQ(::waitpid(localedef, &status, 0), localedef);
    ASSERT_EQ(status, 0);
    ASSERT_EQ(::setenv("LOCPATH", folder.path("").c_str(), 1), 0);
    ASSERT_NE(std::setlocale(LC_ALL, name.c_str()), nullptr);
    const double half = std::strtod("0.5", nullptr);  // in this locale
    const std::optional<double> read = readNumber("0.5");
    std::setlocale(LC_ALL, "C");
    ::unsetenv("LOCPATH");
    EXPECT_EQ(half, 0.0);  // the locale is in force
    EXPECT_EQ(read, 0.5);
}

}  // namespace
}  // namespace rtcf
