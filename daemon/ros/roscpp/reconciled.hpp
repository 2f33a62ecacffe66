/// @file
/// Result of a reconcile step.
#pragma once

namespace rtcf::ros1 {

enum class Reconciled {
    Done,   ///< the wanted state is reached
    Again,  ///< repeat at once
    Later,  ///< a call failed or got no answer: repeat later
};

/// The worse of two results.
inline Reconciled operator&(Reconciled one, Reconciled other) { return one < other ? other : one; }

}  // namespace rtcf::ros1
