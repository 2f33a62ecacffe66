"""Lets a process that uses gRPC fork: imports gRPC without its handlers, which wait in a fork for
calls that are open.
"""

import os

_NAME = "GRPC_ENABLE_FORK_SUPPORT"
_before = os.environ.get(_NAME)
os.environ[_NAME] = "0"
import grpc  # noqa: E402

# Reads the environment, too.
grpc.insecure_channel("unix:/nonexistent").close()
# Programs that this process starts have the handlers.
if _before is None:
    del os.environ[_NAME]
else:
    os.environ[_NAME] = _before
