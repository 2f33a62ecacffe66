// Arrays of Python components: their types, made from a table for any size, equal the template
// types of C++ components.
#include "array_type.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "rtcf/component.hpp"
#include "rtcf/eigen_type.hpp"
#include "value_copy.hpp"

namespace rtcf::test {

namespace {

using python::Scalar;
using python::TypeTable;

template <typename T>
constexpr Scalar scalarOf() {
    if (std::is_same_v<T, bool>) return Scalar::Bool;
    if (std::is_same_v<T, float>) return Scalar::Float;
    if (std::is_same_v<T, double>) return Scalar::Double;
    constexpr std::array kSigned{Scalar::Int8, Scalar::Int16, Scalar::Int32, Scalar::Int64};
    constexpr std::array kUnsigned{Scalar::UInt8, Scalar::UInt16, Scalar::UInt32, Scalar::UInt64};
    const std::size_t place = sizeof(T) == 8 ? 3 : sizeof(T) / 2;
    return std::is_signed_v<T> ? kSigned.at(place) : kUnsigned.at(place);
}

// Elements, and C++'s types for the port and for the state.
template <typename Element, std::size_t Count>
struct Numbers {
    using Scalar = Element;
    using Port = std::array<Element, Count>;
    using State = Port;
    static constexpr std::int64_t kRows = Count, kColumns = 1;
};
template <typename Element, int Rows, int Columns>
struct Matrix {
    using Scalar = Element;
    static constexpr int kOrder = Rows == 1 && Columns > 1 ? Eigen::RowMajor : Eigen::ColMajor;
    using Port = Eigen::Matrix<Element, Rows, Columns, kOrder>;
    using State =
        Eigen::Matrix<Element, Rows, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
    static constexpr std::int64_t kRows = Rows, kColumns = Columns;
};

// As created by rtcf-compile.
template <typename Shape>
struct Table {
    using Element = typename Shape::Scalar;
    static const TypeTable table;

    static std::shared_ptr<SlotHeader> makeSlot(const SlotHeader* sample) {
        return rtcf_python_make_slot(&table, sample);
    }
    static void copy(SlotHeader& to, const SlotHeader& from) {
        rtcf_python_copy(&table, &to, &from);
    }
    static void exchange(SlotHeader& a, SlotHeader& b) { rtcf_python_exchange(&table, &a, &b); }
    static std::uint32_t length(const SlotHeader& slot) {
        return rtcf_python_length(&table, &slot);
    }
    static void serialize(const SlotHeader& slot, std::uint8_t* to, std::uint32_t size) {
        rtcf_python_serialize(&table, &slot, to, size);
    }
    static bool deserialize(SlotHeader& slot, const std::uint8_t* from, std::uint32_t size) {
        return rtcf_python_deserialize(&table, &slot, from, size);
    }
    static std::string print(const SlotHeader& slot) { return rtcf_python_print(&table, &slot); }
    static bool finite(const SlotHeader& slot) { return rtcf_python_finite(&table, &slot); }
    static std::string sample() { return rtcf_python_sample(&table); }
    static ByteCopies copies() { return rtcf_python_copies(&table); }
    static std::string printState(const void* value) {
        return rtcf_python_print_state(&table, value);
    }
};
template <typename Shape>
const TypeTable Table<Shape>::table{scalarOf<Element>(),
                                    Shape::kRows,
                                    Shape::kColumns,
                                    0,
                                    &makeSlot,
                                    &copy,
                                    &exchange,
                                    &length,
                                    &serialize,
                                    &deserialize,
                                    &print,
                                    &finite,
                                    &sample,
                                    &copies,
                                    &printState};

template <typename Shape>
class PythonArray : public testing::Test {
   protected:
    using Port = typename Shape::Port;
    using Element = typename Shape::Scalar;
    static constexpr auto kCount = static_cast<std::size_t>(Shape::kRows * Shape::kColumns);

    // Values at the bounds, and random ones.
    std::array<Element, kCount> draw() {
        std::array<Element, kCount> values{};
        for (Element& value : values) {
            if constexpr (std::is_same_v<Element, bool>) {
                value = random_() % 2 == 0;
            } else if constexpr (std::is_integral_v<Element>) {
                value = static_cast<Element>(random_());
            } else {
                value = static_cast<Element>(std::normal_distribution<>()(random_));
            }
        }
        values[random_() % kCount] = std::numeric_limits<Element>::max();
        return values;
    }

    // Two slots with the same value: C++'s type, and the table's.
    void fill(const std::array<Element, kCount>& values) {
        ASSERT_EQ(sizeof(Port), sizeof values);
        std::memcpy(static_cast<void*>(&real_slot_.value), values.data(), sizeof values);
        std::memcpy(valueOf(ours_, *our_slot_), values.data(), sizeof values);
    }

    static std::string bytesOf(const TypeInfo& type, const SlotHeader& slot) {
        std::string bytes(type.length(slot), '?');
        type.serialize(slot, reinterpret_cast<std::uint8_t*>(bytes.data()),
                       static_cast<std::uint32_t>(bytes.size()));
        return bytes;
    }

    static bool read(const TypeInfo& type, SlotHeader& slot, const std::string& bytes) {
        return type.deserialize(slot, reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                static_cast<std::uint32_t>(bytes.size()));
    }

    std::mt19937_64 random_{1};
    const TypeInfo& real_ = typeInfo<Port>();
    const TypeInfo& ours_ = python::typeInfoOf(Table<Shape>::table);
    Slot<Port> real_slot_;
    std::shared_ptr<SlotHeader> our_slot_ = ours_.make_slot(nullptr);
};

using Shapes = testing::Types<
    Numbers<bool, 1>, Numbers<bool, 9>, Numbers<std::int8_t, 3>, Numbers<std::int16_t, 7>,
    Numbers<std::int32_t, 4>, Numbers<std::int64_t, 5>, Numbers<std::int64_t, 17>,
    Numbers<std::uint8_t, 32>, Numbers<std::uint16_t, 2>, Numbers<std::uint32_t, 12>,
    Numbers<std::uint64_t, 77>, Matrix<double, 1, 1>, Matrix<double, 2, 1>, Matrix<double, 3, 1>,
    Matrix<double, 4, 1>, Matrix<double, 7, 1>, Matrix<double, 64, 1>, Matrix<double, 1, 2>,
    Matrix<double, 1, 3>, Matrix<double, 1, 4>, Matrix<double, 2, 2>, Matrix<double, 3, 3>,
    Matrix<double, 2, 3>, Matrix<double, 6, 6>, Matrix<double, 5, 7>, Matrix<float, 1, 1>,
    Matrix<float, 3, 1>, Matrix<float, 4, 1>, Matrix<float, 2, 2>, Matrix<float, 3, 2>,
    Matrix<float, 8, 8>, Matrix<float, 1, 5>, Matrix<float, 3, 4>>;
TYPED_TEST_SUITE(PythonArray, Shapes, );

}  // namespace

TYPED_TEST(PythonArray, EqualsTheTypeOfCpp) {
    EXPECT_STREQ(this->ours_.name, this->real_.name);
    EXPECT_STREQ(this->ours_.md5, this->real_.md5);
    EXPECT_EQ(this->ours_.size, this->real_.size);
    EXPECT_EQ(this->ours_.alignment, this->real_.alignment);
    EXPECT_STREQ(this->ours_.ros_type, this->real_.ros_type);
    EXPECT_STREQ(this->ours_.ros_md5, this->real_.ros_md5);
    EXPECT_STREQ(this->ours_.ros_definition, this->real_.ros_definition);
    EXPECT_EQ(this->ours_.plain, this->real_.plain);
    EXPECT_EQ(this->ours_.fixed_size, this->real_.fixed_size);
    EXPECT_EQ(this->ours_.flat, this->real_.flat);
    EXPECT_EQ(this->ours_.builds_message, this->real_.builds_message);
    EXPECT_EQ(this->ours_.is_double, this->real_.is_double);
    EXPECT_EQ(this->ours_.sample(), this->real_.sample());
    EXPECT_EQ(this->ours_.copies(), this->real_.copies());
    EXPECT_TRUE(sameType(this->ours_, this->real_));
}

TYPED_TEST(PythonArray, HasTheMessagesAndTextsOfCpp) {
    for (int i = 0; i < 20; ++i) {
        this->fill(this->draw());
        const std::string bytes = this->bytesOf(this->real_, this->real_slot_);
        EXPECT_EQ(this->bytesOf(this->ours_, *this->our_slot_), bytes);
        EXPECT_EQ(this->ours_.print(*this->our_slot_), this->real_.print(this->real_slot_));
        const std::shared_ptr<SlotHeader> read = this->ours_.make_slot(nullptr);
        ASSERT_TRUE(this->read(this->ours_, *read, bytes));
        EXPECT_EQ(this->bytesOf(this->ours_, *read), bytes);
        EXPECT_FALSE(this->read(this->ours_, *read, bytes + '\0'));
        EXPECT_FALSE(this->read(this->ours_, *read, bytes.substr(1)));
    }
}

TYPED_TEST(PythonArray, IsFiniteIfThatOfCppIs) {
    auto values = this->draw();
    this->fill(values);
    EXPECT_TRUE(this->ours_.finite(*this->our_slot_));
    if constexpr (std::is_floating_point_v<typename TypeParam::Scalar>) {
        for (const auto bad : {std::numeric_limits<typename TypeParam::Scalar>::quiet_NaN(),
                               -std::numeric_limits<typename TypeParam::Scalar>::infinity()}) {
            values.back() = bad;
            this->fill(values);
            EXPECT_FALSE(this->real_.finite(this->real_slot_));
            EXPECT_FALSE(this->ours_.finite(*this->our_slot_));
            EXPECT_EQ(this->ours_.print(*this->our_slot_), this->real_.print(this->real_slot_));
        }
    }
}

TYPED_TEST(PythonArray, IsCopiedAndExchangedLikeThatOfCpp) {
    this->fill(this->draw());
    this->our_slot_->stamp = 9;
    // The table's functions work on slots of C++, and vice versa, since the two can be connected.
    Slot<typename TypeParam::Port> other;
    this->ours_.copy(other, *this->our_slot_);
    EXPECT_EQ(other.stamp, 9);
    EXPECT_EQ(this->real_.print(other), this->ours_.print(*this->our_slot_));
    const std::string first = this->bytesOf(this->ours_, *this->our_slot_);
    this->fill(this->draw());
    const std::string second = this->bytesOf(this->ours_, *this->our_slot_);
    this->ours_.exchange(other, *this->our_slot_);
    EXPECT_EQ(this->bytesOf(this->real_, other), second);
    EXPECT_EQ(this->bytesOf(this->ours_, *this->our_slot_), first);
    const std::shared_ptr<SlotHeader> made = this->ours_.make_slot(this->our_slot_.get());
    EXPECT_EQ(this->bytesOf(this->ours_, *made), first);
    EXPECT_EQ(made->stamp, 0);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(valueOf(this->ours_, *made)) % this->ours_.alignment,
              0U);
}

TYPED_TEST(PythonArray, EqualsTheStateOfCpp) {
    using Real = typename TypeParam::State;
    const StateDeclaration ours = python::stateOf(Table<TypeParam>::table);
    EXPECT_EQ(ours.type, StateType<Real>::name());
    EXPECT_EQ(ours.identity, StateType<Real>::identity());
    EXPECT_EQ(ours.size, sizeof(Real));
    const auto values = this->draw();
    Real real;
    std::memcpy(static_cast<void*>(&real), values.data(), sizeof real);
    std::string text;
    StateType<Real>::print(real, text);
    EXPECT_EQ(ours.print(values.data()), text);
}

TYPED_TEST(PythonArray, IsRowMajorInTheRecord) {
    const python::ValueCopy copy(Table<TypeParam>::table);
    const auto values = this->draw();
    this->fill(values);
    auto record = values;
    copy.toRecord(record.data(), &this->real_slot_.value);
    if constexpr (std::is_floating_point_v<typename TypeParam::Scalar>) {
        for (int row = 0; row < TypeParam::kRows; ++row) {
            for (int column = 0; column < TypeParam::kColumns; ++column) {
                EXPECT_EQ(record.at(static_cast<std::size_t>(row * TypeParam::kColumns + column)),
                          this->real_slot_.value(row, column));
            }
        }
    } else {
        EXPECT_EQ(record, values);
    }
    Slot<typename TypeParam::Port> back;
    copy.toPort(&back.value, record.data());
    EXPECT_EQ(this->bytesOf(this->real_, back), this->bytesOf(this->real_, this->real_slot_));
}

TEST(PythonArrayOfThreeDimensions, EqualsANestedArrayOfCpp) {
    using Real = std::array<std::array<std::array<double, 4>, 3>, 2>;
    TypeTable table = Table<Matrix<double, 3, 4>>::table;
    table.depth = 2;
    const StateDeclaration ours = python::stateOf(table);
    EXPECT_EQ(ours.type, "double[2x3x4]");
    EXPECT_EQ(ours.identity, StateType<Real>::identity());
    EXPECT_EQ(ours.size, sizeof(Real));
    std::swap(table.depth, table.rows);
    EXPECT_NE(python::stateOf(table).identity, StateType<Real>::identity());
}

TEST(PythonArrayOfThreeDimensions, IsPrintedMatrixByMatrix) {
    TypeTable table = Table<Numbers<std::int16_t, 4>>::table;
    table.depth = table.rows = table.columns = 2;
    const std::array<std::int16_t, 8> values{1, 2, 3, 4, 5, 6, 7, -8};
    EXPECT_EQ(rtcf_python_print_state(&table, values.data()), "[[1, 2; 3, 4], [5, 6; 7, -8]]");
    const std::array<bool, 8> flags{true};
    table.scalar = Scalar::Bool;
    EXPECT_EQ(rtcf_python_print_state(&table, flags.data()), "[[1, 0; 0, 0], [0, 0; 0, 0]]");
}

template <typename T>
class PythonNumber : public testing::Test {};
using Elements =
    testing::Types<bool, std::int8_t, std::int16_t, std::int32_t, std::int64_t, std::uint8_t,
                   std::uint16_t, std::uint32_t, std::uint64_t, float, double>;
TYPED_TEST_SUITE(PythonNumber, Elements, );

TYPED_TEST(PythonNumber, EqualsTheTypeAndTheStateOfCpp) {
    const TypeTable table{scalarOf<TypeParam>(), 0, 0};
    EXPECT_EQ(&python::typeInfoOf(table), &typeInfo<TypeParam>());
    const StateDeclaration ours = python::stateOf(table);
    EXPECT_EQ(ours.type, StateType<TypeParam>::name());
    EXPECT_EQ(ours.identity, StateType<TypeParam>::identity());
    EXPECT_EQ(ours.size, sizeof(TypeParam));
    const auto value = std::numeric_limits<TypeParam>::max();
    std::string text;
    StateType<TypeParam>::print(value, text);
    EXPECT_EQ(ours.print(&value), text);
}

}  // namespace rtcf::test
