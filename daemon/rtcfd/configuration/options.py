"""The options of rtcfd: from the command line, the configuration file and the environment,
in this order of precedence."""

import argparse
import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rtcf.v1 import runner_pb2
from rtcf_shared.folders import compiled_folder, component_folders

from rtcfd import VERSION
from rtcfd.access.rights import Access
from rtcfd.catalog.catalog import Folder
from rtcfd.common import regular_files, runner_settings
from rtcfd.common.errors import RequestError
from rtcfd.common.limits import Limits
from rtcfd.configuration import settings_file
from rtcfd.configuration.last_good import Settings
from rtcfd.executor.command import settings_error

# rtcf_shared.folders has the default folders of components.
_SOCKET = Path("/run/rtcfd/control.sock")
_RUNTIME_DIR = Path("/run/rtcfd")
_STATE_DIR = Path("/var/lib/rtcfd")
_GRAPHS_DIR = Path("/etc/rtcfd/graphs.d")
_EXECUTOR = Path("/usr/lib/rtcf/rtcf-executor")
_MOST_IN_MEMORY_MB = 100  # incidents
_REALTIME = {
    "required": runner_pb2.REALTIME_REQUIRED,
    "preferred": runner_pb2.REALTIME_PREFERRED,
}


@dataclass(frozen=True)
class Options:
    """All options of the daemon."""

    socket: Path
    runtime_dir: Path
    own_runtime_dir: bool  # created for this run, and removed at its end
    state_dir: Path | None
    executor: Path
    graphs_dir: Path | None
    folders: list[Folder]
    access: Access
    limits: Limits
    defaults: runner_pb2.RunnerSettings
    default_runner: bool
    end_with_stdin: bool
    foreground: bool
    verbose: bool
    settings: Settings  # from the configuration file

    @property
    def incidents_dir(self) -> Path:
        """The folder of incidents; without a state folder, it is removed at the end."""
        return (self.state_dir or self.runtime_dir) / "incidents"

    def settings_error(self, settings: runner_pb2.RunnerSettings) -> str:
        """Return why an executor would reject the settings of a runner; empty = it accepts them."""
        return settings_error(self.executor, runner_settings.merged(self.defaults, settings))


def parse(
    arguments: Sequence[str] | None,
    build_tree: Path | None,
    *,
    last_good: bool = False,
    writable: bool = False,
) -> Options:
    """Return the options; raises RequestError for a bad file, exits with 2 on bad usage.

    With `last_good`, the service uses the last good settings instead of bad ones.  With `writable`,
    settings are bad if this process cannot write to their folders.
    """
    args = _parser(build_tree).parse_args(arguments)

    def executor(file: settings_file.Config) -> Path:
        return _absolute(args.executor or file.executor or _executor_of(build_tree))

    settings = Settings.read(
        _file(args),
        _kept_folder(args),
        last_good,
        lambda file: settings_error(executor(file), file.runner),
        writable=writable,
    )
    file = settings.found
    socket = _socket(args, file)
    realtime = args.realtime or file.realtime or ("preferred" if args.foreground else "required")
    runtime_dir = args.runtime_dir or file.runtime_dir
    state_dir = args.state_dir or file.state_dir
    graphs_dir = args.graphs_dir or file.graphs_dir
    own_runtime_dir = False
    if args.foreground:
        own_runtime_dir = runtime_dir is None
        runtime_dir = runtime_dir or socket.with_name(socket.name + ".d")
    else:
        runtime_dir = runtime_dir or _RUNTIME_DIR
        state_dir = state_dir or _from_systemd("STATE_DIRECTORY", _STATE_DIR)
        graphs_dir = graphs_dir or _GRAPHS_DIR
    return Options(
        socket=socket,
        runtime_dir=_absolute(runtime_dir),
        own_runtime_dir=own_runtime_dir,
        state_dir=_absolute(state_dir) if state_dir else None,
        executor=executor(file),
        graphs_dir=_absolute(graphs_dir) if graphs_dir else None,
        folders=_folders([*args.path, *file.path], build_tree)
        + ([Folder(compiled_folder(), named=True)] if args.foreground else []),
        access=file.access,
        limits=file.limits if state_dir else _in_memory(file.limits),
        defaults=runner_settings.merged(
            runner_settings.defaults(
                _REALTIME[realtime],
                runner_settings.PRIVATE_ORPHAN_TIMEOUT_S
                if args.foreground
                else runner_settings.ORPHAN_TIMEOUT_S,
                # A private rtcfd belongs to one user, and so do the ROS peers of its loops.
                runner_pb2.RIGHT_ADMIN if args.foreground else runner_pb2.RIGHT_OBSERVE,
            ),
            file.runner,
        ),
        default_runner=args.default_runner,
        end_with_stdin=args.end_with_stdin,
        foreground=args.foreground,
        verbose=args.verbose,
        settings=settings,
    )


def _parser(build_tree: Path | None) -> argparse.ArgumentParser:
    folders = "\n".join(f"  {folder}" for folder in component_folders([], build_tree))
    parser = argparse.ArgumentParser(
        prog="rtcfd",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Supervises real-time control loops and serves rtcfctl and other clients.",
        epilog=textwrap.dedent(
            """\
            Without --foreground, rtcfd is the systemd service: it keeps its files in
            /run/rtcfd and /var/lib/rtcfd, requires real-time rights, and reads its
            settings from /etc/rtcfd/rtcfd.toml.
            With --foreground, rtcfd is private: it prefers real-time rights, keeps state
            only with --state-dir, else incidents until its end, and reads settings only
            with --config.  Its loops stop soon after it, even if it crashes
            (orphan_timeout_s = 2 instead of 60).

            rtcfd searches for components in <folder>/<package>/*.so, in this order:
              each --path, then each `path` of the configuration file, then
            """
        )
        + folders
        + "\n(They include <prefix>/lib/rtcf-components of each prefix in CMAKE_PREFIX_PATH.\n"
        "With --foreground, libraries compiled by `rtcfctl load FILE.py` come last.)",
    )
    parser.add_argument("--version", action="version", version=f"rtcfd {VERSION}")
    parser.add_argument(
        "--foreground", action="store_true", help="run privately, from a terminal or a script"
    )
    parser.add_argument(
        "--socket",
        type=Path,
        metavar="PATH",
        help=f"listen on this control socket (default: $RTCF_SOCKET, else {_SOCKET})",
    )
    parser.add_argument(
        "--runtime-dir",
        type=Path,
        metavar="DIR",
        help="put the executors' sockets into this folder (default: /run/rtcfd; "
        "with --foreground: the control socket's path and .d, removed at the end)",
    )
    parser.add_argument(
        "--state-dir",
        type=Path,
        metavar="DIR",
        help="keep persistent state in this folder (default: $STATE_DIRECTORY, else "
        "/var/lib/rtcfd; with --foreground: none)",
    )
    parser.add_argument(
        "--graphs-dir",
        type=Path,
        metavar="DIR",
        help="apply the graphs in this folder at the start "
        f"(default: {_GRAPHS_DIR}; with --foreground: none)",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help=f"read settings from this file (default: {settings_file.DEFAULT_FILE} if it exists; "
        "with --foreground: none)",
    )
    parser.add_argument(
        "--path",
        type=Path,
        metavar="DIR",
        action="append",
        default=[],
        help="search this folder for component packages, before all others (repeatable)",
    )
    parser.add_argument(
        "--executor",
        type=Path,
        metavar="FILE",
        help=f"run this executor binary (default: {_executor_of(build_tree)})",
    )
    parser.add_argument(
        "--realtime",
        choices=sorted(_REALTIME),
        help="reject loops without real-time rights, or only warn "
        "(default: required; with --foreground: preferred)",
    )
    parser.add_argument(
        "--no-default-runner",
        dest="default_runner",
        action="store_false",
        help="do not create the runner rt_runner",
    )
    parser.add_argument(
        "--end-with-stdin",
        action="store_true",
        help="shut down in order when standard input closes, as at the end of the process that "
        "writes to it; then also remove the control socket's folder if it is empty",
    )
    parser.add_argument(
        "--reload",
        action="store_true",
        help="make the running rtcfd reload its settings and graphs, and exit",
    )
    parser.add_argument(
        "--check-config",
        action="store_true",
        help="check settings and graphs, their components and users, and exit with status 0 "
        "(valid) or 1; as root, without --config, also the access of the service's user to files "
        "and folders",
    )
    parser.add_argument("--verbose", action="store_true", help="log debugging messages too")
    return parser


@dataclass(frozen=True)
class Reload:
    """A wanted reload."""

    socket: Path  # of the rtcfd to reload
    problem: str = ""  # the error in the settings file, which that rtcfd reads again and reports


def reload_wanted(arguments: Sequence[str] | None) -> Reload | None:
    """Return what --reload wants; None without --reload.

    Also of a bad file, because the running rtcfd has to report the error in its status.
    """
    args = _parser(None).parse_args(arguments)
    if not args.reload:
        return None
    if args.socket:
        return Reload(_absolute(args.socket))
    file = _file(args)
    try:
        return Reload(_socket(args, Settings.read(file, None, last_good=False).found))
    except RequestError as error:
        named = Settings.socket_in_bad(file, _kept_folder(args)) if file else None
        return Reload(_socket(args, settings_file.Config(socket=named)), str(error))


def _in_memory(limits: Limits) -> Limits:
    """Return the limits if incidents are in the runtime folder, which is often in memory."""
    return replace(limits, incidents_mb=min(limits.incidents_mb, _MOST_IN_MEMORY_MB))


def _file(args: argparse.Namespace) -> Path | None:
    chosen: Path | None = args.config
    if chosen is None and not args.foreground:
        chosen = settings_file.DEFAULT_FILE
        try:
            regular_files.require_present(chosen)
        except FileNotFoundError:
            return None
        except OSError:
            pass  # the file exists, and reading it raises the error
    return chosen


def _kept_folder(args: argparse.Namespace) -> Path | None:
    """Return the folder of the last good settings; a private rtcfd has none."""
    if args.foreground:
        return None
    return _absolute(args.state_dir or _from_systemd("STATE_DIRECTORY", _STATE_DIR))


def _socket(args: argparse.Namespace, file: settings_file.Config) -> Path:
    return _absolute(args.socket or file.socket or Path(os.environ.get("RTCF_SOCKET") or _SOCKET))


def check_wanted(arguments: Sequence[str] | None) -> bool:
    """Return whether the command line has --check-config."""
    return bool(_parser(None).parse_args(arguments).check_config)


def checks_service(arguments: Sequence[str] | None) -> bool:
    """Return whether the checked settings are those of the installed service."""
    args = _parser(None).parse_args(arguments)
    return args.config is None and not args.foreground


def _folders(named: Sequence[Path], build_tree: Path | None) -> list[Folder]:
    """Return the search path.  In named folders, libraries of the folder's owner are trusted."""
    chosen = {Path(os.path.abspath(folder)) for folder in named}
    return [Folder(path, path in chosen) for path in component_folders(named, build_tree)]


def _executor_of(build_tree: Path | None) -> Path:
    """Return the executor that belongs to this rtcfd."""
    return _EXECUTOR if build_tree is None else build_tree / "bin" / "rtcf-executor"


def _from_systemd(variable: str, default: Path) -> Path:
    # systemd.exec(5): a list separated by colons; ours has one entry.
    first = os.environ.get(variable, "").partition(":")[0]
    return Path(first) if first else default


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path))
