"""The errors of rtcfd as exceptions, one for each reason of rtcf.v1.Reason.

Each is a RefusedError; its attribute `about` has the names that the docstrings quote as `name`.
This module is imported with the first error, to keep other commands fast.
"""

from rtcf.errors import RefusedError


class RequestMalformedError(RefusedError):
    """The request has the wrong type, or was sent in the wrong order."""


class NameMissingError(RefusedError):
    """A required name is missing: see `field`."""


class NameInvalidError(RefusedError):
    """A name is invalid."""


class TextTooLongError(RefusedError):
    """A name or a text is too long: see `field`."""


class ValueInvalidError(RefusedError):
    """A value is out of range or of the wrong type: see `parameter` or `setting`."""


class ExpressionInvalidError(RefusedError):
    """A regular expression is invalid, or its evaluation takes too long."""


class ComponentTwiceError(RefusedError):
    """A graph has two components of the same name."""


class RatesConflictError(RefusedError):
    """Two components run every n-th and m-th cycle, but neither n nor m divides the other."""


class RecordingInvalidError(RefusedError):
    """Messages of a replay do not match the types of their readers, or are out of order."""


class SettingsFileInvalidError(RefusedError):
    """The settings file of rtcfd is invalid."""


class PageTokenInvalidError(RefusedError):
    """The page token does not belong to this list."""


class RunnerNotFoundError(RefusedError):
    """The runner does not exist."""


class ComponentNotFoundError(RefusedError):
    """The runner has no such component."""


class ComponentNotLeftOutError(RefusedError):
    """The component is in the loop and needs no release."""


class PortNotFoundError(RefusedError):
    """The component has no such port."""


class ParameterNotFoundError(RefusedError):
    """The component has no such parameter."""


class PackageNotFoundError(RefusedError):
    """No component folder has the package."""


class TypeNotFoundError(RefusedError):
    """The package has no such type."""


class LeaseNotFoundError(RefusedError):
    """The lease of the component has expired."""


class IncidentNotFoundError(RefusedError):
    """The incident does not exist."""


class HoldNotFoundError(RefusedError):
    """The lease of the runner has expired."""


class RunnerExistsError(RefusedError):
    """A runner of that name already exists."""


class ComponentExistsError(RefusedError):
    """A component of that name already exists."""


class TypesDifferError(RefusedError):
    """Two ports of the same name have different types."""


class ConnectionsFormLoopError(RefusedError):
    """The connections form a cycle without a loop break."""


class TwoWritersError(RefusedError):
    """Two outputs write to the same connection."""


class TwoPacersError(RefusedError):
    """Two components of the graph pace the loop."""


class LibraryRefusedError(RefusedError):
    """A library cannot be loaded, or is not trusted."""


class HookFailedError(RefusedError):
    """A hook of a component failed, e.g. configure()."""


class NoMasterError(RefusedError):
    """A hook needs a ROS master, but none answers."""


class NoRealtimeError(RefusedError):
    """The machine does not permit a real-time thread."""


class NoStateError(RefusedError):
    """The component declares no state."""


class LoopRunsError(RefusedError):
    """The loop must be stopped first."""


class LoopFailedError(RefusedError):
    """The loop ended by a fault during the call."""


class LoopStoppedError(RefusedError):
    """The loop was stopped after this call was made."""


class ReplayRunsError(RefusedError):
    """The loop is busy with a replay."""


class NoReplayError(RefusedError):
    """No replay is running."""


class RunnerHeldError(RefusedError):
    """Another client holds the runner: see `holder`."""


class RunnerNotEmptyError(RefusedError):
    """The runner has components that are not leased."""


class HolderGoneError(RefusedError):
    """The client named in the request no longer holds the runner."""


class ParameterTooFastError(RefusedError):
    """The change exceeds the permitted rate of change of the parameter."""


class NothingToUndoError(RefusedError):
    """The history has no change to undo, or the value was changed by other means since."""


class ExecutorFailedError(RefusedError):
    """The executor failed to start."""


class ExecutorForeignError(RefusedError):
    """The version of the executor is incompatible with rtcfd."""


class ComponentLeftOutError(RefusedError):
    """The loop would run without a left-out component, and the request does not permit it."""


class ComponentRefusedError(RefusedError):
    """The component was rejected; the message has the reason."""


class ListChangedError(RefusedError):
    """The list changed between two pages: start again with the first page."""


class ExecutorDownError(RefusedError):
    """The runner has no executor at present."""


class ExecutorSilentError(RefusedError):
    """The executor does not answer, or its connection was lost."""


class LoopStuckError(RefusedError):
    """The loop reaches no cycle boundary."""


class HookStuckError(RefusedError):
    """A hook of a component has not returned within hook_timeout_s."""


class BusyError(RefusedError):
    """The operation did not begin or end in time."""


class RunnerEndingError(RefusedError):
    """The runner is being removed or restarted."""


class DaemonEndingError(RefusedError):
    """rtcfd is being stopped or restarted."""


class CallerGoneError(RefusedError):
    """The client of this operation has disconnected."""


class MachineSilentError(RefusedError):
    """The user database or a disk does not answer."""


class RightMissingError(RefusedError):
    """The caller lacks a right: see `right`."""


class ParameterForbiddenError(RefusedError):
    """The caller has no permission to set this parameter."""


class LimitReachedError(RefusedError):
    """A limit in [limits] of rtcfd's settings is reached: see `limit`."""


class RequestTooLargeError(RefusedError):
    """The request has more bytes than the call permits."""


class TooManyClientsError(RefusedError):
    """Too many connections, in total or of one user."""


class TooManyCallsError(RefusedError):
    """Too many simultaneous calls of one user."""


class StateTooLargeError(RefusedError):
    """The declared state is too large for one cycle boundary."""


class InternalError(RefusedError):
    """An internal error of rtcfd: see its log."""


# Reasons of a newer rtcfd that are missing here raise RefusedError.
BY_REASON: dict[str, type[RefusedError]] = {
    "REQUEST_MALFORMED": RequestMalformedError,
    "NAME_MISSING": NameMissingError,
    "NAME_INVALID": NameInvalidError,
    "TEXT_TOO_LONG": TextTooLongError,
    "VALUE_INVALID": ValueInvalidError,
    "EXPRESSION_INVALID": ExpressionInvalidError,
    "COMPONENT_TWICE": ComponentTwiceError,
    "RATES_CONFLICT": RatesConflictError,
    "RECORDING_INVALID": RecordingInvalidError,
    "SETTINGS_FILE_INVALID": SettingsFileInvalidError,
    "PAGE_TOKEN_INVALID": PageTokenInvalidError,
    "RUNNER_NOT_FOUND": RunnerNotFoundError,
    "COMPONENT_NOT_FOUND": ComponentNotFoundError,
    "COMPONENT_NOT_LEFT_OUT": ComponentNotLeftOutError,
    "PORT_NOT_FOUND": PortNotFoundError,
    "PARAMETER_NOT_FOUND": ParameterNotFoundError,
    "PACKAGE_NOT_FOUND": PackageNotFoundError,
    "TYPE_NOT_FOUND": TypeNotFoundError,
    "LEASE_NOT_FOUND": LeaseNotFoundError,
    "HOLD_NOT_FOUND": HoldNotFoundError,
    "INCIDENT_NOT_FOUND": IncidentNotFoundError,
    "RUNNER_EXISTS": RunnerExistsError,
    "COMPONENT_EXISTS": ComponentExistsError,
    "TYPES_DIFFER": TypesDifferError,
    "CONNECTIONS_FORM_LOOP": ConnectionsFormLoopError,
    "TWO_WRITERS": TwoWritersError,
    "TWO_PACERS": TwoPacersError,
    "LIBRARY_REFUSED": LibraryRefusedError,
    "HOOK_FAILED": HookFailedError,
    "NO_MASTER": NoMasterError,
    "NO_REALTIME": NoRealtimeError,
    "NO_STATE": NoStateError,
    "LOOP_RUNS": LoopRunsError,
    "LOOP_FAILED": LoopFailedError,
    "LOOP_STOPPED": LoopStoppedError,
    "REPLAY_RUNS": ReplayRunsError,
    "NO_REPLAY": NoReplayError,
    "RUNNER_HELD": RunnerHeldError,
    "RUNNER_NOT_EMPTY": RunnerNotEmptyError,
    "HOLDER_GONE": HolderGoneError,
    "PARAMETER_TOO_FAST": ParameterTooFastError,
    "NOTHING_TO_UNDO": NothingToUndoError,
    "EXECUTOR_FAILED": ExecutorFailedError,
    "EXECUTOR_FOREIGN": ExecutorForeignError,
    "COMPONENT_LEFT_OUT": ComponentLeftOutError,
    "COMPONENT_REFUSED": ComponentRefusedError,
    "LIST_CHANGED": ListChangedError,
    "EXECUTOR_DOWN": ExecutorDownError,
    "EXECUTOR_SILENT": ExecutorSilentError,
    "LOOP_STUCK": LoopStuckError,
    "HOOK_STUCK": HookStuckError,
    "BUSY": BusyError,
    "RUNNER_ENDING": RunnerEndingError,
    "DAEMON_ENDING": DaemonEndingError,
    "CALLER_GONE": CallerGoneError,
    "MACHINE_SILENT": MachineSilentError,
    "RIGHT_MISSING": RightMissingError,
    "PARAMETER_FORBIDDEN": ParameterForbiddenError,
    "LIMIT_REACHED": LimitReachedError,
    "REQUEST_TOO_LARGE": RequestTooLargeError,
    "TOO_MANY_CLIENTS": TooManyClientsError,
    "TOO_MANY_CALLS": TooManyCallsError,
    "STATE_TOO_LARGE": StateTooLargeError,
    "INTERNAL": InternalError,
}
