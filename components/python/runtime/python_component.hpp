/// @file
/// Component written in Python: has the ports, parameters and state that its table declares, and
/// calls the machine code of its hooks, which works on the component's record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "fixed_list.hpp"
#include "message_ports.hpp"
#include "settings.hpp"
#include "tables.hpp"
#include "value_ports.hpp"

namespace rtcf::python {

class PythonComponent final : public Component {
   public:
    /// @param table lives as long as the library
    explicit PythonComponent(const ComponentTable& table);

    bool prepare(const Values& proposed) override;
    bool start() override;
    void update() override;
    void safe() noexcept override;

   private:
    /// Memory of the members, in a separate block aligned to cache lines: `rtcfctl check` reports
    /// changes of undeclared members of the object, and the record is not part of it.
    class Record {
       public:
        explicit Record(const ComponentTable& table);
        std::byte* bytes() noexcept { return bytes_.get(); }
        RecordHead& head() noexcept { return *reinterpret_cast<RecordHead*>(bytes_.get()); }

       private:
        struct Free {
            ComponentMemory* memory;
            std::size_t size;
            void operator()(std::byte* bytes) const noexcept;
        };
        Record(const ComponentTable& table, std::size_t size, ComponentMemory* memory);

        std::unique_ptr<std::byte, Free> bytes_;
    };

    void reserve();
    void declare();
    void takeDt() noexcept;
    void readMore() noexcept;
    void takeTimes() noexcept;
    void writeOthers() noexcept;
    [[noreturn]] void fault(const void* raised);
    void forgetWrites() noexcept;
    std::string said(const void* raised, Record& record) const;

    const ComponentTable& table_;
    PortHookFunction update_;
    Record record_;
    FixedList<ValueInput> inputs_;
    FixedList<ValueOutput> outputs_;
    FixedList<MessageInput> message_inputs_;
    FixedList<MessageOutput> message_outputs_;
    FixedList<QueuePort> queues_;
    FixedList<ParameterField> parameters_;
    FixedList<DerivedField> derived_;
    std::unique_ptr<void*[]> ports_;    // ports of values, argument of hooks
    bool takes_dt_ = false;             // a hook uses dt
    bool has_more_ = false;             // hooks use other times, queues, or inputs of messages
    bool has_other_outputs_ = false;    // outputs of messages
    std::unique_ptr<Record> proposed_;  // record for prepare(); null without prepare()
};

}  // namespace rtcf::python
