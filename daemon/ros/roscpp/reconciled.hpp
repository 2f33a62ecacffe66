/// @file
/// What came of bringing something to what is wanted of it.
#pragma once

namespace rtcf::ros1 {

enum class Reconciled {
    Done,   ///< it is what is wanted
    Again,  ///< there is more to do, at once
    Later,  ///< somebody did not answer, or could not: to be tried again after a while
};

/// The worse of two.
inline Reconciled operator&(Reconciled one, Reconciled other) { return one < other ? other : one; }

}  // namespace rtcf::ros1
