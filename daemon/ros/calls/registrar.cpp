#include "ros/calls/registrar.hpp"

#include <algorithm>
#include <chrono>
#include <memory>

#include "ros/threads/quiet_thread.hpp"

namespace rtcf::ros1 {

namespace {}  // namespace

Registrar::Registrar(Connect connect)
    : connect_(std::move(connect)), thread_(quietThread("ros-register", [this] { run(); })) {}

Registrar::~Registrar() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    cancel_ = true;
    changed_.notify_all();
    thread_.join();
}

bool Registrar::note(const std::string& method, const XmlRpc::XmlRpcValue& arguments) {
    constexpr const char* kRegister = "register";
    constexpr const char* kWithdraw = "unregister";
    const bool registers = method.rfind(kRegister, 0) == 0;
    if (!registers && method.rfind(kWithdraw, 0) != 0) return false;
    XmlRpc::XmlRpcValue values = arguments;
    const Key key{method.substr(std::string(registers ? kRegister : kWithdraw).size()),
                  static_cast<std::string&>(values[1])};
    {
        const std::lock_guard lock(mutex_);
        Entry& entry = entries_[key];
        entry.wanted = registers;
        if (registers) {
            entry.arguments = values;
            ++entry.version;
        } else if (entry.registered != Registered::No) {
            entry.renewed = true;
        }
        if (due(entry) == Step::None && !entry.wanted) entries_.erase(key);
    }
    changed_.notify_all();
    return true;
}

void Registrar::useMaster(const MasterAddress& master) {
    {
        const std::lock_guard lock(mutex_);
        master_ = master;
        ++master_version_;
        silent_ = false;
    }
    changed_.notify_all();
}

void Registrar::forget() {
    {
        const std::lock_guard lock(mutex_);
        for (auto entry = entries_.begin(); entry != entries_.end();) {
            entry->second.registered = Registered::No;
            entry->second.renewed = false;
            ++entry->second.version;  // the present call does not count
            entry = entry->second.wanted ? std::next(entry) : entries_.erase(entry);
        }
    }
    changed_.notify_all();
}

void Registrar::show(bool shown) {
    {
        const std::lock_guard lock(mutex_);
        if (shown == shown_) return;
        shown_ = shown;
    }
    changed_.notify_all();
}

void Registrar::retry() {
    {
        const std::lock_guard lock(mutex_);
        if (!silent_) return;
        silent_ = false;
    }
    changed_.notify_all();
}

bool Registrar::flush(Clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    silent_ = false;
    changed_.notify_all();
    const auto done = [&] { return stop_ || settled() || silent_; };
    return changed_.wait_until(lock, deadline, done) && settled();
}

bool Registrar::hasRegistered() const {
    const std::lock_guard lock(mutex_);
    return std::any_of(entries_.begin(), entries_.end(),
                       [](const auto& each) { return each.second.registered == Registered::Yes; });
}

std::size_t Registrar::withdraw(Clock::time_point deadline) {
    {
        const std::lock_guard lock(mutex_);
        deadline_ = deadline;
    }
    show(false);
    flush(deadline);
    const std::lock_guard lock(mutex_);
    deadline_ = Clock::time_point::max();
    return static_cast<std::size_t>(
        std::count_if(entries_.begin(), entries_.end(),
                      [](const auto& each) { return each.second.registered != Registered::No; }));
}

Registrar::Step Registrar::due(const Entry& entry) const {
    const bool wanted = entry.wanted && shown_;
    if (entry.registered != Registered::No && (!wanted || entry.renewed)) return Step::Withdraw;
    return wanted && entry.registered != Registered::Yes ? Step::Register : Step::None;
}

// With mutex_ held.
bool Registrar::settled() const {
    return !calling_ && std::all_of(entries_.begin(), entries_.end(), [this](const auto& each) {
        return due(each.second) == Step::None;
    });
}

// With mutex_ held. The arguments of a withdrawal are caller, name, and the URI of the
// registration.
std::vector<Registrar::Task> Registrar::tasks(std::vector<MasterCall>& calls) {
    std::vector<Task> tasks;
    for (auto& [key, entry] : entries_) {
        const Step step = due(entry);
        if (step == Step::None) continue;
        tasks.push_back({key, step, entry.version});
        if (step == Step::Register) {
            // The master may receive it even if no answer arrives.
            entry.registered = Registered::Maybe;
            calls.push_back({"register" + key.first, entry.arguments});
            continue;
        }
        XmlRpc::XmlRpcValue arguments = entry.arguments;
        const auto& caller = static_cast<std::string&>(arguments[0]);
        const auto& uri = static_cast<std::string&>(arguments[key.first == "Service" ? 2 : 3]);
        calls.push_back({"unregister" + key.first, texts({caller, key.second, uri})});
    }
    return tasks;
}

// With mutex_ held.
void Registrar::apply(const Task& task, MasterAnswer& answer,
                      std::vector<std::pair<std::string, XmlRpc::XmlRpcValue>>& connections) {
    const auto found = entries_.find(task.key);
    if (found == entries_.end()) return;
    Entry& entry = found->second;
    if (answer.silent()) {
        silent_ = true;
        return;
    }
    if (task.step == Step::Withdraw) {
        entry.registered = Registered::No;
        entry.renewed = false;
        if (!entry.wanted) entries_.erase(found);
        return;
    }
    // Also if the master rejects it: repeating it would not help.
    entry.registered = entry.version == task.version ? Registered::Yes : Registered::Maybe;
    const bool subscribed = task.key.first == "Subscriber" && entry.wanted;
    if (subscribed && answer.value.getType() == XmlRpc::XmlRpcValue::TypeArray)
        connections.emplace_back(task.key.second, answer.value);
}

void Registrar::run() {
    std::unique_ptr<ParallelCalls> master;
    std::uint64_t version = 0;
    std::unique_lock lock(mutex_);
    while (true) {
        changed_.wait(lock,
                      [this] { return stop_ || (!silent_ && master_version_ != 0 && !settled()); });
        if (stop_) return;
        if (master == nullptr || version != master_version_) {
            version = master_version_;
            master = std::make_unique<ParallelCalls>(master_, cancel_);
        }
        std::vector<MasterCall> calls;
        const std::vector<Task> due = tasks(calls);
        const Clock::time_point deadline = deadline_;
        calling_ = true;
        lock.unlock();
        std::vector<MasterAnswer> answers = master->run(calls, kMasterAnswerTimeout, deadline);
        std::vector<std::pair<std::string, XmlRpc::XmlRpcValue>> connections;
        lock.lock();
        calling_ = false;
        for (std::size_t i = 0; i < due.size(); ++i) apply(due[i], answers[i], connections);
        lock.unlock();
        changed_.notify_all();
        for (const auto& [topic, publishers] : connections) connect_(topic, publishers);
        lock.lock();
        // Closes the connections, because a master has a thread for each.
        if (settled()) master.reset();
    }
}

}  // namespace rtcf::ros1
