/// @file
/// The components of members, for a member that ends before its component: a local variable of a
/// hook, an optional that is reset. Kept outside the members, so that these stay small.
#pragma once

#include <mutex>
#include <unordered_map>

namespace rtcf {

class Component;

namespace detail {

/// The owner of each declared member of this library's components, by the member's address. Any
/// thread; not real-time.
class MemberOwners {
   public:
    void add(const void* member, Component* owner) {
        const std::lock_guard lock(mutex_);
        owners_[member] = owner;
    }
    /// Forgets a member. @return its owner; null if it is unknown
    Component* take(const void* member) noexcept {
        const std::lock_guard lock(mutex_);
        const auto found = owners_.find(member);
        if (found == owners_.end()) return nullptr;
        Component* const owner = found->second;
        owners_.erase(found);
        return owner;
    }

   private:
    std::mutex mutex_;
    std::unordered_map<const void*, Component*> owners_;
};

/// Never destroyed: components may end after static variables.
__attribute__((visibility("hidden"))) inline MemberOwners& memberOwners() {
    static auto* const owners = new MemberOwners;
    return *owners;
}

/// Tells a member's component that it ends. In the member's destructor; not real-time.
void endMember(const void* member) noexcept;

}  // namespace detail

}  // namespace rtcf
