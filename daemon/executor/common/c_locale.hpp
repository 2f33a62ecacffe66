/// @file
/// The locale of the executor's threads.
#pragma once

#include <clocale>

namespace rtcf::executor {

/// Gives the calling thread the locale "C" until it ends, so that its components read and write
/// numbers with a point. A component, or a library that it uses, may call setlocale(), which
/// changes the locale of all threads without one of their own. Not real-time safe.
inline void useCLocale() noexcept {
    static const locale_t locale = ::newlocale(LC_ALL_MASK, "C", nullptr);
    if (locale != nullptr) ::uselocale(locale);
}

}  // namespace rtcf::executor
