#include "snapshot/snapshot.hpp"

namespace rtcf::executor {

SnapshotType snapshotTypeOf(const TypeInfo& type) {
    return {type.name, type.md5, type.size, type.alignment, type.flat};
}

bool same(const SnapshotType& saved, const TypeInfo& type) {
    return saved.name == type.name && saved.md5 == type.md5 && saved.size == type.size &&
           saved.alignment == type.alignment && saved.flat == type.flat;
}

}  // namespace rtcf::executor
