"""An oscilloscope in the browser: one page and the streams relayed to it.

`site` serves the page and the HTTP requests, `tab` handles the WebSocket of one page, `hub` reads
the single stream that all tabs of a runner share, and `authentication` authenticates requests.
"""
