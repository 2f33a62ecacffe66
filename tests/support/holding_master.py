"""A relay to a ROS master that can delay calls of one kind."""

import select
import socket
import threading
from contextlib import suppress


class HoldingMaster:
    """Relays to a real master and counts the calls. Between `hold` and `let_go`, calls that
    unregister publishers wait."""

    def __init__(self, master_port: int) -> None:
        self._real = ("localhost", master_port)
        self._listener = socket.create_server(("localhost", 0))
        self.uri = f"http://localhost:{self._listener.getsockname()[1]}"
        self._open = threading.Event()
        self._open.set()
        self._calls: list[bytes] = []
        self._held: set[socket.socket] = set()
        threading.Thread(target=self._accept, daemon=True).start()

    def hold(self) -> None:
        """Delay unregistering calls from now on."""
        self._open.clear()

    def let_go(self) -> None:
        """Forward the delayed calls to the master."""
        self._open.set()

    @property
    def holding(self) -> bool:
        """Whether a caller waits for the answer of an unregistering call."""
        return bool(self._held)

    def calls(self, *parts: bytes) -> int:
        """Return the number of calls that contain all these parts."""
        return sum(all(part in call for part in parts) for call in list(self._calls))

    def close(self) -> None:
        """Accept no more calls."""
        self._open.set()
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                caller, _ = self._listener.accept()
                threading.Thread(target=self._relay, args=(caller,), daemon=True).start()

    def _relay(self, caller: socket.socket) -> None:
        waiting = b""
        with suppress(OSError), caller, socket.create_connection(self._real) as real:
            while True:
                if waiting and self._open.is_set():
                    real.sendall(waiting)
                    waiting = b""
                readable, _, _ = select.select([caller, real], [], [], 0.01)
                if caller in readable:
                    if not (call := caller.recv(65536)):
                        break
                    self._calls.append(call)
                    if b"unregisterPublisher" in call:
                        waiting = call
                        self._held.add(caller)
                    else:
                        real.sendall(call)
                if real in readable:
                    if not (answer := real.recv(65536)):
                        break
                    self._held.discard(caller)
                    caller.sendall(answer)
        self._held.discard(caller)
