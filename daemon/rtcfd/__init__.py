"""rtcfd: the daemon that supervises real-time executors and serves `rtcf.v1.Control`.

It is never in the data path: loops run in executors, one process each.  One
asyncio thread owns all state of this package.
"""

VERSION = "0.1.0"
