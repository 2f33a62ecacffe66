#!/usr/bin/python3
"""A ROS master to which the way is long: stands before a real one, and takes its time for a call.

slow_master.py PORT REAL_PORT MILLISECONDS   the test ends it
"""

import http.client
import sys
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

_PORT, _REAL_PORT, _MILLISECONDS = (int(word) for word in sys.argv[1:])


class Way(BaseHTTPRequestHandler):
    """Hands over what it is asked, later."""

    protocol_version = "HTTP/1.1"

    def do_POST(self) -> None:  # noqa: N802: the base class's name
        """Answer one call."""
        body = self.rfile.read(int(self.headers["Content-Length"]))
        time.sleep(_MILLISECONDS / 1000)
        real = http.client.HTTPConnection("127.0.0.1", _REAL_PORT)
        real.request("POST", "/", body, {"Content-Type": "text/xml"})
        answer = real.getresponse().read()
        real.close()
        self.send_response(200)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *arguments: object) -> None:
        """Say nothing."""


ThreadingHTTPServer(("127.0.0.1", _PORT), Way).serve_forever()
