"""The command line of rtcfd, and what it makes of it, the configuration file and
the environment, in this order of precedence."""

import argparse
import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rtcf.v1 import runner_pb2
from rtcf_shared.folders import compiled_folder, component_folders

from rtcfd import VERSION
from rtcfd.access.rights import Access
from rtcfd.catalog.catalog import Folder
from rtcfd.common import regular_files, runner_settings
from rtcfd.common.limits import Limits
from rtcfd.configuration import paths, settings_file
from rtcfd.configuration.last_good import Settings
from rtcfd.executor import opinion

_REALTIME = {
    "required": runner_pb2.REALTIME_REQUIRED,
    "preferred": runner_pb2.REALTIME_PREFERRED,
}


@dataclass(frozen=True)
class Options:
    """All that the daemon needs to know."""

    socket: Path
    runtime_dir: Path
    own_runtime_dir: bool  # made for this run: removed at its end
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
    settings: Settings  # as they were read

    def opinion(self, settings: runner_pb2.RunnerSettings) -> str:
        """Return why an executor would refuse settings that a runner chooses, or nothing."""
        return opinion.of_settings(self.executor, runner_settings.merged(self.defaults, settings))


def parse(
    arguments: Sequence[str] | None, build_tree: Path | None, *, last_good: bool = False
) -> Options:
    """Return the options; raises Refusal for a bad file, exits with 2 on bad usage.

    With `last_good`, the service takes the last good settings in the place of bad ones.
    """
    args = _parser(build_tree).parse_args(arguments)
    kept = None
    if not args.foreground:
        kept = _absolute(args.state_dir or _from_systemd("STATE_DIRECTORY", paths.STATE_DIR))

    def executor(file: settings_file.Config) -> Path:
        return _absolute(args.executor or file.executor or paths.executor(build_tree))

    settings = Settings.read(
        _file(args),
        kept,
        last_good,
        lambda file: opinion.of_settings(executor(file), file.runner),
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
        runtime_dir = runtime_dir or paths.RUNTIME_DIR
        state_dir = state_dir or _from_systemd("STATE_DIRECTORY", paths.STATE_DIR)
        graphs_dir = graphs_dir or paths.GRAPHS_DIR
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
        limits=file.limits,
        defaults=runner_settings.merged(
            runner_settings.defaults(
                _REALTIME[realtime],
                runner_settings.PRIVATE_ORPHAN_TIMEOUT_S
                if args.foreground
                else runner_settings.ORPHAN_TIMEOUT_S,
                # Privately, its ROS is as much its user's as its socket.
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
            Without --foreground it is the systemd service: files under /run/rtcfd and
            /var/lib/rtcfd, real time required, settings from /etc/rtcfd/rtcfd.toml.
            With it, it is private: preferred real time, no state kept unless --state-dir
            is given, no settings read unless --config is given, and its loops stop soon
            after it however it ends (orphan_timeout_s = 2 instead of 60).

            Components are looked for in <folder>/<package>/*.so, in this order:
              each --path, then each `path` of the configuration file, then
            """
        )
        + folders
        + "\n(<prefix>/lib/rtcf-components of each prefix in CMAKE_PREFIX_PATH is among them;\n"
        "with --foreground, at last what `rtcfctl load FILE.py` has compiled for you.)",
    )
    parser.add_argument("--version", action="version", version=f"rtcfd {VERSION}")
    parser.add_argument(
        "--foreground", action="store_true", help="run privately, from a terminal or a script"
    )
    parser.add_argument(
        "--socket",
        type=Path,
        metavar="PATH",
        help=f"control socket (default: $RTCF_SOCKET, else {paths.SOCKET})",
    )
    parser.add_argument(
        "--runtime-dir",
        type=Path,
        metavar="DIR",
        help="for the executors' sockets (default: /run/rtcfd; "
        "with --foreground: the control socket's path and .d, removed at the end)",
    )
    parser.add_argument(
        "--state-dir",
        type=Path,
        metavar="DIR",
        help="for what is to outlive rtcfd (default: $STATE_DIRECTORY, else /var/lib/rtcfd; "
        "with --foreground: none)",
    )
    parser.add_argument(
        "--graphs-dir",
        type=Path,
        metavar="DIR",
        help=f"graphs to apply at the start (default: {paths.GRAPHS_DIR}; with --foreground: none)",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help=f"settings (default: {settings_file.DEFAULT_FILE} if it exists; "
        "with --foreground: none)",
    )
    parser.add_argument(
        "--path",
        type=Path,
        metavar="DIR",
        action="append",
        default=[],
        help="folder to look for component packages in, before all others (repeatable)",
    )
    parser.add_argument(
        "--executor",
        type=Path,
        metavar="FILE",
        help=f"executor binary (default: {paths.executor(build_tree)})",
    )
    parser.add_argument(
        "--realtime",
        choices=sorted(_REALTIME),
        help="whether a loop may run without real-time rights "
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
        help="end in order when standard input ends: with the process at its other end; "
        "then remove the control socket's folder too, if nothing else is in it",
    )
    parser.add_argument(
        "--reload",
        action="store_true",
        help="make the rtcfd that runs read its settings and graphs again, and exit",
    )
    parser.add_argument(
        "--check-config",
        action="store_true",
        help="only say whether settings and graphs are valid: exit status 0 or 1",
    )
    parser.add_argument("--verbose", action="store_true", help="log debugging messages too")
    return parser


def reload_wanted(arguments: Sequence[str] | None) -> Path | None:
    """Return the socket of the rtcfd that is to reload, if the command line says so."""
    args = _parser(None).parse_args(arguments)
    if not args.reload:
        return None
    return _socket(args, Settings.read(_file(args), None, last_good=False).found)


def _file(args: argparse.Namespace) -> Path | None:
    chosen: Path | None = args.config
    if chosen is None and not args.foreground:
        chosen = settings_file.DEFAULT_FILE
        try:
            regular_files.require_present(chosen)
        except FileNotFoundError:
            return None
        except OSError:
            pass  # there is one, and reading it says what is wrong
    return chosen


def _socket(args: argparse.Namespace, file: settings_file.Config) -> Path:
    return _absolute(
        args.socket or file.socket or Path(os.environ.get("RTCF_SOCKET") or paths.SOCKET)
    )


def check_wanted(arguments: Sequence[str] | None) -> bool:
    """Tell whether settings are only to be checked."""
    return bool(_parser(None).parse_args(arguments).check_config)


def _folders(named: Sequence[Path], build_tree: Path | None) -> list[Folder]:
    """Return where packages are; libraries in folders that are named may be of the folder's
    owner."""
    chosen = {Path(os.path.abspath(folder)) for folder in named}
    return [Folder(path, path in chosen) for path in component_folders(named, build_tree)]


def _from_systemd(variable: str, default: Path) -> Path:
    # systemd.exec(5): a list separated by colons; ours has one entry.
    first = os.environ.get(variable, "").partition(":")[0]
    return Path(first) if first else default


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path))
