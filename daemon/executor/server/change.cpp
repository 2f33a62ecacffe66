#include "server/change.hpp"

#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/error.hpp"
#include "messages/from_wire.hpp"
#include "messages/snapshot_file.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

// Trusts the owner of the library's folder, if rtcfd names one.
template <typename Message>
void trustOwnerOf(Runner& runner, const Message& message) {
    if (message.has_owner()) runner.trust(message.owner());
}

}  // namespace

ChangeOutcome change(Runner& runner, const v1::Request& request, const Progress& progress,
                     const std::atomic<bool>& given_up) {
    switch (request.kind_case()) {
        case v1::Request::kStart:
            return runner.start(progress);
        case v1::Request::kStop:
            return runner.stop(progress);
        case v1::Request::kStep:
            if (request.step().cycles() == 0)
                throw Error(ErrorKind::InvalidArgument, "0 cycles to step: give a positive number");
            return runner.step(request.step().cycles(), progress, &given_up);
        case v1::Request::kLoad: {
            trustOwnerOf(runner, request.load());
            ComponentDefinition definition = definitionFrom(request.load().component());
            for (auto& [name, value] : parametersFrom(request.load().inherited()))
                definition.inherited.push_back({name, value});
            return runner.load(std::move(definition), request.load().library(), progress);
        }
        case v1::Request::kUnload: {
            std::vector<std::string> names;
            for (const std::string& name : request.unload().components())
                names.push_back(fullNameOf(name));
            return runner.unload(names, progress);
        }
        case v1::Request::kReplace: {
            trustOwnerOf(runner, request.replace());
            const std::string name = fullNameOf(request.replace().component());
            for (const auto& component : runner.graph()->components) {
                if (component->full_name != name) continue;
                return runner.replace(
                    name, replacementFrom(request.replace().replacement(), component->present()),
                    request.replace().library(), request.replace().reset_parameters(), progress);
            }
            throw Error(ErrorKind::NotFound, fmt::format("no component {} to replace", name));
        }
        case v1::Request::kApply: {
            std::map<std::pair<std::string, std::string>, std::shared_ptr<const TypePorts>> ports;
            for (const v1::TypePorts& type : request.apply().types()) {
                ports[{type.library(), type.type()}] = std::make_shared<TypePorts>(
                    TypePorts{{type.inputs().begin(), type.inputs().end()},
                              {type.outputs().begin(), type.outputs().end()}});
            }
            std::vector<WantedComponent> wanted;
            for (const v1::Load& load : request.apply().components()) {
                trustOwnerOf(runner, load);
                const auto type = ports.find({load.library(), load.component().type()});
                wanted.push_back({definitionFrom(load.component()), load.library(), load.anew(),
                                  type == ports.end() ? nullptr : type->second});
            }
            return runner.apply(wanted, request.apply().dry_run(), progress);
        }
        case v1::Request::kSetBreaks: {
            std::vector<std::pair<std::string, std::string>> ports;
            for (const pb::PortName& port : request.set_breaks().ports()) {
                ports.emplace_back(fullNameOf(port.component()), port.port());
            }
            return runner.setBreaks(ports, request.set_breaks().broken());
        }
        case v1::Request::kRestoreSnapshot:
            return runner.restore(snapshotFromFile(request.restore_snapshot().snapshot()),
                                  progress);
        case v1::Request::kResetState:
            return runner.reset(fullNameOf(request.reset_state().component()));
        case v1::Request::kSetState:
            return runner.setStates(fullNameOf(request.set_state().component()),
                                    parametersFrom(request.set_state().states()));
        case v1::Request::kWriteInput:
            return runner.writeInput(fullNameOf(request.write_input().component()),
                                     request.write_input().port(), request.write_input().message());
        case v1::Request::kSetParameters:
            return runner.setParameters(fullNameOf(request.set_parameters().component()),
                                        parametersFrom(request.set_parameters().parameters()));
        default:
            throw Error(ErrorKind::RequestMalformed,
                        "a request of unknown kind: is rtcfd newer than its executor?");
    }
}

}  // namespace rtcf::executor
