/// @file
/// Parameters and derived members. Their values are in the component's record; commit() writes new
/// values to it at the cycle boundary at which the loop adopts them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "scalar.hpp"

namespace rtcf::python {

/// A parameter, or an element of an array parameter.
class ParameterField final : public ParameterBase {
   public:
    /// @param record the component's record, which contains the default
    ParameterField(Component* owner, const ParameterTable& table, std::byte* record)
        : ParameterBase(owner, declarationOf(table, record)),
          scalar_(table.scalar),
          size_(sizeOf(table.scalar)),
          offset_(static_cast<std::size_t>(table.offset)),
          field_(record + table.offset) {
        std::memcpy(value_, field_, size_);
        std::memcpy(staged_, field_, size_);
    }

    void stage(const ParameterValue& checked) override {
        is_staged_ = true;
        if (!declaration_.choices.empty()) {
            for (const Choice& choice : declaration_.choices) {
                if (choice.name == std::get<std::string>(checked))
                    std::memcpy(staged_, &choice.value, sizeof choice.value);
            }
            return;
        }
        withScalar(scalar_, [&](auto scalar) {
            using T = decltype(scalar);
            T value{};
            if constexpr (std::is_same_v<T, bool>) {
                value = std::get<bool>(checked);
            } else if constexpr (std::is_integral_v<T>) {
                value = static_cast<T>(std::get<std::int64_t>(checked));
            } else {
                value = static_cast<T>(std::get<double>(checked));
            }
            std::memcpy(staged_, &value, sizeof value);
        });
    }
    void commit() noexcept RTCF_NONBLOCKING override {
        std::swap(value_, staged_);
        is_staged_ = false;
        std::memcpy(field_, value_, size_);
    }
    void release() noexcept override { is_staged_ = false; }

    /// Copies the proposed value, or else the current one, to the record for prepare().
    void propose(std::byte* record) const noexcept {
        std::memcpy(record + offset_, is_staged_ ? staged_ : value_, size_);
    }

   private:
    static ParameterDeclaration declarationOf(const ParameterTable& table,
                                              const std::byte* record) {
        ParameterDeclaration declaration;
        declaration.name = table.name;
        declaration.unit = table.unit;
        declaration.doc = table.doc;
        if (table.has_minimum != 0) declaration.minimum = table.minimum;
        if (table.has_maximum != 0) declaration.maximum = table.maximum;
        declaration.fixed = table.fixed != 0;
        withScalar(table.scalar, [&](auto scalar) {
            std::memcpy(&scalar, record + table.offset, sizeof scalar);
            describe(declaration, scalar);
        });
        if (table.choice_count > 0) describeChoices(declaration, table);
        return declaration;
    }
    template <typename T>
    static void describe(ParameterDeclaration& declaration, T initial) {
        if constexpr (std::is_same_v<T, bool>) {
            declaration.type = "bool";
            declaration.default_value = initial;
        } else if constexpr (std::is_integral_v<T>) {
            declaration.type = "int";
            declaration.default_value = static_cast<std::int64_t>(initial);
        } else {
            declaration.type = "double";
            declaration.default_value = static_cast<double>(initial);
        }
        // Values must fit the type, even if the declared bounds are wider.
        constexpr bool kSmaller = sizeof(T) < sizeof(std::int64_t) && !std::is_same_v<T, bool>;
        constexpr auto kLowest = static_cast<double>(std::numeric_limits<T>::lowest());
        constexpr auto kHighest = static_cast<double>(std::numeric_limits<T>::max());
        if constexpr (kSmaller || std::is_same_v<T, std::uint64_t>)
            declaration.minimum = std::max(kLowest, declaration.minimum.value_or(kLowest));
        if constexpr (kSmaller)
            declaration.maximum = std::min(kHighest, declaration.maximum.value_or(kHighest));
    }

    /// Adds the choices of an enum parameter, as for an enum in C++.
    static void describeChoices(ParameterDeclaration& declaration, const ParameterTable& table) {
        const auto initial = std::get<std::int64_t>(declaration.default_value);
        declaration.type = "enum";
        for (std::int64_t i = 0; i < table.choice_count; ++i) {
            const ChoiceTable& choice = table.choices[i];
            declaration.choices.emplace_back(choice.name, choice.value);
            // If a value has several names, the first one is its name.
            if (choice.value == initial &&
                !std::holds_alternative<std::string>(declaration.default_value))
                declaration.default_value = std::string(choice.name);
        }
    }

    using Bytes = std::byte[sizeof(std::int64_t)];

    Scalar scalar_;
    std::size_t size_;
    std::size_t offset_;
    std::byte* field_;
    alignas(std::int64_t) Bytes value_{};
    alignas(std::int64_t) Bytes staged_{};
};

/// A derived member, which prepare() computes.
class DerivedField final : public DerivedBase {
   public:
    DerivedField(Component* owner, const DerivedTable& table, std::byte* record)
        : DerivedBase(owner),
          offset_(static_cast<std::size_t>(table.offset)),
          field_(record + table.offset),
          staged_(static_cast<std::size_t>(table.size)) {}

    /// Copies the new value from the record of prepare(). Not real-time safe.
    void stage(const std::byte* record) noexcept {
        std::memcpy(staged_.data(), record + offset_, staged_.size());
        is_staged_ = true;
    }
    void commit() noexcept RTCF_NONBLOCKING override {
        std::swap_ranges(staged_.begin(), staged_.end(), field_);
        is_staged_ = false;
    }
    void release() noexcept override { is_staged_ = false; }

   private:
    std::size_t offset_;
    std::byte* field_;
    std::vector<std::byte> staged_;
};

}  // namespace rtcf::python
