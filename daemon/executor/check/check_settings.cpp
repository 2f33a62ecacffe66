#include "check/check_settings.hpp"

#include <unistd.h>

#include "common/error.hpp"
#include "messages/known_values.hpp"
#include "messages/settings_messages.hpp"
#include "rtcf/v1/runner.pb.h"
#include "view/settings.hpp"

namespace rtcf::executor {

int checkSettings() {
    ::rtcf::v1::RunnerSettings message;
    if (!message.ParseFromFileDescriptor(STDIN_FILENO)) {
        throw Error(ErrorKind::InvalidArgument, "standard input is not a RunnerSettings message");
    }
    requireKnownValues(message);
    RunnerSettings settings = settingsFrom(message, {});
    validate(settings);
    return 0;
}

}  // namespace rtcf::executor
