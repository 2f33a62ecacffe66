"""The refusals of rtcfd as exceptions, one for each reason of rtcf.v1.Reason.

Each is a RefusedError, whose attributes say what it is about.  Imported with the first refusal.
"""

from rtcf.errors import RefusedError


class RequestMalformedError(RefusedError):
    """No message of the type that belongs there, or not in its turn."""


class NameMissingError(RefusedError):
    """Something has to be named and is not: see `field`."""


class NameInvalidError(RefusedError):
    """No legal name."""


class TextTooLongError(RefusedError):
    """A name or a text: see `field`."""


class ValueInvalidError(RefusedError):
    """Out of its range, or of the wrong type: see `parameter` or `setting`."""


class ExpressionInvalidError(RefusedError):
    """No regular expression, or one that takes too long."""


class ComponentTwiceError(RefusedError):
    """One name stands twice in a graph."""


class RatesConflictError(RefusedError):
    """Two components run in every n-th and m-th cycle, and neither divides the other."""


class RecordingInvalidError(RefusedError):
    """Messages of a replay do not fit their readers, or are out of order."""


class SettingsFileInvalidError(RefusedError):
    """Rtcfd's settings file."""


class PageTokenInvalidError(RefusedError):
    """Not of this list."""


class RunnerNotFoundError(RefusedError):
    """There is no such runner."""


class ComponentNotFoundError(RefusedError):
    """Not in the runner."""


class ComponentNotLeftOutError(RefusedError):
    """It is in the loop, and needs no release."""


class PortNotFoundError(RefusedError):
    """The component has no such port."""


class ParameterNotFoundError(RefusedError):
    """The component has no such parameter."""


class PackageNotFoundError(RefusedError):
    """No folder of components has it."""


class TypeNotFoundError(RefusedError):
    """In its package."""


class LeaseNotFoundError(RefusedError):
    """The component is kept for its holder no more."""


class IncidentNotFoundError(RefusedError):
    """Of none that is kept."""


class HoldNotFoundError(RefusedError):
    """The runner is kept for its holder no more."""


class RunnerExistsError(RefusedError):
    """A runner of that name is there already."""


class ComponentExistsError(RefusedError):
    """A component of that name is there already."""


class TypesDifferError(RefusedError):
    """Two ports of one name carry different types."""


class ConnectionsFormLoopError(RefusedError):
    """Without a loop break."""


class TwoWritersError(RefusedError):
    """Of one connection."""


class TwoPacersError(RefusedError):
    """Two components that pace the loop."""


class LibraryRefusedError(RefusedError):
    """It cannot be loaded, or is not trusted."""


class HookFailedError(RefusedError):
    """Of a component, e.g. configure()."""


class NoMasterError(RefusedError):
    """A hook needs a ROS master, and none answers."""


class NoRealtimeError(RefusedError):
    """The machine gives no real-time thread."""


class NoStateError(RefusedError):
    """The component declares none."""


class LoopRunsError(RefusedError):
    """And would have to be stopped."""


class LoopFailedError(RefusedError):
    """It ended by a fault while this was under way."""


class LoopStoppedError(RefusedError):
    """A stop came after this was asked for."""


class ReplayRunsError(RefusedError):
    """Nothing else can be done meanwhile."""


class NoReplayError(RefusedError):
    """None is under way."""


class RunnerHeldError(RefusedError):
    """By somebody else: see `holder`."""


class RunnerNotEmptyError(RefusedError):
    """It has components of its own."""


class HolderGoneError(RefusedError):
    """The runner is not held any more by whom the request names."""


class ParameterTooFastError(RefusedError):
    """It may change by so much a second only."""


class NothingToUndoError(RefusedError):
    """No change of the parameter is known, or it was changed otherwise since."""


class ExecutorFailedError(RefusedError):
    """The executor does not start."""


class ExecutorForeignError(RefusedError):
    """The executor is of a version that this rtcfd does not work with."""


class ComponentLeftOutError(RefusedError):
    """The loop would run without it, and the request does not say that it may."""


class ComponentRefusedError(RefusedError):
    """For another reason, which the line tells."""


class ListChangedError(RefusedError):
    """Between two pages: begin with the first one again."""


class ExecutorDownError(RefusedError):
    """The runner has no executor now."""


class ExecutorSilentError(RefusedError):
    """It does not answer, or its connection was lost."""


class LoopStuckError(RefusedError):
    """The loop reaches no cycle boundary, or a hook does not return."""


class BusyError(RefusedError):
    """What was asked for has not begun, or is not done, in time."""


class RunnerEndingError(RefusedError):
    """The runner is being removed or restarted."""


class DaemonEndingError(RefusedError):
    """Rtcfd is being ended or restarted."""


class CallerGoneError(RefusedError):
    """Whom this was for has left."""


class MachineSilentError(RefusedError):
    """The user database or a disk does not answer."""


class RightMissingError(RefusedError):
    """See `right`."""


class ParameterForbiddenError(RefusedError):
    """The caller may set others only."""


class LimitReachedError(RefusedError):
    """Of [limits] in rtcfd's settings: see `limit`."""


class RequestTooLargeError(RefusedError):
    """More bytes than this call takes."""


class TooManyClientsError(RefusedError):
    """Connections, of all or of one user."""


class TooManyCallsError(RefusedError):
    """Of one user at a time."""


class StateTooLargeError(RefusedError):
    """Of declared state, for one boundary."""


class InternalError(RefusedError):
    """A fault of rtcfd, whose log has more."""


# By reason; a newer rtcfd may know others, which are RefusedError itself.
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
