"""docs/architecture.md names files and threads that exist."""

import re

from pages import TREE

TEXT = (TREE / "docs" / "architecture.md").read_text()
# The functions that name a thread.
NAMED = re.compile(r'(?:pthread_setname_np\(pthread_self\(\), |quietThread\()"([a-z-]+)"')


def test_each_path_exists() -> None:
    # Paths of the installed system begin with a slash.
    paths = re.findall(r"`([\w.-]+(?:/[\w.-]+)+)`", TEXT)
    assert len(paths) > 50
    assert [path for path in paths if not (TREE / path).exists()] == []


def test_each_thread_of_the_executor_is_described() -> None:
    files = (TREE / "daemon").rglob("*.cpp")
    named = {name for file in files for name in NAMED.findall(file.read_text())}
    assert {"rtcf-loop", "ros-publish"} <= named
    assert sorted(name for name in named if f"`{name}`" not in TEXT) == []
