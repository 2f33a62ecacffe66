// The memory of components: random histories against a model, and components in it.
#include "realtime/component_arena.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rtcf/component.hpp"
#include "support/graph_fixture.hpp"

namespace rtcf::test {
namespace {

using executor::ComponentArena;

struct ArenaBlock {
    std::size_t size;
    std::size_t alignment;
    unsigned char content;
};

TEST(ComponentArena, KeepsAllBlocksApartInRandomHistories) {
    for (unsigned seed = 0; seed < 20; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937 draw(seed);
        const auto drawn = [&draw](std::size_t most) {
            return std::uniform_int_distribution<std::size_t>(0, most)(draw);
        };
        ComponentArena arena;
        std::map<unsigned char*, ArenaBlock> blocks;
        for (int step = 0; step < 2000; ++step) {
            if (!blocks.empty() && drawn(2) == 0) {
                const auto gone = std::next(blocks.begin(),
                                            static_cast<std::ptrdiff_t>(drawn(blocks.size() - 1)));
                const auto [size, alignment, content] = gone->second;
                ASSERT_EQ(std::count(gone->first, gone->first + size, content),
                          static_cast<std::ptrdiff_t>(size));
                arena.release(gone->first, size, alignment);
                blocks.erase(gone);
                continue;
            }
            const std::size_t size =
                drawn(9) == 0 ? drawn(3 * ComponentArena::kLargest) : drawn(600);
            const std::size_t alignment = std::size_t{1} << drawn(7);
            const auto content = static_cast<unsigned char>(drawn(255));
            auto* const block = static_cast<unsigned char*>(arena.allocate(size, alignment));
            ASSERT_EQ(reinterpret_cast<std::uintptr_t>(block) % alignment, 0U);
            const auto next = blocks.lower_bound(block);
            if (next != blocks.end()) {
                ASSERT_LE(block + size, next->first);
            }
            if (next != blocks.begin()) {
                const auto before = std::prev(next);
                ASSERT_GE(block, before->first + std::max<std::size_t>(before->second.size, 1));
            }
            std::memset(block, content, size);
            blocks[block] = {size, alignment, content};
        }
        for (const auto& [block, is] : blocks) arena.release(block, is.size, is.alignment);
    }
}

TEST(ComponentArena, LaysBlocksSideBySideAndUsesFreeOnesAgain) {
    ComponentArena arena;
    auto* const first = static_cast<std::byte*>(arena.allocate(160, 16));
    auto* const second = static_cast<std::byte*>(arena.allocate(16, 8));
    auto* const third = static_cast<std::byte*>(arena.allocate(160, 16));
    EXPECT_EQ(second, first + 160);
    EXPECT_EQ(third, second + 16);
    arena.release(first, 160, 16);
    arena.release(third, 160, 16);
    arena.release(second, 16, 8);
    // A component that is loaded again and again takes no further memory.
    for (int i = 0; i < 100'000; ++i) {
        void* const again = arena.allocate(160, 16);
        ASSERT_EQ(again, first);
        arena.release(again, 160, 16);
    }
    EXPECT_EQ(arena.allocate(16, 8), second);
}

TEST(ComponentArena, UsesFreeBlocksInTheOrderOfTheirAddresses) {
    std::mt19937 draw(1);
    ComponentArena arena;
    std::vector<void*> blocks(100);
    for (void*& block : blocks) block = arena.allocate(64, 64);
    std::vector<void*> expected = blocks;
    std::sort(expected.begin(), expected.end(), std::less<>());
    for (int round = 0; round < 20; ++round) {
        std::shuffle(blocks.begin(), blocks.end(), draw);
        for (void* const block : blocks) arena.release(block, 64, 64);
        for (void*& block : blocks) block = arena.allocate(64, 64);
        ASSERT_EQ(blocks, expected);
    }
}

class alignas(128) WideComponent final : public Component {
   public:
    explicit WideComponent(bool fails = false) {
        if (fails) throw std::runtime_error("no device");
    }
    void update() override {}
    Output<double> out{this, "out"};
};

TEST(ComponentArena, HoldsComponentsAndTheirValues) {
    ComponentArena arena;
    const auto placeOf = [](const void* object) {
        return reinterpret_cast<std::uintptr_t>(object);
    };
    ComponentContext context;
    context.memory = &arena;
    for (int i = 0; i < 3; ++i) {
        EXPECT_THROW(detail::construct<WideComponent>(&context, true), std::runtime_error);
        const std::unique_ptr<Component> made(detail::construct<WideComponent>(&context));
        EXPECT_EQ(placeOf(made.get()) % 128, 0U);
        EXPECT_EQ(detail::ObjectHead::of(made.get()).memory, &arena);
        EXPECT_EQ(detail::ObjectHead::of(made.get()).size, sizeof(WideComponent));
        const std::uintptr_t value = placeOf(accessTo(*made).outputs()[0]->slot().get());
        EXPECT_LE(value - placeOf(made.get()), sizeof(WideComponent) + 128);
    }
    EXPECT_EQ(context.object_size, sizeof(WideComponent));
    // In another thread, values are on the heap meanwhile.
    {
        const detail::ConstructionScope scope(&arena);
        EXPECT_EQ(detail::constructionMemory(), &arena);
        std::thread([] { EXPECT_EQ(detail::constructionMemory(), nullptr); }).join();
    }
    EXPECT_EQ(detail::constructionMemory(), nullptr);
    // Without an executor, on the heap.
    const std::unique_ptr<Component> alone = std::make_unique<WideComponent>();
    EXPECT_EQ(placeOf(alone.get()) % 128, 0U);
    EXPECT_EQ(detail::ObjectHead::of(alone.get()).memory, nullptr);
    const std::unique_ptr<Component> careful(new (std::nothrow) WideComponent);
    EXPECT_NE(careful, nullptr);
    EXPECT_EQ(placeOf(careful.get()) % 128, 0U);
    alignas(WideComponent) std::array<std::byte, sizeof(WideComponent)> place{};
    auto* const placed = new (place.data()) WideComponent;
    EXPECT_EQ(static_cast<void*>(placed), place.data());
    placed->~WideComponent();
}

class Assembly final : public Component {
   public:
    explicit Assembly(ComponentContext* inner)
        : part(detail::construct<WideComponent>(inner)), last(this, "last") {}
    void update() override {}
    std::unique_ptr<Component> part;
    Output<double> last;
};

TEST(ComponentArena, HoldsComponentsThatConstructOthers) {
    ComponentArena arena;
    ComponentContext outer;
    outer.full_name = "/outer";
    outer.memory = &arena;
    ComponentContext inner;
    const std::unique_ptr<Assembly> made(detail::construct<Assembly>(&outer, &inner));
    EXPECT_EQ(&accessTo(*made).context(), &outer);
    EXPECT_EQ(&accessTo(*made->part).context(), &inner);
    EXPECT_EQ(detail::ObjectHead::of(made.get()).memory, &arena);
    EXPECT_EQ(detail::ObjectHead::of(made->part.get()).memory, nullptr);
    const auto begin = reinterpret_cast<std::uintptr_t>(made.get());
    const auto last =
        reinterpret_cast<std::uintptr_t>(accessTo(*made).outputs().back()->slot().get());
    EXPECT_LE(last - begin, sizeof(Assembly) + 64);
}

TEST(ComponentArena, KeepsAValueThatOutlivesItsComponent) {
    ComponentArena arena;
    ComponentContext context;
    context.memory = &arena;
    std::unique_ptr<WideComponent> first(detail::construct<WideComponent>(&context));
    first->out.write(3.5);
    const std::shared_ptr<SlotHeader> kept = accessTo(*first).outputs()[0]->slot();
    first.reset();
    const std::unique_ptr<WideComponent> second(detail::construct<WideComponent>(&context));
    second->out.write(-1.0);
    EXPECT_NE(accessTo(*second).outputs()[0]->slot(), kept);
    EXPECT_EQ(static_cast<const Slot<double>&>(*kept).value, 3.5);
}

#if !defined(__SANITIZE_ADDRESS__)  // which has to see each block

using ComponentPlaces = GraphFixture;

TEST_F(ComponentPlaces, AreSideBySideInTheOrderOfLoading) {
    std::vector<std::shared_ptr<executor::Instance>> loaded;
    std::uintptr_t last = 0;
    // Earlier tests of this process may have left free blocks, which are used first.
    int in_order = 0;
    for (int i = 0; in_order < 5 && i < 20'000; ++i) {
        loaded.push_back(mimo("C" + std::to_string(i), {}));
        const Component& component = loaded.back()->component();
        const auto begin = reinterpret_cast<std::uintptr_t>(&component);
        const bool follows = begin > last && begin - last < 256;
        last = begin;
        for (const OutputPort* output : accessTo(component).outputs()) {
            const auto value = reinterpret_cast<std::uintptr_t>(output->slot().get());
            if (follows) {
                EXPECT_LT(value - begin, 256U);
            }
        }
        in_order = follows ? in_order + 1 : 0;
    }
    EXPECT_EQ(in_order, 5);
}

#endif

}  // namespace
}  // namespace rtcf::test
