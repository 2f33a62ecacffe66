/// @file
/// Memory of components and of their outputs' values. In an executor, components that are loaded
/// one after another lie one after another in memory, so that a cycle touches few cache lines and
/// pages.
#pragma once

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>

namespace rtcf {

/// Source of this memory. The executor has one; without it, components are on the heap.
class ComponentMemory {
   public:
    ComponentMemory() = default;
    ComponentMemory(const ComponentMemory&) = delete;
    ComponentMemory& operator=(const ComponentMemory&) = delete;

    /// Allocates a block. Any thread; not real-time. @throws std::bad_alloc
    virtual void* allocate(std::size_t size, std::size_t alignment) = 0;
    /// Frees a block, with the arguments of its allocate(). Any thread; not real-time.
    virtual void release(void* block, std::size_t size, std::size_t alignment) noexcept = 0;

   protected:
    ~ComponentMemory() = default;
};

namespace detail {

/// The memory of the component that this library is constructing, for the thread that does it.
struct Construction {
    std::atomic<ComponentMemory*> memory{nullptr};
    std::atomic<pthread_t> thread{};
};
__attribute__((visibility("hidden"))) inline Construction construction;

/// Memory for the parts of the component that the calling thread is constructing; null = the heap.
inline ComponentMemory* constructionMemory() noexcept {
    // Other threads may be making slots of this library's types.
    ComponentMemory* const memory = construction.memory.load(std::memory_order_acquire);
    const bool ours = construction.thread.load(std::memory_order_relaxed) == pthread_self();
    return ours ? memory : nullptr;
}

/// Sets constructionMemory() of the calling thread until the end of the block.
class ConstructionScope {
   public:
    explicit ConstructionScope(ComponentMemory* memory) noexcept
        : memory_(construction.memory), thread_(construction.thread) {
        set(memory, pthread_self());
    }
    ~ConstructionScope() { set(memory_, thread_); }
    ConstructionScope(const ConstructionScope&) = delete;
    ConstructionScope& operator=(const ConstructionScope&) = delete;

   private:
    static void set(ComponentMemory* memory, pthread_t thread) noexcept {
        construction.thread.store(thread, std::memory_order_relaxed);
        construction.memory.store(memory, std::memory_order_release);
    }
    ComponentMemory* memory_;
    pthread_t thread_;
};

inline void* allocateFrom(ComponentMemory* memory, std::size_t size, std::size_t alignment) {
    return memory != nullptr ? memory->allocate(size, alignment)
                             : ::operator new(size, static_cast<std::align_val_t>(alignment));
}

inline void releaseTo(ComponentMemory* memory, void* block, std::size_t size,
                      std::size_t alignment) noexcept {
    if (memory != nullptr) {
        memory->release(block, size, alignment);
    } else {
        ::operator delete(block, static_cast<std::align_val_t>(alignment));
    }
}

/// Ends an object and frees its block.
template <typename T>
struct Release {
    ComponentMemory* memory;
    template <typename Base>
    void operator()(Base* object) const noexcept {
        static_cast<T*>(object)->~T();
        releaseTo(memory, static_cast<T*>(object), sizeof(T), alignof(T));
    }
};

/// Makes an object in the memory of the component that is being constructed. Its block has nothing
/// but the object, so that the values of a component lie close together.
template <typename T>
std::unique_ptr<T, Release<T>> makeBeside() {
    struct Block {
        explicit Block(ComponentMemory* from)
            : memory(from), place(allocateFrom(from, sizeof(T), alignof(T))) {}
        ~Block() {
            if (place != nullptr) releaseTo(memory, place, sizeof(T), alignof(T));
        }
        Block(const Block&) = delete;
        Block& operator=(const Block&) = delete;
        ComponentMemory* memory;
        void* place;
    };
    Block block(constructionMemory());
    std::unique_ptr<T, Release<T>> object(::new (block.place) T(), Release<T>{block.memory});
    block.place = nullptr;
    return object;
}

/// Lies in front of each component.
struct ObjectHead {
    ComponentMemory* memory;
    std::uint32_t size;       ///< of the component, bytes
    std::uint32_t alignment;  ///< of its block, bytes

    /// Bytes from the beginning of the block to the component.
    std::size_t offset() const noexcept {
        return std::max<std::size_t>(alignment, sizeof(ObjectHead));
    }
    /// The head of a component. @param object the complete object
    static const ObjectHead& of(const void* object) noexcept {
        return static_cast<const ObjectHead*>(object)[-1];
    }
};

inline void* newObject(std::size_t size, std::size_t alignment) {
    if (size > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();
    const ObjectHead head{constructionMemory(), static_cast<std::uint32_t>(size),
                          static_cast<std::uint32_t>(std::max(alignment, alignof(ObjectHead)))};
    void* const block = allocateFrom(head.memory, head.offset() + size, head.alignment);
    auto* const object = static_cast<std::byte*>(block) + head.offset();
    ::new (object - sizeof head) ObjectHead(head);
    return object;
}

inline void deleteObject(void* object) noexcept {
    if (object == nullptr) return;
    const ObjectHead head = ObjectHead::of(object);
    releaseTo(head.memory, static_cast<std::byte*>(object) - head.offset(),
              head.offset() + head.size, head.alignment);
}

}  // namespace detail

}  // namespace rtcf
